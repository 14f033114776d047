"""What the cut did: motion of bar and tool, and the roughness left along the part."""

# pyright: reportUnknownMemberType=false

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from services.figures.style import (
    CONTROLLED,
    INK,
    MUTED,
    PAPER,
    POWER,
    TWIN,
    draw_band,
    halo,
    mark_times,
    new_figure,
    say,
    say_nothing,
    slice_of,
    styled,
)
from services.figures.view import View
from services.messages import Floats
from services.metrics import first_held, judged


@styled
def motion_figure(view: View) -> Figure:
    """Draw the vibration between bar and tool with its envelope and threshold, whole and close up."""
    figure = new_figure(12.4, 7.0)
    grid = figure.subplots(3, 2, sharex="col", width_ratios=[1.25, 1.0], height_ratios=[1.3, 1.3, 1.0])
    grid[0, 0].set_title("Bar against tool, without control")
    grid[1, 0].set_title("With control")
    grid[2, 0].set_title("Deflection of bar and tool 1, with control")
    grid[0, 1].set_title("Close up")
    for row, label in enumerate(("along X1 (µm)", "along X1 (µm)", "along X1 (µm)")):
        grid[row, 0].set_ylabel(label)
    if view.time_s.size < 2:
        say_nothing(grid[0, 0], "nothing recorded")
        return figure
    close = view.close_up()
    for column, window in enumerate((view.window_s, close)):
        panels: list[Axes] = list(grid[:, column])
        panels[0].set_xlim(*window)
        panels[-1].set_xlabel("time (s)")
        _draw_vibration(panels[0], view, view.record.twin.vibration_um, view.envelope_twin_um, TWIN, window)
        _draw_vibration(panels[1], view, view.record.controlled.vibration_um, view.envelope_um, CONTROLLED, window)
        _draw_deflection(panels[2], view, window)
    for row in (0, 1):
        low = min(axes.get_ylim()[0] for axes in grid[:2, 0])
        high = max(axes.get_ylim()[1] for axes in grid[:2, 0])
        grid[row, 0].set_ylim(low, high)
    mark_times(grid[0, 0], view.marks_twin)
    mark_times(grid[1, 0], view.marks)
    mark_times(grid[1, 1], view.marks)
    mark_times(grid[0, 1], view.marks_twin)
    return figure


