"""Verbs for installation and recordings: `doctor` and `replay`."""

from __future__ import annotations

import math
import pathlib
from dataclasses import asdict
from typing import Annotated, Any

import typer

from services.cli.app import JsonFlag, OutDir, app, console, emit, positive, require, writable_folder
from services.cli.loop import conclude
from services.clock import WallClock


@app.command()
def doctor(as_json: JsonFlag = False) -> int:
    """Check the installation, the compiled kernels, the clock and a Zenoh round trip."""
    from services.doctor import examine

    found = examine(WallClock())
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
