"""What the monitor saw and the controller decided: indicator with its limit, and the shift of the turret."""

# pyright: reportUnknownMemberType=false

from __future__ import annotations

from itertools import groupby

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from services.figures.style import (
    ALARM,
    CONTROLLED,
    INK,
    MUTED,
    SHIFT,
    mark_times,
    new_figure,
    plain_log,
    say,
    say_nothing,
    slice_of,
    styled,
)
from services.figures.view import View
from services.messages import Floats
from services.metrics import CHATTER_STATE
from services.sentences import limit_source

STATE_COLOURS = {CHATTER_STATE: "#d9a5c1", "suspect": "#f0e2ea", "quiet": "#dbe8f2", "gap": "#f0cf8e",
                 "invalid": "#f0cf8e"}  # fmt: skip
OTHER_STATE = "#eceff1"


@styled
def indicator_figure(view: View) -> Figure:
    """Draw the indicator against the limit that was learned, the state it led to, and the frequency found."""
    figure = new_figure(12.4, 6.0)
    top, states, bottom = figure.subplots(3, 1, sharex=True, height_ratios=[3.2, 0.34, 1.5])
    top.set_title("Chatter indicator and its limit")
    top.set_ylabel("force in the band, RMS (N)")
    bottom.set_ylabel("frequency (Hz)")
    bottom.set_xlabel("time (s)")
    states.set_axis_off()
    if view.report_time_s.size == 0:
        say_nothing(top, "no reports")
        return figure
    window = (0.0, view.summary.simulated_s)
    top.set_xlim(*window)
    _draw_indicator(top, view)
    _draw_states(states, view, window)
    _draw_frequency(bottom, view)
    mark_times(top, view.marks)
    return figure


def _draw_indicator(axes: Axes, view: View) -> None:
    reports, at = view.record.reports, view.report_time_s
    plain_log(axes)
    axes.step(at, positive(reports.limit), where="pre", color=INK, linewidth=1.3, linestyle=(0, (5, 2)))
    axes.step(at, positive(reports.indicator), where="pre", color=CONTROLLED, linewidth=1.4)
    over = (reports.limit > 0.0) & (reports.indicator > reports.limit)
    axes.plot(at[over], reports.indicator[over], ".", color=ALARM, markersize=5)
    drawn = at <= axes.get_xlim()[1]
    last = int(np.flatnonzero(drawn)[-1]) if np.any(drawn) else 0
    span = axes.get_xlim()[1]
    begin = 0
    for source, run in groupby(reports.limit_source):
        end = begin + len(list(run))
        limit = reports.limit[begin:end][np.isfinite(reports.limit[begin:end]) & (reports.limit[begin:end] > 0)]
        if source and limit.size and begin <= last and at[min(end - 1, last)] - at[begin] > 0.12 * span:
            final = end > last
            say(axes, span if final else at[begin] + 0.01 * span, float(limit[-1 if final else 0]) * 1.12,
                f"limit: {limit_source(source)} ", INK, fontsize=9, va="bottom", fontweight="normal",
                ha="right" if final else "left")  # fmt: skip
        begin = end


def positive(values: Floats) -> Floats:
    """Leave out of a series what a logarithmic axis cannot show."""
    return np.where(np.isfinite(values) & (values > 0.0), values, np.nan)


def _draw_states(axes: Axes, view: View, window_s: tuple[float, float]) -> None:
    """Draw the state of the monitor as a ribbon, each long enough stretch named."""
    axes.set_ylim(0.0, 1.0)
    axes.text(-0.008, 0.46, "state", transform=axes.transAxes, ha="right", va="center", color=MUTED)
    at = view.report_time_s
    begin = 0
    for state, run in groupby(view.record.reports.state):
        end = begin + len(list(run))
        left, right = float(at[begin]) - 0.01, min(float(at[end - 1]), window_s[1])
        begin = end
        if right <= left:
            continue
        axes.axvspan(left, right, color=STATE_COLOURS.get(state, OTHER_STATE), linewidth=0)
        if right - left > 0.0075 * (len(state) + 1) * (window_s[1] - window_s[0]):
            axes.text(0.5 * (left + right), 0.46, state, ha="center", va="center", fontsize=8.5, color=INK)