def _draw_vibration(
    axes: Axes, view: View, vibration: Floats, envelope: Floats, colour: str, window_s: tuple[float, float]
) -> None:
    part, threshold = slice_of(view.time_s, window_s), view.record.threshold_um
    time_s, shown = view.time_s[part], vibration[part]
    if shown.size == 0:
        return
    middle = float(np.mean(shown))
    if shown.size > 4000:
        draw_band(axes, time_s, shown - middle, colour, alpha=0.55)
    else:
        axes.plot(time_s, shown - middle, color=colour, linewidth=0.8, alpha=0.75)
    step = max(shown.size // 2000, 1)
    for sign in (1.0, -1.0):
        axes.plot(time_s[::step], sign * envelope[part][::step], color=INK, linewidth=0.7)
    for sign in (1.0, -1.0):
        axes.axhline(sign * threshold, color=INK, linewidth=0.9, linestyle=(0, (4, 3)), alpha=0.7)
    reach = max(1.08 * float(np.max(np.abs(shown - middle))), 1.8 * threshold)
    axes.set_ylim(-reach, reach)
    left = window_s[0] + 0.01 * (window_s[1] - window_s[0])
    halo(axes.text(left, threshold, f"threshold {threshold:.2f} µm", color=INK, fontsize=8.5, va="bottom"))


def _draw_deflection(axes: Axes, view: View, window_s: tuple[float, float]) -> None:
    part, cut = slice_of(view.time_s, window_s), view.record.controlled
    for values, colour, word, side in (
        (cut.bar_displacement_um, CONTROLLED, "bar", "bottom"),
        (cut.tool_radial_um, MUTED, "tool 1", "top"),
    ):
        shown = values[part]
        if shown.size == 0:
            return
        if shown.size > 4000:
            draw_band(axes, view.time_s[part], shown, colour, alpha=0.8)
        else:
            axes.plot(view.time_s[part], shown, color=colour, linewidth=0.9)
        right = window_s[1] - 0.01 * (window_s[1] - window_s[0])
        say(axes, right, float(np.mean(shown[-shown.size // 8 :])), word, colour, ha="right", va=side)


@styled
def roughness_figure(view: View) -> Figure:
    """Draw the roughness along the part, and the part itself as the light would show it."""
    figure = new_figure(12.4, 5.2)
    part, axes = figure.subplots(2, 1, sharex=True, height_ratios=[0.85, 3.0])
    part.set_title("The finished part")
    draw_part(part, view)
    draw_roughness(axes, view)
    return figure


def draw_roughness(axes: Axes, view: View) -> None:
    """Draw Ra of both cuts along the part, named at the line, with the means that the headline quotes."""
    twin, cut = view.record.twin, view.record.controlled
    axes.set_xlabel("distance from the free end of the bar (mm)")
    axes.set_ylabel("roughness Ra (µm)")
    if cut.ra_um.size == 0:
        say_nothing(axes, "no finished surface to measure")
        axes.set_xlim(0.0, 1.0)
        return
    top = 1.25 * float(max(np.max(twin.ra_um, initial=0.1), np.max(cut.ra_um, initial=0.1)))
    axes.set_ylim(0.0, top)
    alike = abs(_end_of(twin.ra_um) - _end_of(cut.ra_um)) < 0.08 * top
    for series, colour, word, mean in (
        (twin, TWIN, "without control", view.summary.ra_before_um),
        (cut, CONTROLLED, "with and without control" if alike else "with control", view.summary.ra_after_um),
    ):
        if series.ra_um.size == 0:
            continue
        axes.plot(series.ra_position_mm, series.ra_um, color=colour, linewidth=2.2, drawstyle="steps-mid")
        if alike and series is twin:
            continue
        words = word if mean is None else f"{word}: Ra {mean:.2f} µm"
        height = _end_of(series.ra_um) + 0.018 * top
        say(axes, float(series.ra_position_mm[-1]), height, words, colour, ha="right", va="bottom", fontsize=10.5)
    _draw_marked(axes, view)


def _end_of(values: Floats) -> float:
    return float(np.max(values[-values.size // 3 - 1 :])) if values.size else 0.0


def _draw_marked(axes: Axes, view: View) -> None:
    """Shade the part of the controlled cut that was made above the threshold."""
    above = (view.envelope_um > view.record.threshold_um) & judged(view.record, view.record.controlled)
    first = first_held(above, 1)
    if first is None or not view.summary.marked_length_mm:
        return
    position = view.record.controlled.z_mm
    padded = np.concatenate(([False], above, [False])).astype(np.int8)
    edges = np.flatnonzero(np.diff(padded))
    for begin, end in zip(edges[::2], edges[1::2], strict=True):
        axes.axvspan(float(position[begin]), float(position[end - 1]), color="#f3d9c4", linewidth=0, zorder=0.5)
    low, high = axes.get_xlim()
    end = float(position[edges[-1] - 1])
    at = end if end < low + 0.75 * (high - low) else float(position[first])
    say(axes, at, 0.96 * axes.get_ylim()[1], f" {view.summary.marked_length_mm:.2f} mm marked", INK, va="top")


def draw_part(axes: Axes, view: View) -> None:
    """Draw both bars as strips, darker where rougher: the darkest is 5 um, or the worst if that is more."""
    twin, cut = view.record.twin, view.record.controlled
    axes.grid(visible=False)
    axes.set_yticks([0.0, 1.2], ["with control", "without control"])
    axes.tick_params(axis="y", length=0, labelcolor=INK)
    axes.tick_params(axis="x", labelbottom=False, length=0)
    for side in ("left", "bottom"):
        axes.spines[side].set_visible(False)
    axes.set_ylim(-0.6, 1.8)
    if cut.ra_um.size < 2 or twin.ra_um.size < 2:
        return
    worst = float(max(np.max(twin.ra_um), np.max(cut.ra_um), 5.0))
    for series, height in ((twin, 1.2), (cut, 0.0)):
        half = 0.5 * float(series.ra_position_mm[1] - series.ra_position_mm[0])
        extent = (series.ra_position_mm[0] - half, series.ra_position_mm[-1] + half, height - 0.42, height + 0.42)
        round_bar = np.sqrt(np.clip(1.0 - np.linspace(-0.97, 0.97, 40) ** 2, 0.0, 1.0))[:, np.newaxis]
        shade = 0.18 + 0.62 * series.ra_um[np.newaxis, :] / worst + 0.25 * (1.0 - round_bar)
        axes.imshow(shade, extent=extent, aspect="auto", cmap=POWER, vmin=0.0, vmax=1.15, interpolation="nearest")
        axes.set_facecolor(PAPER)
    axes.set_xlim(float(cut.ra_position_mm[0]) - half, float(cut.ra_position_mm[-1]) + half)
