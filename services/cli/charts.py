"""Verb that draws stability maps: `chart`."""

from __future__ import annotations

import pathlib
from typing import Annotated, Any

import numpy as np
import typer

from services.cli.app import JsonFlag, OutDir, app, emit, require, writable_folder
from services.clock import WallClock
from services.doubts import notes
from services.errors import InputError

KINDS = ("phase", "lobes", "shift")


@app.command()
def chart(
    kind: Annotated[str, typer.Argument(help="phase, lobes, or shift (optimum shift over speed and frequency).")],
    case: Annotated[str, typer.Argument(help="Shipped case or path of a TOML file.", metavar="[CASE]")] = "thesis-652",
    cells: Annotated[int, typer.Option("--cells", help="Rows and columns of the map.")] = 200,
    columns: Annotated[
        str | None, typer.Option("--columns", help="First and last phase (pi) or speed (1/min), as A:B.")
    ] = None,
    shift_deg: Annotated[float, typer.Option("--shift-deg", help="Shift of turret 1 for lobes (deg).")] = 0.0,
    out: OutDir = None,
    as_json: JsonFlag = False,
) -> None:
    """Draw where the cut is stable: PNG and CSV."""
    from services.charts import case_chart
    from services.config import load_case

    if kind not in KINDS:
        raise InputError("kind", kind, f"one of {', '.join(KINDS)}")
    require("shift-deg", shift_deg, "within 20 deg", abs(shift_deg) <= 20.0)
    folder = writable_folder(out or pathlib.Path("runs/charts"))
    if folder is None:
        raise InputError("out", None, "a folder")
    if kind == "shift":
        from services.figures.charts import shift_figure

        speeds = _range(columns) or (600.0, 3000.0)
        path = folder / "shift.png"
        shift_figure(speeds, (300.0, 1500.0)).savefig(path, metadata={"Software": None})
        emit({"cells": 0, "written": [str(path)]}, f"wrote {path}", as_json)
        return
    known, clock = load_case(case), WallClock()
    case_chart(known, "phase", cells=2)  # compiles
    begin = clock.now()
    found = case_chart(known, "phase" if kind == "phase" else "lobes", cells=cells, columns=_range(columns),
                       shift_deg=shift_deg)  # fmt: skip
    wall = clock.now() - begin
    from services.figures.charts import write_chart

    name = pathlib.Path(case).stem
    written = write_chart(found, name, folder)
    limit = found.chart.limit[np.isfinite(found.chart.limit)]
    stable = found.chart.stable
    answer: dict[str, Any] = {
        "cells": stable.size,
        "limit_min": float(limit.min()) if limit.size else None,
        "limit_max": float(limit.max()) if limit.size else None,
        "wall_s": wall,
        "stable_share": float(stable.mean()),
        "island_share": float(found.chart.islands.mean()),
        "case_stiffness_n_m": found.case_stiffness_n_m,
        "doubts": list(found.doubts),
        "written": written,
    }
    text = (
        f"{stable.size} cells in {1e3 * wall:.0f} ms: {100.0 * stable.mean():.0f} % stable, "
        f"{100.0 * found.chart.islands.mean():.0f} % as islands above an unstable stretch; "
    )
    text += (
        f"stability is lost between {limit.min():.4g} and {limit.max():.4g} N/m"
        if limit.size
        else "no limit below the top"
    )
    emit(answer, text + notes(found.doubts) + "".join(f"\nwrote {path}" for path in written), as_json)


def _range(text: str | None) -> tuple[float, float] | None:
    if text is None:
        return None
    parts = text.split(":")
    try:
        low, high = (float(part) for part in parts)
    except ValueError as error:
        raise InputError("columns", text, "two numbers as A:B") from error
    return low, high