def _draw_frequency(axes: Axes, view: View) -> None:
    low, high = view.record.search_band_hz
    axes.axhspan(low, high, color="#eef3f7", linewidth=0)
    axes.set_ylim(low - 0.15 * (high - low), high + 0.15 * (high - low))
    told = view.record.reports.frequency_hz
    if np.any(np.isfinite(told)):
        axes.plot(view.report_time_s, told, ".", color=ALARM, markersize=4)
    if view.summary.chatter_hz is not None and view.summary.detected_s is not None:
        say(axes, view.summary.detected_s - 0.01 * axes.get_xlim()[1], view.summary.chatter_hz,
            f"{view.summary.chatter_hz:.1f} Hz", ALARM, ha="right")  # fmt: skip
    axes.text(0.006 * axes.get_xlim()[1], high, "band searched", fontsize=8.5, color=MUTED, va="top")


@styled
def shift_figure(view: View) -> Figure:
    """Draw the shift asked for and done, and where it took the tool."""
    figure = new_figure(12.4, 6.4)
    grid = figure.subplots(3, 2, sharex="col", width_ratios=[1.25, 1.0], height_ratios=[1.8, 1.0, 1.0])
    grid[0, 0].set_title("Shift of turret 1 round the bar")
    grid[0, 1].set_title("The first move, close up" if view.summary.moves else "Close up")
    for row, label in enumerate(("shift (deg)", "along surface,\ndy1' (µm)", "inwards,\ndx1 (µm)")):
        grid[row, 0].set_ylabel(label)
    if view.time_s.size < 2:
        say_nothing(grid[0, 0], "nothing recorded")
        return figure
    start = view.summary.first_command_s
    close = (start - 0.06, min(start + 0.3, view.summary.simulated_s)) if start is not None else view.close_up()
    for column, window in enumerate(((view.window_s[0], view.summary.simulated_s), close)):
        panels: list[Axes] = list(grid[:, column])
        panels[-1].set_xlabel("time (s)")
        panels[0].set_xlim(*window)
        _draw_shift(panels[0], view, window, limits=column == 0)
        cut = view.record.controlled
        for axes, offset in zip(panels[1:], (cut.dy1p_um, cut.dx1_um), strict=True):
            draw_line(axes, view.time_s, offset, window, SHIFT)
            low, high = axes.get_ylim()
            axes.set_ylim(min(low, -0.5), max(high, 0.5))
    mark_times(grid[0, 0], view.marks)
    mark_times(grid[0, 1], [mark for mark in view.marks if mark[1] != "tools enter"])
    return figure


def draw_line(axes: Axes, time_s: Floats, values: Floats, window_s: tuple[float, float], colour: str) -> None:
    """Draw the stretch of a slow series that is in view, thinned to what a screen can show."""
    part = slice_of(time_s, window_s)
    step = max((part.stop - part.start) // 2000, 1)
    axes.plot(time_s[part][::step], values[part][::step], color=colour)


def _draw_shift(axes: Axes, view: View, window_s: tuple[float, float], *, limits: bool) -> None:
    requested, bound = view.record.reports.shift_requested_deg, view.record.shift_limit_deg
    axes.step(view.report_time_s, requested, where="post", color=INK, linewidth=1.2, linestyle=(0, (4, 2)))
    draw_line(axes, view.time_s, view.record.controlled.shift_applied_deg, window_s, SHIFT)
    told = requested[np.isfinite(requested)]
    reach = max(float(np.max(np.abs(told), initial=0.0)), view.summary.max_shift_deg, 0.1)
    if limits and np.isfinite(bound):
        for sign in (1.0, -1.0):
            axes.axhline(sign * bound, color=ALARM, linewidth=1.0)
            axes.axhspan(sign * bound, sign * bound * 1.25, color="#f6e8ef", linewidth=0)
        axes.set_ylim(-1.18 * bound, 1.18 * bound)
        say(axes, window_s[1], bound, f"limit ±{bound:g} deg ", ALARM, ha="right", va="bottom", fontsize=9)
    else:
        axes.set_ylim(-0.12 * reach, 1.3 * reach) if np.min(told, initial=0.0) >= 0 else axes.set_ylim(
            -1.3 * reach, 1.3 * reach
        )
    if view.summary.shift_deg is not None and not limits:
        edge = window_s[1] - 0.01 * (window_s[1] - window_s[0])
        say(axes, edge, 1.12 * reach, f"asked for {view.summary.shift_deg:.2f} deg (dashed)", INK, ha="right",
            fontweight="normal", fontsize=9)  # fmt: skip
        say(axes, edge, 0.86 * reach, "done", SHIFT, ha="right")
