"""Verb that sets published numbers beside computed ones: `reproduce`."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from services.cli.app import JsonFlag, OutDir, Seed, app, emit, writable_folder
from services.cli.loop import PlantModel, model_of, progress_bar
from services.clock import WallClock
from services.doubts import notes
from services.errors import InputError

NAMES = ("chapter6",)


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
    from services.reproduce.chapter6 import reproduce_chapter6
    from services.reproduce.rows import as_table

    folder = writable_folder(out)
    with progress_bar("chapter 6 of the thesis") as progress:
        chapter = reproduce_chapter6(
            clock=WallClock(), seed=1 if seed is None else seed, plant=model_of(plant), progress=progress
        )
    answer = as_table(chapter.rows)
    text = "\n".join([*(_line(row) for row in answer["rows"]), f"{answer['agree']} of {answer['total']} agree"])
    if folder is not None:
        from services.figures.thesis import write_thesis_figures

        answer["written"] = write_thesis_figures(chapter, folder)
        text += "".join(f"\nwrote {path}" for path in answer["written"])
    emit(answer, text, as_json)


def _line(row: dict[str, Any]) -> str:
    unit = f" {row['unit']}" if row["unit"] else ""
    sign = "agrees " if row["agrees"] else "DIFFERS"
    values = f"printed {_value(row['printed'])}, computed {_value(row['computed'])}{unit}"
    why = "" if row["agrees"] else f"\n        {row['why']}"
    outside = notes(row["doubts"]).replace("\n", "\n        ")
    return f"{sign} {row['source']}: {row['quantity']}: {values}{why}{outside}"


def _value(value: float | str | None) -> str:
    if value is None:
        return "-"
    return value if isinstance(value, str) else f"{value:.4g}"
