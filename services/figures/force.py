"""The estimated cutting force as a machinist would hear it: spectrograms without and with control."""

# pyright: reportUnknownMemberType=false

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from services.figures.spectrum import Spectrogram, draw_spectrogram, scale_of, spectrogram
from services.figures.style import ALARM, INK, SHIFT, mark_times, new_figure, say, say_nothing, slice_of, styled
from services.figures.view import View


@styled
def spectrogram_figure(view: View) -> Figure:
    """Draw the force without and with control side by side on one colour scale."""
    figure = new_figure(12.4, 4.9)
    left, right = figure.subplots(1, 2, sharey=True)
    draw_force_pair(figure, view, left, right)
    return figure


def draw_force_pair(figure: Figure, view: View, left: Axes, right: Axes) -> None:
    """Fill two axes with the spectrograms of the twin and of the controlled cut, and add their colour bar."""
    rate, top_hz = view.record.sample_rate_hz, top_frequency(view)
    cuts = (view.record.twin.force_x1_n, view.record.controlled.force_x1_n)
    pictures = [spectrogram(force, rate, view.window_s, top_hz) for force in cuts]
    scale = scale_of(*pictures, least_top_db=15.0)
    left.set_title("Without control")
    right.set_title("With control")
    left.set_ylabel("frequency (Hz)")
    for axes, picture in ((left, pictures[0]), (right, pictures[1])):
        axes.set_xlabel("time (s)")
        if picture is None:
            say_nothing(axes, "too short for a spectrum")
            axes.grid(visible=False)
            continue
        image = draw_spectrogram(axes, picture, scale)
        axes.set_ylim(0.0, top_hz)
        axes.set_xlim(*view.window_s)
        _draw_band(axes, view)
        if axes is right:
            bar = figure.colorbar(image, ax=[left, right], pad=0.015, aspect=28)
            bar.set_label("estimated force on tool 1, X1 (dB over 1 N)")
            bar.outline.set_visible(False)  # pyright: ignore[reportCallIssue]
    mark_times(left, view.marks_twin)
    mark_times(right, view.marks)
    if pictures[1] is not None:
        _draw_found(right, view, pictures[1])
        _draw_shift(right, view)


def top_frequency(view: View) -> float:
    """Upper end of the frequency axis (Hz): the band with air above it."""
    return min(1.5 * view.record.chatter_band_hz[1], 0.5 * view.record.sample_rate_hz)


def _draw_band(axes: Axes, view: View) -> None:
    low, high = view.record.search_band_hz
    for edge in (low, high):
        axes.axhline(edge, color=INK, linewidth=0.8, linestyle=(0, (4, 3)), alpha=0.55)
    say(axes, view.window_s[0] + 0.012 * np.ptp(view.window_s), high, f"searched: {low:.0f} to {high:.0f} Hz", INK,
        fontsize=8.5, fontweight="normal", va="bottom")  # fmt: skip


def _draw_found(axes: Axes, view: View, picture: Spectrogram) -> None:
    told = view.record.reports.frequency_hz
    found = np.isfinite(told) & (view.report_time_s >= view.window_s[0]) & (view.report_time_s <= view.window_s[1])
    if not np.any(found) or view.summary.chatter_hz is None:
        return
    axes.plot(view.report_time_s[found], told[found], ".", color=ALARM, markersize=3.5, alpha=0.9)
    at = float(view.report_time_s[found][-1])
    inside = at < view.window_s[1] - 0.25 * np.ptp(view.window_s)
    offset = 0.015 * float(np.ptp(view.window_s)) * (1 if inside else -1)
    height = float(told[found][-1]) + (0.0 if inside else 0.07 * axes.get_ylim()[1])
    say(axes, at + offset, height, f"found: {view.summary.chatter_hz:.0f} Hz", ALARM, ha="left" if inside else "right")


def _draw_shift(axes: Axes, view: View) -> None:
    """Lay the realised shift over a spectrogram, on a scale of its own at the right."""
    if view.summary.moves == 0:
        return
    part = slice_of(view.time_s, view.window_s)
    shift = view.record.controlled.shift_applied_deg[part]
    step = max(shift.size // 1500, 1)
    scale = axes.twinx()
    scale.plot(view.time_s[part][::step], shift[::step], color=SHIFT, linewidth=2.2)
    largest = float(np.max(np.abs(shift), initial=0.1))
    scale.set_ylim(-0.02 * 4.2 * largest, 4.2 * largest)
    scale.set_yticks([])
    scale.set_axis_off()
    words = f"turret 1 shifted {shift[-1]:.2f} deg"
    halo_at = view.window_s[1] - 0.015 * float(np.ptp(view.window_s))
    say(scale, halo_at, float(shift[-1]) + 0.22 * largest, words, SHIFT, ha="right")
