"""The loop as three processes in real time, seen by a parent that holds the router and keeps what it hears."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from services.children import Child, end_all, private_folder
from services.clock import Clock
from services.closed_loop import blocks_of
from services.config import Case
from services.errors import RefusalError
from services.messages import Message, SampleBlock
from services.metrics import SUMMARY_KEYS
from services.node import Say
from services.process import term_interrupts
from services.supervisor import FOLLOWERS, Plan
from services.tape import Tape
from services.wire import DecodeError
from services.zenoh_bus import Inbox, ZenohBus

FREE = "tcp/127.0.0.1:0"
LOOK_S = 0.004
SETTLE_S = 0.1
"""After the machine has ended, messages may come until none has for so long."""
START_S = 60.0
Hear = Callable[[str, bytes, str, Message], None]


@dataclass(slots=True)
class Demonstration:
    """What the parent saw.

    Attributes
    ----------
    tape
        All messages, with latency and speed as the machine measured them.
    services
        What each process said at its end, by its name.
    died
        Processes that ended too early, and why.
    interrupted
        Whether Ctrl-C ended it.
    undecodable
        Payloads that were no message.
    endpoint
        Where the router was.
    """

    tape: Tape
    services: dict[str, dict[str, Any]] = field(default_factory=dict[str, dict[str, Any]])
    died: dict[str, str] = field(default_factory=dict[str, str])
    interrupted: bool = False
    undecodable: int = 0
    endpoint: str = ""


def run_demo(
    name: str,
    case: Case,
    seed: int,
    *,
    clock: Clock,
    say: Say,
    arm_after_s: float | None = 0.0,
    hear: Hear | None = None,
    progress: Callable[[float], None] | None = None,
    listen: str = FREE,
    lasts: tuple[str, ...] = (),
    advise_only: bool = False,
) -> Demonstration:
    """Run a case as three processes and return everything that was on the bus; Ctrl-C ends it with what was seen.

    Parameters
    ----------
    name
        The case as on the command line, for the children.
    case
        The same case; the sensitivity of its monitor may be another.
    seed
        Of the plant's noise.
    clock
        Monotonic.
    say
        Told in words what happens.
    arm_after_s
        When the guard is armed (s); None: never.
    hear
        Called with topic, payload, encoding and message of everything, in the order of arrival.
    progress
        Told the share that is done, 0...1.
    listen
        Where the router listens.
    lasts
        Options of `machine` that say how long it goes on; default: as long as the case.
    advise_only
        Whether the controller only says what it would command.

    Raises
    ------
    RefusalError
        If a process cannot start.
    """
    plan = Plan(
        case=name, machine=case.settings.machine, seed=seed, arm_after_s=arm_after_s, lasts=lasts,
        sensitivity=case.monitor.sensitivity, advise_only=advise_only,
    )  # fmt: skip
    seen = Demonstration(tape=Tape())
    children: dict[str, Child] = {}
    with term_interrupts(), private_folder() as folder, ZenohBus.router(plan.machine, listen) as bus:
        seen.endpoint = bus.endpoint
        inbox = bus.subscribe()
        listener = _Listener(inbox, seen, hear, progress, blocks_of(case))
        try:
            for service in FOLLOWERS:
                children[service] = Child(service, plan.line(service, bus.endpoint), folder, quiet=True)
            machine = plan.machine_line(
                bus.endpoint, "--wait-s", str(START_S), "--latencies", *plan.arming()
            )
            children["machine"] = Child("machine", machine, folder, quiet=True)
            _hear_out(children, listener, seen, clock, say)
        except KeyboardInterrupt:
            seen.interrupted = True
        finally:
            end_all(children.values())
        listener.take()
        seen.services = {service: child.said() for service, child in children.items()}
        _conclude(seen, children)
    return seen


class _Listener:
    """Puts what comes on the tape."""

    def __init__(
        self, inbox: Inbox, seen: Demonstration, hear: Hear | None,
        progress: Callable[[float], None] | None, blocks: int,
    ) -> None:  # fmt: skip
        self._inbox, self._seen, self._hear, self._progress, self._blocks = inbox, seen, hear, progress, blocks

    def take(self) -> int:
        """Take everything that is there, and return how much it was."""
        count, block = 0, -1
        for received in self._inbox.take():
            count += 1
            try:
                message = received.message()
            except DecodeError:
                self._seen.undecodable += 1
                continue
            self._seen.tape.add(message)
            if isinstance(message, SampleBlock):
                block = message.sequence
            if self._hear is not None:
                self._hear(received.topic, received.payload, received.encoding, message)
        if block >= 0 and self._progress is not None:
            self._progress(min(1.0, (block + 1) / self._blocks))
        return count


def _hear_out(
    children: dict[str, Child], listener: _Listener, seen: Demonstration, clock: Clock, say: Say
) -> None:
    """Listen until the machine has ended and nothing more comes."""
    quiet_since = clock.now()
    while True:
        if listener.take():
            quiet_since = clock.now()
        for service, child in children.items():
            if service not in seen.died and child.ended() is not None and service != "machine":
                seen.died[service] = child.why()
                say(f"{service} ended too early: {seen.died[service]}")
        if children["machine"].ended() is not None and clock.now() - quiet_since > SETTLE_S:
            return
        if seen.died and not seen.tape.of(SampleBlock):
            return
        clock.sleep_until(clock.now() + LOOK_S)


def _conclude(seen: Demonstration, children: dict[str, Child]) -> None:
    machine = seen.services.get("machine", {})
    if not seen.interrupted and not machine.get("blocks"):
        first = next(iter(seen.died), "machine")
        reason = machine.get("reason") or f"{first} did not start: {children[first].why()}"
        unknown: dict[str, object] = {key: None for key in SUMMARY_KEYS}
        raise RefusalError(str(reason), unknown | {"service": first, "doubts": machine.get("doubts")})
    if not seen.interrupted and children["machine"].ended() != 0:
        seen.died["machine"] = children["machine"].why()
    seen.tape.latency_ms = [float(value) for value in machine.get("latency_ms") or []]
    seen.tape.wall_s = float(machine.get("wall_s") or 0.0)
    seen.tape.blocks_lost = int(seen.services.get("monitor", {}).get("blocks_lost") or 0)
