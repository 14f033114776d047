"""Verbs for installation and recordings: `certs`, `doctor` and `replay`."""

from __future__ import annotations

import math
import pathlib
from dataclasses import asdict
from typing import Annotated, Any

import typer

from services.cli.app import JsonFlag, OutDir, app, console, emit, positive, require, writable_folder
from services.cli.loop import conclude
from services.clock import WallClock
from services.errors import InputError


@app.command()
def certs(
    out: Annotated[pathlib.Path, typer.Option("--out", help="Folder for keys and certificates.")] = pathlib.Path(
        "certs"
    ),
    days: Annotated[int, typer.Option("--days", help="For how long they are valid.")] = 365,
    host: Annotated[
        list[str] | None,
        typer.Option("--host", help="Name or address under which the router is reached; may be given several times."),
    ] = None,
    role: Annotated[list[str] | None, typer.Option("--role", help="One role; default: all.")] = None,
    as_json: JsonFlag = False,
) -> None:
    """Make a development authority and one certificate for each role, so that the bus asks everybody who he is."""
    from services.clock import utc_now
    from services.security.authority import make_authority

    names = make_authority(out, days, utc_now(), host or (), role or ())
    answer = {"folder": out, "files": names, "days": days}
    words = f"{len(names)} files in {out}, valid for {days} days; give --identity {out} to every service"
    emit(answer, f"{words}.\nKeep authority-key.pem elsewhere: who has it can be anybody.", as_json)


@app.command()
def doctor(
    identity: Annotated[
        pathlib.Path | None, typer.Option("--identity", help="Folder of certificates: probe every right of every role.")
    ] = None,
    connect: Annotated[
        str | None, typer.Option("--connect", help="The router to probe; default: one of its own.")
    ] = None,
    as_json: JsonFlag = False,
) -> int:
    """Check the installation, the compiled kernels, the clock, a Zenoh round trip and the rights on the bus."""
    from services.doctor import examine

    if connect is not None and identity is None:
        raise InputError("connect", connect, "given with --identity DIR: without certificates there are no rights")
    found = examine(WallClock(), identity, connect)
    lines = [f"{'ok  ' if f.ok else 'FAIL'}  {f.name:18} {f.detail}" for f in found]
    emit({"checks": [asdict(f) for f in found]}, "\n".join(lines), as_json)
    return 0 if all(f.ok for f in found) else 1


@app.command()
def replay(
    file: Annotated[pathlib.Path, typer.Argument(help="A run.mcap.")],
    pace: Annotated[float | None, typer.Option("--pace", help="Times real time; default: as fast as it goes.")] = None,
    start_s: Annotated[float, typer.Option("--from", help="Start of the stretch (s).")] = 0.0,
    stop_s: Annotated[float | None, typer.Option("--to", help="End of the stretch (s).")] = None,
    out: OutDir = None,
    as_json: JsonFlag = False,
) -> int:
    """Feed a recording to the monitor and the controller again, and compare what they say with what they said."""
    from services.replay import replay as play

    if pace is not None:
        positive("pace", pace, "times real time")
    require("from", start_s, "0 s or more", start_s >= 0.0)
    stop = math.inf if stop_s is None else require("to", stop_s, "after --from", stop_s > start_s)
    folder, clock = writable_folder(out), WallClock()
    started = clock.now()
    result = play(file, clock, start_s=start_s, stop_s=stop, pace=pace)
    seen = result.comparison
    extra: dict[str, Any] = {
        "same_as_recorded": seen.same,
        "compared": dict(seen.compared),
        "different": dict(seen.different),
        "examples": seen.examples,
        "notes": list(result.notes),
    }
    for line in (*result.notes, *seen.examples):
        console.print(f"note: {line}", markup=False, highlight=False)
    said = "to the bit" if seen.same else f"with {seen.different.total()} differences"
    text = f"\n{seen.compared.total()} messages compared with the recording: {said}."
    wall = clock.now() - started
    return conclude(result.case, result.seed, result.tape, False, folder, wall, as_json, extra=extra, more=text)
