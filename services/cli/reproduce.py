"""Verb that sets published numbers beside computed ones: `reproduce`."""

from __future__ import annotations

import pathlib
from collections.abc import Iterable
from typing import Annotated, Any

import typer

from services.cli.app import JsonFlag, OutDir, Seed, app, emit, writable_folder
from services.cli.loop import PlantModel, model_of, progress_bar
from services.clock import WallClock
from services.doubts import notes
from services.errors import InputError
from services.reproduce.plant import PlantName
from services.reproduce.rows import Row

NAMES = ("chapter6", "estimators", "robustness")
Found = tuple[Iterable[Row], list[pathlib.Path]]
"""Rows, and files that were written."""


@app.command()
def reproduce(
    name: Annotated[str, typer.Argument(help=f"Publication: {', '.join(NAMES)}, or all.", metavar="[NAME]")] = "all",
    plant: PlantModel = "lumped",
    seed: Seed = None,
    out: OutDir = None,
    as_json: JsonFlag = False,
) -> None:
    """Set every published number of a publication beside what the model computes, and say where they differ."""
    if name not in (*NAMES, "all"):
        raise InputError("name", name, f"one of {', '.join((*NAMES, 'all'))}")
    from services.reproduce.rows import as_table

    folder = writable_folder(out)
    rows: list[Row] = []
    written: list[pathlib.Path] = []
    if name in ("chapter6", "all"):
        _add(rows, written, _chapter6(model_of(plant), 1 if seed is None else seed, folder))
    if name in ("estimators", "all"):
        _add(rows, written, _estimators(folder))
    if name in ("robustness", "all"):
        _add(rows, written, _robustness(model_of(plant), folder))
    answer = as_table(rows)
    lines = [*(_line(row) for row in answer["rows"]), f"{answer['agree']} of {answer['total']} agree"]
    if answer["unprinted"]:
        lines.append(f"{answer['unprinted_hold']} of {answer['unprinted']} hold that have no print")
    if folder is not None:
        answer["written"] = written
    emit(answer, "\n".join([*lines, *(f"wrote {path}" for path in written)]), as_json)


def _add(rows: list[Row], written: list[pathlib.Path], found: Found) -> None:
    rows.extend(found[0])
    written.extend(found[1])


def _chapter6(plant: PlantName, seed: int, folder: pathlib.Path | None) -> Found:
    from services.reproduce.chapter6 import reproduce_chapter6

    with progress_bar("chapter 6 of the thesis") as progress:
        chapter = reproduce_chapter6(clock=WallClock(), seed=seed, plant=plant, progress=progress)
    if folder is None:
        return chapter.rows, []
    from services.figures.thesis import write_thesis_figures

    return chapter.rows, write_thesis_figures(chapter, folder)


def _estimators(folder: pathlib.Path | None) -> Found:
    from services.reproduce.estimators.study import reproduce_estimators, study_choice

    with progress_bar("cutting force without a sensor") as progress:
        study = reproduce_estimators(progress)
    if folder is None:
        return study.rows, []
    from services.figures.force_study import write_estimator_figures

    return study.rows, write_estimator_figures(study, study_choice(), folder)


def _robustness(plant: PlantName, folder: pathlib.Path | None) -> Found:
    from services.reproduce.robustness import robustness_rows, study_robustness

    with progress_bar("robustness of the pitch") as progress:
        study = study_robustness(plant, progress)
    if folder is None:
        return robustness_rows(study), []
    from services.figures.robustness import write_robustness

    return robustness_rows(study), [write_robustness(study, folder)]


def _line(row: dict[str, Any]) -> str:
    unit = f" {row['unit']}" if row["unit"] else ""
    printed, expected = row["printed"], row["expected"]
    good, bad = ("agrees ", "DIFFERS") if printed is not None else ("holds  ", "FAILS  ")
    known = [] if printed is None else [f"printed {_value(printed)}"]
    known += [] if expected is None else [f"{'expected' if printed is None else 'corrected'} {_value(expected)}"]
    values = ", ".join([*known, f"computed {_value(row['computed'])}{unit}"])
    tell = not row["agrees"] or (printed is not None and expected is not None)
    why = f"\n        {row['why']}" if tell else ""
    outside = notes(row["doubts"]).replace("\n", "\n        ")
    return f"{good if row['agrees'] else bad} {row['source']}: {row['quantity']}: {values}{why}{outside}"


def _value(value: float | str | None) -> str:
    if value is None:
        return "-"
    return value if isinstance(value, str) else f"{value:.4g}"
