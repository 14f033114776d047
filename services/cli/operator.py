"""Verb that asks the guard of a machine: `operator`."""

from __future__ import annotations

import pathlib
from typing import Annotated

import typer

from services.cli.app import JsonFlag, app, emit, positive
from services.cli.services import Connect, IdentityDir, home, known_as
from services.clock import WallClock
from services.errors import InputError, RefusalError
from services.zenoh_bus import ZenohBus, check_endpoint


@app.command()
def operator(
    request: Annotated[str, typer.Argument(help="arm, dry_run, disarm, reset or stop.")],
    connect: Connect = None,
    name: Annotated[str, typer.Option("--machine", help="Name of the machine.")] = "lathe-1",
    event_log: Annotated[
        pathlib.Path | None, typer.Option("--event-log", help="File to which every event is appended, for the audit.")
    ] = None,
    wait_s: Annotated[float, typer.Option("--wait-s", help="How long to wait for the machine's answer (s).")] = 3.0,
    identity: IdentityDir = None,
    as_json: JsonFlag = False,
) -> None:
    """Ask something of the guard of a machine, and say what it answers by its state."""
    from services.operator_request import REACHED, ask

    if request not in REACHED:
        raise InputError("request", request, f"one of {', '.join(REACHED)}")
    positive("wait-s", wait_s, "s")
    known = known_as("operator", identity)
    endpoint = check_endpoint("connect", connect or home(known))
    with ZenohBus.client(name, endpoint, None, known) as bus:
        answer = ask(bus, request, wait_s, WallClock())
    if answer["refused"]:
        raise RefusalError(f"the guard is {answer['guard_state']}: {answer['refused']}", answer)
    emit(answer, f"guard of {name}: {answer['guard_state']} ({answer['said']})", as_json)
