"""What an operator asks of the guard over the bus, and how the answer is read from the state of the machine."""

from __future__ import annotations

import secrets
from typing import Any

from services.clock import Clock
from services.errors import RefusalError
from services.messages import Event, MachineState, OperatorRequest
from services.wire import DecodeError
from services.zenoh_bus import Inbox, ZenohBus

_ENDED = ("OFF", "FAULT")
REACHED = {"arm": ("ACTIVE",), "dry_run": ("ARMED",), "disarm": _ENDED, "reset": ("OFF",), "stop": _ENDED}
"""Requests, and the states of the guard that say that it was done."""


def ask(bus: ZenohBus, request: str, wait_s: float, clock: Clock) -> dict[str, Any]:
    """Ask, and return the state that answers: keys `guard_state`, `said`, `refused` (why, None if it was done).

    Parameters
    ----------
    bus
        An open bus.
    request
        One of `REACHED`.
    wait_s
        How long to wait for the machine (s), twice at most.
    clock
        Monotonic.
    """
    inbox = bus.subscribe(MachineState, Event)
    before = _next_state(inbox, clock, wait_s, lambda _: True)
    if before is None:
        known: dict[str, object] = {"machine": bus.machine, "request": request}
        raise RefusalError(f"machine {bus.machine} says nothing at {bus.endpoint}", known)
    nonce = secrets.token_hex(8)
    bus.publish(
        OperatorRequest(run=before.run, source="operator", sequence=0, request=request, nonce=nonce)  # pyright: ignore[reportArgumentType]
    )
    after = _next_state(inbox, clock, wait_s, lambda state: state.guard_state in REACHED[request])
    last = after or _next_state(inbox, clock, 0.5, lambda _: True) or before
    refused = None if after is not None else (last.reason or "no answer")
    return {
        "machine": bus.machine, "run": last.run, "request": request, "guard_state": last.guard_state,
        "said": last.reason, "refused": refused,
    }  # fmt: skip


def _next_state(inbox: Inbox, clock: Clock, wait_s: float, wanted: Any) -> MachineState | None:
    until = clock.now() + wait_s
    while clock.now() < until:
        for received in inbox.take():
            try:
                message = received.message()
            except DecodeError:
                continue
            if isinstance(message, MachineState) and wanted(message):
                return message
        clock.sleep_until(clock.now() + 0.002)
    return None
