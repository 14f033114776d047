"""Figures of the estimators of the cutting force."""

# pyright: reportUnknownMemberType=false

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from services.compare import AxisCut, Comparison
from services.figures.style import CONTROLLED, FAINT, INK, MUTED, TWIN, styled

SHOWN_TURNS = 2.0


@styled
def comparison_figure(cut: AxisCut, found: list[Comparison]) -> Figure:
    """Return the estimates over the true force, each in its own strip, worst error first on the scale of the force."""
    figure = Figure(figsize=(9.0, 1.15 * len(found) + 1.2), layout="constrained")
    axes = np.atleast_1d(figure.subplots(len(found), 1, sharex=True))
    end = cut.time_s[-1]
    shown = cut.time_s >= end - SHOWN_TURNS / cut.spindle_hz
    time = 1e3 * (cut.time_s[shown] - cut.time_s[shown][0])
    for axis, one in zip(axes, found, strict=True):
        good = one.error_ratio < 0.1
        axis.plot(time, one.reference_n[shown], color=FAINT, linewidth=4.0)
        axis.plot(time, one.estimate_n[shown], color=CONTROLLED if good else TWIN, linewidth=1.1)
        low, high = float(one.reference_n[shown].min()), float(one.reference_n[shown].max())
        room = 0.35 * (high - low)
        axis.set_ylim(low - room, high + room)
        axis.set_title(one.name.replace("_", " "), fontsize=9.5, pad=2.0)
        axis.text(
            1.0, 1.03, f"error {100.0 * one.error_ratio:.1f} % of the force, {one.latency_ms:.2f} ms late",
            transform=axis.transAxes, ha="right", va="bottom", fontsize=8.5, color=INK if good else MUTED,
        )  # fmt: skip
        axis.set_ylabel("N")
    axes[-1].set_xlabel(
        f"time (ms); grey: the true force, as late and through the same low-pass; {SHOWN_TURNS:g} turns"
    )
    return figure


def write_comparison(cut: AxisCut, found: list[Comparison], directory: Path) -> list[str]:
    """Write the figure and the series as CSV, and list the files."""
    figure = directory / "comparison.png"
    comparison_figure(cut, found).savefig(figure, metadata={"Software": None})
    table = directory / "comparison.csv"
    columns = [cut.time_s, cut.force_n, *(one.estimate_n for one in found)]
    header = ",".join(["time_s", "force_n", *(f"{one.name}_n" for one in found)])
    np.savetxt(table, np.column_stack(columns), delimiter=",", header=header, comments="", fmt="%.9g")
    return [str(figure), str(table)]
