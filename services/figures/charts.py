"""Stability maps that print well: what is unstable is grey, islands are hatched, borders are lines."""

# pyright: reportUnknownMemberType=false

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure

from services.charts import CaseChart, write_cells
from services.figures.style import CONTROLLED, INK, SHIFT, TWIN, new_figure, say, styled

MEASURED_PI = (0.7, 1.1)
"""Phase differences that were stable when measured (Yamada, PhD thesis, Keio University, 2017, section 6.5.2)."""
UNSTABLE = ListedColormap(["#ffffff", "#d5dbe1", "#b9c2cb", "#98a4b0"])


@styled
def chart_figure(chart: CaseChart, name: str) -> Figure:
    """Draw a map: cutting stiffness over that of the case against phase difference or spindle speed."""
    figure = new_figure(10.6, 5.6)
    axes = figure.subplots()
    rows = chart.chart.stiffness / chart.case_stiffness_n_m
    growing = np.minimum(chart.chart.unstable, 3)
    axes.pcolormesh(chart.columns, rows, growing, cmap=UNSTABLE, vmin=0, vmax=3, shading="nearest", rasterized=True)
    islands = chart.chart.islands
    if islands.any():
        axes.contourf(
            chart.columns, rows, islands.astype(float), levels=[0.5, 1.5], colors=["#dcefe6"], hatches=["///"]
        )
    limit = chart.chart.limit / chart.case_stiffness_n_m
    axes.plot(chart.columns, np.where(np.isfinite(limit), limit, np.nan), color=INK, linewidth=1.5)
    axes.axhline(1.0, color=TWIN, linewidth=1.2, linestyle=(0, (6, 3)))
    axes.set_ylim(0.0, float(rows[-1]))
    axes.set_xlim(float(chart.columns[0]), float(chart.columns[-1]))
    axes.set_ylabel("cutting stiffness over that of the case")
    axes.grid(False)
    if chart.kind == "phase":
        _phase(axes, chart, name)
    else:
        _lobes(axes, chart, name)
    if islands.any():
        say(axes, 0.99, 0.965, "hatched: stable islands", SHIFT, transform=axes.transAxes, ha="right")
    return figure


def _phase(axes: Axes, chart: CaseChart, name: str) -> None:
    axes.set_title(f"{name}: stability over the phase difference of the two waves")
    axes.set_xlabel(f"phase difference Δε/π at {chart.reference_hz:g} Hz")
    for edge in MEASURED_PI:
        axes.axvline(edge, color=CONTROLLED, linewidth=1.1)
    axes.axvspan(*MEASURED_PI, color=CONTROLLED, alpha=0.08)
    if chart.columns[0] <= MEASURED_PI[0] and chart.columns[-1] >= MEASURED_PI[1]:
        say(axes, 0.5 * sum(MEASURED_PI), 0.06, "measured\nstable", CONTROLLED,
            transform=axes.get_xaxis_transform(), ha="center", fontsize=9)  # fmt: skip
    say(axes, chart.columns[0] + 0.01 * np.ptp(chart.columns), 1.04, "this case", TWIN)


def _lobes(axes: Axes, chart: CaseChart, name: str) -> None:
    shift = f"turret 1 shifted by {chart.shift_deg:.3g}°" if chart.shift_deg else "equal pitch"
    axes.set_title(f"{name}: stability over spindle speed, {shift}")
    axes.set_xlabel("spindle speed (1/min)")
    axes.plot([chart.case_column], [1.0], "o", color=TWIN, markersize=7, zorder=5, clip_on=False)
    say(axes, chart.case_column, 1.07, "this case", TWIN, ha="center")


@styled
def shift_figure(spindle_rpm: tuple[float, float], frequency_hz: tuple[float, float]) -> Figure:
    """Draw the optimum shift over spindle speed and chatter frequency, as Fig. 6-20 of the thesis does."""
    from pitch import optimal_pitch_difference

    figure = new_figure(8.4, 5.6)
    axes = figure.subplots()
    speed, hertz = np.linspace(*spindle_rpm, 121), np.linspace(*frequency_hz, 121)
    shift = np.array([[np.degrees(optimal_pitch_difference(f, s / 60.0)) / 2.0 for s in speed] for f in hertz])
    lines = axes.contour(speed, hertz, shift, levels=[1, 1.5, 2, 2.5, 3, 4, 5, 6, 8, 10, 12, 15], colors=[CONTROLLED])
    axes.clabel(lines, fmt="%g°", fontsize=9)
    axes.set_title("Shift of turret 1 for antiphase, eq. (6-10)")
    axes.set_xlabel("spindle speed (1/min)")
    axes.set_ylabel("chatter frequency (Hz)")
    return figure


def write_chart(chart: CaseChart, name: str, directory: Path) -> list[str]:
    """Write map and cells, and list the files."""
    stem = f"{name}-{chart.kind}"
    figure, cells = directory / f"{stem}.png", directory / f"{stem}.csv"
    chart_figure(chart, name).savefig(figure, metadata={"Software": None})
    write_cells(chart, cells)
    return [str(figure), str(cells)]
