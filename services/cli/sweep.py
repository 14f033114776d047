"""Verb that asks how robust a case is: `sweep`."""

from __future__ import annotations

import os
import pathlib
from collections.abc import Callable, Generator
from contextlib import contextmanager
from typing import Annotated, Any

import typer
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from services.cli.app import JsonFlag, OutDir, Seed, app, console, emit, positive, require, writable_folder
from services.cli.loop import CaseName
from services.clock import WallClock
from services.doubts import notes
from services.errors import InputError, RefusalError

Text = str | None


@app.command()
def sweep(
    case: CaseName,
    phase: Annotated[Text, typer.Option("--phase", help="Phases in units of pi: A:B:STEP, or a,b,c.")] = None,
    speed_rpm: Annotated[Text, typer.Option("--speed-rpm", help="Spindle speeds (1/min).")] = None,
    depth_mm: Annotated[Text, typer.Option("--depth-mm", help="Depths of cut (mm).")] = None,
    overhang_mm: Annotated[Text, typer.Option("--overhang-mm", help="Projections of the bar (mm).")] = None,
    noise: Annotated[Text, typer.Option("--noise", help="Force noise (N/sqrt(Hz)).")] = None,
    stiffness: Annotated[Text, typer.Option("--stiffness", help="Cutting stiffness over that of the case.")] = None,
    estimator: Annotated[Text, typer.Option("--estimator", help="Force estimators, with commas.")] = None,
    sensitivity: Annotated[Text, typer.Option("--sensitivity", help="Sensitivities of the detector.")] = None,
    seeds: Annotated[Text, typer.Option("--seeds", help="Seeds: A:B:STEP, or a,b,c.")] = None,
    closed_loop: Annotated[
        bool, typer.Option("--closed-loop", help="Let the loop decide, aiming at the phase.")
    ] = False,
    linear: Annotated[bool, typer.Option("--linear", help="Characteristic roots alone, nothing is cut.")] = False,
    feed_length_mm: Annotated[float, typer.Option("--feed-length-mm", help="Feed in each open-loop cut (mm).")] = 6.0,
    workers: Annotated[int | None, typer.Option("--workers", help="Processes (default: one for each core).")] = None,
    scheduler: Annotated[Text, typer.Option("--scheduler", help="Address of a dask scheduler.")] = None,
    limit: Annotated[int | None, typer.Option("--limit", help="Stop after so many cells; run again to go on.")] = None,
    fresh: Annotated[bool, typer.Option("--fresh", help="Forget what the folder already holds.")] = False,
    seed: Seed = None,
    out: OutDir = None,
    as_json: JsonFlag = False,
) -> None:
    """Cut a case over a grid of conditions: what stays stable? Finished cells in --out are not repeated."""
    from services.config import load_case
    from services.sweep.axes import parse_axis
    from services.sweep.cell import Mode
    from services.sweep.sweep import run_sweep, write_sweep

    if closed_loop and linear:
        raise InputError("linear", True, "left out with --closed-loop")
    given = {
        "phase": phase, "speed-rpm": speed_rpm, "depth-mm": depth_mm, "overhang-mm": overhang_mm, "noise": noise,
        "stiffness": stiffness, "estimator": estimator, "sensitivity": sensitivity, "seed": seeds,
    }  # fmt: skip
    axes = [parse_axis(option, text) for option, text in given.items() if text is not None]
    axes = axes or [parse_axis("phase", "0.5:1.5:0.1")]
    known = load_case(case)
    mode: Mode = "closed" if closed_loop else "linear" if linear else "open"
    count = workers if workers is not None else os.cpu_count() or 1
    require("workers", count, "from 1 to 256", 1 <= count <= 256)
    require("limit", limit or 1, "at least 1", (limit if limit is not None else 1) >= 1)
    positive("feed-length-mm", feed_length_mm, "mm")
    folder = writable_folder(out)
    with _bar() as progress:
        try:
            done = run_sweep(
                known, axes, mode=mode, seed=known.settings.seed if seed is None else seed, length_mm=feed_length_mm,
                folder=folder, workers=count, scheduler=scheduler, fresh=fresh, clock=WallClock(), progress=progress,
                most=limit,
            )  # fmt: skip
        except RefusalError as error:
            empty: dict[str, Any] = {"runs": None, "failed": None, "wall_s": None, "stable_band_pi": None}
            raise RefusalError(error.reason, empty) from error
    answer = done.as_dict()
    text = _words(answer)
    if folder is not None:
        from services.figures.sweep import write_sweep_figure

        answer["written"] = [*write_sweep(done, folder), write_sweep_figure(done, pathlib.Path(folder))]
        text += "".join(f"\nwrote {path}" for path in answer["written"])
    emit(answer, text, as_json)


def _words(answer: dict[str, Any]) -> str:
    band = answer["stable_band_pi"]
    told = "no phase is stable in every cell" if band is None else f"stable from {band[0]:g} to {band[1]:g} pi"
    lines = [f"{answer['runs']} cells in {answer['wall_s']:.1f} s ({answer['resumed']} from before); {told}."]
    if answer["failed"]:
        lines.append(f"{answer['failed']} failed: {'; '.join(answer['reasons'])}")
    if answer["not_run"]:
        lines.append(f"{answer['not_run']} not run")
    if answer["damaged_lines"]:
        lines.append(f"{answer['damaged_lines']} damaged lines of an earlier call were computed again")
    return "\n".join(lines) + notes(answer["doubts"])


@contextmanager
def _bar() -> Generator[Callable[[int, int], None]]:
    columns = (TextColumn("cells"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(), TextColumn("left"),
               TimeRemainingColumn())  # fmt: skip
    with Progress(*columns, console=console, disable=not console.is_terminal, transient=True) as bar:
        task = bar.add_task("cells", total=None)
        yield lambda done, total: bar.update(task, completed=done, total=total)
