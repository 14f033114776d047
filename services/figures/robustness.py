"""Fig. 6-19 as a closed picture: the published cuts over the computed map."""

# pyright: reportUnknownMemberType=false

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure

from services.figures.style import CONTROLLED, INK, MUTED, PAPER, TWIN, new_figure, say, styled
from services.reproduce import published as thesis
from services.reproduce.phases import CHATTER_DB
from services.reproduce.robustness import STIFFNESS, Robustness

GROWTH = LinearSegmentedColormap.from_list(
    "growth", [(0.0, "#9cc3dd"), (0.3, "#cfe2ee"), (0.5, "#f7f8f8"), (0.7, "#f3cfb3"), (1.0, "#d9783a")]
)
"""Blue decays, orange grows; both are as light as text on them needs."""
SMALL_DPI = 110


@styled
def robustness_figure(study: Robustness) -> Figure:
    """Draw growth over phase and diameter, the border, and what was measured."""
    figure = new_figure(9.6, 5.8)
    axes = figure.subplots()
    mesh = axes.contourf(
        study.phase_pi, study.diameter_mm, study.growth, levels=np.arange(-40.0, 41.0, 5.0), cmap=GROWTH, extend="both"
    )
    for cells, style, width in (
        (study.softer_db, (0, (1, 1.6)), 1.0), (study.gain_db, "solid", 2.0), (study.stiffer_db, (0, (5, 2)), 1.0),
    ):  # fmt: skip
        axes.contour(
            study.phase_pi, study.diameter_mm, cells, levels=[CHATTER_DB], colors=[INK], linestyles=[style],
            linewidths=[width],
        )  # fmt: skip
    _points(axes)
    axes.grid(False)
    axes.set(
        xlim=(study.phase_pi[0], study.phase_pi[-1]), ylim=(study.diameter_mm[0], study.diameter_mm[-1]),
        xlabel=f"phase difference Δε/π at {thesis.NOMINAL_HZ:g} Hz", ylabel="diameter of the bar (mm)",
    )  # fmt: skip
    axes.set_title("Which pitch stays stable? Eight cuts of Fig. 6-19 over the computed map")
    degrees = 90.0 * thesis.SPEED_RPM / 60.0 / thesis.NOMINAL_HZ
    above = axes.secondary_xaxis("top", functions=(_times(degrees), _times(1.0 / degrees)))
    above.set_xlabel("shift of turret 1 (deg)", color=MUTED, fontsize=9.0)
    bar = figure.colorbar(mesh, ax=axes, pad=0.015, fraction=0.04)
    bar.set_label("growth of the strongest root over the pass (1/s)", color=MUTED)
    bar.outline.set_visible(False)  # pyright: ignore[reportCallIssue]
    note = (
        f"Line: where a small wave grows {CHATTER_DB:g} dB in a pass of 45 mm; dotted and dashed: {100 * STIFFNESS:g} %"
    )
    figure.supxlabel(f"{note} less and more cutting stiffness.", x=0.012, ha="left", fontsize=8.8, color=MUTED)
    return figure


def _times(factor: float) -> Callable[[Any], Any]:
    return lambda value: factor * value


def _points(axes: Axes) -> None:
    for cut in thesis.TABLE_6_4:
        colour = TWIN if cut.chatter else CONTROLLED
        axes.plot(
            [cut.phase_pi], [cut.diameter_mm], "X" if cut.chatter else "o", color=colour, markersize=11.0,
            markeredgecolor=PAPER, markeredgewidth=1.4, zorder=5,
        )  # fmt: skip
        side = -1.0 if cut.phase_pi in (0.6, 1.1, 1.2) else 1.0
        place = (cut.phase_pi + 0.018 * side, cut.diameter_mm)
        say(axes, *place, f"{cut.phase_pi:g} π", INK, ha="left" if side > 0.0 else "right", fontsize=8.5)
    say(axes, 0.5, 23.16, "measured: chatter", TWIN, ha="center")
    say(axes, 0.865, 24.72, "measured: quiet", CONTROLLED, ha="center")


def write_robustness(study: Robustness, directory: Path) -> Path:
    """Write the figure of the README and return where it is."""
    directory.mkdir(parents=True, exist_ok=True)
    path = directory / "robustness.png"
    robustness_figure(study).savefig(path, metadata={"Software": None}, dpi=SMALL_DPI)
    return path
