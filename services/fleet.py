"""One process that serves several machines: a thread and a session for each, so that none waits for another.

What they share is the interpreter: compiled kernels and the bus work outside its lock, `bench fleet` says how many
machines a core carries. A node that fails ends its own thread, and its sign of life with it; the others go on.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Generator, Sequence
from contextlib import ExitStack, contextmanager
from typing import Any

from services.bus import Node
from services.clock import Clock
from services.node import Say, run_node
from services.process import Stopped, StopSignal
from services.zenoh_bus import ZenohBus

LOOK_S = 0.05


class _Waits:
    """Stands in for the signal in a thread, which no signal reaches: the bus ends the waiting when it is closed."""

    @contextmanager
    def waiting(self) -> Generator[None]:
        """Do nothing about signals."""
        yield


def run_fleet(
    service: str,
    make: Callable[[str], Node],
    buses: Sequence[ZenohBus],
    *,
    clock: Clock,
    stop: StopSignal,
    say: Say,
) -> list[dict[str, Any]]:
    """Serve several machines until stopped, and return for each what there was to count, or why it failed.

    Parameters
    ----------
    service, make, clock, say
        As for `run_node`.
    buses
        One open bus for each machine; all are closed here.
    stop
        Ends it.
    """
    answers: list[dict[str, Any]] = [{"service": service, "machine": bus.machine} for bus in buses]

    def serve(bus: ZenohBus, answer: dict[str, Any]) -> None:
        try:
            answer |= run_node(service, make, bus, clock=clock, stop=_Waits(), say=say)
        except Exception as error:  # told, and counted as a failure; the other machines must not suffer
            answer["failure"] = f"{type(error).__name__}: {error}"
            say(f"{service} of {bus.machine} failed: {answer['failure']}")

    threads = [
        threading.Thread(target=serve, args=pair, name=bus.machine, daemon=True)
        for bus, pair in ((bus, (bus, answer)) for bus, answer in zip(buses, answers, strict=True))
    ]
    with ExitStack() as stack:
        for bus in buses:
            stack.callback(bus.close)
        for thread in threads:
            thread.start()
        try:
            while any(thread.is_alive() for thread in threads):
                with stop.waiting():
                    clock.sleep_until(clock.now() + LOOK_S)
        except Stopped:
            pass
        for bus in buses:
            bus.hush()
        for thread in threads:
            thread.join(2.0)
    return answers
