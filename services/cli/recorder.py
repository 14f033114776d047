"""The verb `record`: what is said about a machine on the bus, in a file."""

from __future__ import annotations

import math
import pathlib
from collections.abc import Callable, Generator
from contextlib import contextmanager
from typing import Annotated, Any

import typer
from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

from services.cli.app import JsonFlag, app, console, emit, positive, require
from services.cli.services import Child, Connect, IdentityDir, known_as, on_bus, say
from services.clock import WallClock, utc_now
from services.errors import InputError
from services.process import Parent, Stopped, StopSignal
from services.zenoh_bus import check_machine

Out = Annotated[
    pathlib.Path, typer.Option("--out", help="New file (.mcap), or a folder in which a file named by date is made.")
]


@app.command()
def record(
    out: Out = pathlib.Path("runs"),
    machine: Annotated[str, typer.Option("--machine", help="Name of the machine.")] = "lathe-1",
    connect: Connect = None,
    duration_s: Annotated[
        float | None, typer.Option("--duration-s", help="How long (s); default: until stopped.")
    ] = None,
    part_s: Annotated[
        float, typer.Option("--part-s", help="A long recording goes on in a further file after so long (s).")
    ] = 480.0,
    identity: IdentityDir = None,
    as_json: JsonFlag = False,
    child: Child = False,
) -> int:
    """Record everything that is on the bus about a machine, until stopped."""
    until_s = math.inf if duration_s is None else positive("duration-s", duration_s, "s")
    require("part-s", part_s, "1 to 3600 s (its index is held in memory: 120 MB an hour)", 1.0 <= part_s <= 3600.0)
    check_machine(machine)
    answer: dict[str, Any] = {"service": "recorder", "machine": machine, "file": None, "messages": 0, "failure": None}
    with StopSignal() as stop:
        if child:
            Parent()
        try:
            with on_bus(machine, connect, None, stop, known_as("recorder", identity)) as bus:
                answer = _record(bus, file_for(out, machine), stop, until_s, part_s)
        except Stopped:  # before there was anything to record
            say("stopped")
    emit(answer, _words(answer), as_json)
    return 1 if answer["failure"] else 0


def file_for(out: pathlib.Path, machine: str) -> pathlib.Path:
    """Return the file to write: the one named, or a new one in the folder named."""
    if out.suffix.lower() == ".mcap" and not out.is_dir():
        return out
    if out.suffix and not out.is_dir():
        raise InputError("out", str(out), "a folder, or a file whose name ends in .mcap")
    return out / f"{machine}-{utc_now():%Y%m%dT%H%M%SZ}.mcap"


def _record(bus: Any, path: pathlib.Path, stop: StopSignal, until_s: float, part_s: float) -> dict[str, Any]:
    from services.bus_recorder import BusRecorder
    from services.recording_writer import PERIOD_S, McapRecorder, run_metadata
    from services.tape import versions

    known = run_metadata(
        case="", seed=None, run="", config="", digest="", version=versions()["antiphase"], clock="wall"
    ) | {"machine": bus.machine, "begun_utc": f"{utc_now():%Y-%m-%dT%H:%M:%S.%fZ}", "by": "record"}  # fmt: skip
    try:
        recorder = McapRecorder(path, known, new=True, part_chunks=math.ceil(part_s / PERIOD_S))
    except OSError as error:
        raise InputError("out", str(path), f"a file that can be written to ({error.strerror})") from error
    with recorder:
        listener = BusRecorder(bus, recorder, known, clock=WallClock(), say=say)
        say(f"recording {bus.machine} at {bus.endpoint} to {path}; Ctrl-C ends it")
        with _line() as show:
            listener.run(stop, until_s, show)
    return listener.answer()


@contextmanager
def _line() -> Generator[Callable[[str], None]]:
    """Show a line that changes on a terminal, nothing elsewhere."""
    columns = (SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn())
    with Progress(*columns, console=console, disable=not console.is_terminal, transient=True) as lines:
        task = lines.add_task("waiting for the machine")
        yield lambda text: lines.update(task, description=text)


def _words(answer: dict[str, Any]) -> str:
    if not answer["messages"]:
        return f"nothing was heard of {answer['machine']}" + (f"; {answer['file']}" if answer["file"] else "")
    text = (
        f"{answer['messages']} messages of {answer['machine']} in {answer['duration_s']:.1f} s, "
        f"{answer['missing']} missing, {answer['lost']} not written\nwrote {answer['file']}"
    )
    if answer["parts"] > 1:
        text += f" and {answer['parts'] - 1} further parts beside it: it is read with them"
    if not answer["config_known"]:
        text += "\nthe configuration was not told: is the machine one that answers on `config`?"
    return text + (f"\nincomplete: {answer['failure']}" if answer["failure"] else "")
