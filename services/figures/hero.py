"""One picture that tells the whole run."""

# pyright: reportUnknownMemberType=false

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure

from services.figures.cut import draw_roughness
from services.figures.decision import positive
from services.figures.force import draw_force_pair
from services.figures.style import (
    CONTROLLED,
    INK,
    MUTED,
    SHIFT,
    TWIN,
    mark_times,
    new_figure,
    plain_log,
    say,
    say_nothing,
    slice_of,
    styled,
)
from services.figures.view import View
from services.sentences import headline, tiles


@styled
def overview_figure(view: View) -> Figure:
    """Draw the run at a glance: what happened in words, the force, the vibration and the surface."""
    figure = new_figure(12.8, 9.0)
    grid = figure.add_gridspec(2, 1, height_ratios=[1.15, 6.6])
    _draw_head(figure.add_subfigure(grid[0]), view)
    axes = figure.add_subfigure(grid[1]).subplots(2, 2, height_ratios=[1.15, 1.0])
    _draw_vibration(axes[1, 0], view)
    axes[1, 1].set_title("Roughness along the part")
    draw_roughness(axes[1, 1], view)
    axes[0, 1].sharey(axes[0, 0])
    draw_force_pair(figure, view, axes[0, 0], axes[0, 1])
    if view.time_s.size > 1:
        mark_times(axes[1, 0], view.marks)
    return figure


def _draw_head(head: SubFigure, view: View) -> None:
    head.text(0.012, 0.90, headline(view.record, view.summary), fontsize=15, fontweight="bold", va="top", color=INK)
    shown = tiles(view.record, view.summary)
    for i, (value, caption) in enumerate(shown):
        left = 0.012 + 0.98 * i / max(len(shown), 5)
        head.text(left, 0.26, value, fontsize=19, fontweight="bold", color=CONTROLLED, va="bottom")
        head.text(left, 0.17, caption, fontsize=9.5, color=MUTED, va="top")


def _draw_vibration(axes: Axes, view: View) -> None:
    axes.set_title("Vibration of the bar against tool 1")
    axes.set_xlabel("time (s)")
    axes.set_ylabel("amplitude in the band (µm)")
    if not view.cut_any:
        say_nothing(axes, "the tools never reached the part")
        return
    part = slice_of(view.time_s, view.window_s)
    step = max((part.stop - part.start) // 2000, 1)
    plain_log(axes)
    ends: list[float] = []
    for envelope, colour in ((view.envelope_twin_um, TWIN), (view.envelope_um, CONTROLLED)):
        shown = positive(envelope[part][::step])
        axes.plot(view.time_s[part][::step], shown, color=colour, linewidth=1.7)
        ends.append(float(np.nanmax(shown[-len(shown) // 4 :], initial=1e-6)))
    threshold = view.record.threshold_um
    top = 4.0 * max(float(np.max(view.envelope_twin_um[part], initial=threshold)), threshold)
    axes.set_ylim(max(min(0.1 * threshold, 0.2 * min(ends)), 0.003 * threshold), top)
    axes.set_xlim(*view.window_s)
    axes.axhline(threshold, color=INK, linewidth=0.9, linestyle=(0, (4, 3)))
    right = view.window_s[1] - 0.01 * float(np.ptp(view.window_s))
    left = view.window_s[0] + 0.01 * float(np.ptp(view.window_s))
    words = f"threshold {threshold:.2f} µm"
    say(axes, left, 1.1 * threshold, words, INK, va="bottom", fontsize=8.5, fontweight="normal")
    apart = ends[0] > 1.5 * ends[1]
    say(axes, right, 1.2 * ends[0], "without control" if apart else "with and without control", TWIN if apart else INK,
        ha="right", va="bottom")  # fmt: skip
    if apart:
        say(axes, right, 1.2 * ends[1], "with control", CONTROLLED, ha="right", va="bottom")
    if view.summary.first_shift_s is not None and view.summary.suppressed_s is not None:
        axes.axvspan(view.summary.first_shift_s, view.summary.suppressed_s, color=SHIFT, alpha=0.08, linewidth=0)
