"""Stability maps of a case: over phase difference, over spindle speed, and the shift over both frequencies."""

from __future__ import annotations

import math
import pathlib
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from services.config import Case
from services.doubts import doubts_of
from services.errors import InputError
from services.messages import Floats

Kind = Literal["phase", "lobes"]
HIGHEST = 2.0
"""Cutting stiffness that the maps reach, over that of the case."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CaseChart:
    """A stability map with what its axes mean.

    Attributes
    ----------
    kind
        phase or lobes.
    columns
        Phase difference over pi, or spindle speed (1/min), shape (columns,).
    chart
        Stability over stiffness in its rows (`pitch.StabilityChart`).
    case_stiffness_n_m, case_column
        Where the case works.
    reference_hz
        Frequency that a phase refers to (Hz).
    shift_deg
        Of turret 1 in every column of lobes.
    doubts
        What lies outside the range of the model, in words.
    """

    kind: Kind
    columns: Floats
    chart: Any
    case_stiffness_n_m: float
    case_column: float
    reference_hz: float
    shift_deg: float
    doubts: tuple[str, ...]


def case_chart(
    case: Case, kind: Kind, *, cells: int = 200, columns: tuple[float, float] | None = None, shift_deg: float = 0.0
) -> CaseChart:
    """Return the stability of the first bending mode of a case at its place of entry, linear theory.

    Parameters
    ----------
    case
        The case.
    kind
        `phase`: over the phase difference at the case's reference frequency; `lobes`: over spindle speed.
    cells
        Rows and columns.
    columns
        First and last phase (pi) or speed (1/min).
    shift_deg
        Of turret 1, for lobes.
    """
    from pitch import OneModeProcess, pitch_difference_for_phase, stability_chart
    from turning_sim import linear_parameters

    if not 2 <= cells <= 2000:
        raise InputError("cells", cells, "in 2..2000")
    linear = linear_parameters(case.workpiece, case.cutting, case.settings.start_position)
    process = OneModeProcess(
        linear.mass_at_tools, linear.natural_frequency_hz, linear.damping_ratio, linear.overlap, linear.process_damping
    )
    spindle_hz, reference = case.cutting.spindle_hz, case.settings.reference_chatter_hz
    low, high = columns or ((0.0, 2.0) if kind == "phase" else (0.5 * 60.0 * spindle_hz, 2.0 * 60.0 * spindle_hz))
    if not (math.isfinite(low) and math.isfinite(high) and 0.0 <= low < high) or (kind == "lobes" and low < 60.0):
        raise InputError("columns", f"{low:g}:{high:g}", "rising and at least 0 pi (phase) or 60 1/min (lobes)")
    at = np.linspace(low, high, cells)
    if kind == "phase":
        speed: Floats | float = spindle_hz
        difference = np.array([pitch_difference_for_phase(reference, spindle_hz, p * math.pi) for p in at])
        if abs(difference).max() >= 2.0 * math.pi:
            raise InputError("columns", f"{low:g}:{high:g}", "small enough for a pitch difference below 360 deg")
    else:
        speed, difference = at / 60.0, np.full(cells, 2.0 * math.radians(shift_deg))
    rows = linear.cutting_stiffness * HIGHEST * np.arange(1, cells + 1) / cells
    return CaseChart(
        kind=kind, columns=at, chart=stability_chart(process, speed, difference, rows),
        case_stiffness_n_m=linear.cutting_stiffness, case_column=1.0 if kind == "phase" else 60.0 * spindle_hz,
        reference_hz=reference, shift_deg=shift_deg, doubts=doubts_of(case, math.radians(shift_deg), 0.0),
    )  # fmt: skip


def write_cells(chart: CaseChart, path: pathlib.Path) -> None:
    """Write every cell as CSV: column, stiffness, and how many pairs of roots grow (0: stable)."""
    head = "phase_pi" if chart.kind == "phase" else "speed_rpm"
    column, row = np.meshgrid(chart.columns, chart.chart.stiffness)
    table = np.column_stack([column.ravel(), row.ravel(), chart.chart.unstable.ravel()])
    np.savetxt(
        path, table, delimiter=",", comments="", header=f"{head},stiffness_n_per_m,growing_pairs_count",
        fmt=["%.6g", "%.6g", "%d"],
    )  # fmt: skip
