"""A recording on its own: its spectra before and after the move, and the part as it was left."""

# pyright: reportUnknownMemberType=false

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure

from services.figures.decision import indicator_figure, shift_figure
from services.figures.force import top_frequency
from services.figures.spectrum import draw_spectrogram, scale_of, spectrogram
from services.figures.style import (
    ALARM,
    CONTROLLED,
    INK,
    MUTED,
    PAPER,
    TWIN,
    mark_times,
    new_figure,
    say,
    say_nothing,
    styled,
)
from services.figures.view import View
from services.messages import Floats
from services.metrics import CHATTER_STATE, Summary
from services.record import RunRecord
from turning_sim import SurfaceTrace

DEPTH = LinearSegmentedColormap.from_list("depth", [CONTROLLED, "#9cc3de", PAPER, "#f0b48c", TWIN])
SPECTRUM_S = 0.5
"""Length of a stretch whose spectrum is drawn, at most (s)."""
ANGLES = 361


def stretches(view: View) -> list[tuple[str, tuple[float, float], str]]:
    """Return what is set side by side: name, stretch (s) and colour; with a move, before and after it."""
    summary = view.summary
    enter, end = summary.entered_cut_s or 0.0, summary.simulated_s
    if summary.first_shift_s is not None:
        before = max(enter, summary.first_shift_s - SPECTRUM_S), summary.first_shift_s
        calm = summary.suppressed_s or min(summary.first_shift_s + 0.5, end)
        after = calm, min(calm + SPECTRUM_S, end)
        return [("before the move", before, TWIN), ("after it", after, CONTROLLED)]
    if summary.detected_s is not None:
        before = max(enter, summary.detected_s - SPECTRUM_S), summary.detected_s
        after = summary.detected_s, min(summary.detected_s + SPECTRUM_S, end)
        return [("before the alarm", before, CONTROLLED), ("from the alarm on", after, TWIN)]
    return [("all of it", (enter, end), CONTROLLED)]


def amplitude_spectrum(values: Floats, rate_hz: float) -> tuple[Floats, Floats]:
    """Return frequency (Hz) and amplitude of a Hann-windowed stretch, zero-padded; a sine shows its own amplitude."""
    taper = np.hanning(values.size)
    size = 4 * values.size
    spectrum = np.abs(np.fft.rfft((values - values.mean()) * taper, size)) * (2.0 / taper.sum())
    return np.arange(spectrum.size) * (rate_hz / size), spectrum


@styled
def force_figure(view: View) -> Figure:
    """Draw the estimated force over time and frequency, and its spectra before and after."""
    figure = new_figure(12.4, 4.9)
    left, right = figure.subplots(1, 2, width_ratios=[1.35, 1.0])
    rate, top_hz = view.record.sample_rate_hz, top_frequency(view)
    force, window = view.record.controlled.force_x1_n, (view.window_s[0], view.summary.simulated_s)
    left.set_title("Estimated force on tool 1, X1")
    left.set_xlabel("time (s)")
    left.set_ylabel("frequency (Hz)")
    right.set_title("Its spectrum")
    right.set_xlabel("frequency (Hz)")
    right.set_ylabel("amplitude (N)")
    picture = spectrogram(force, rate, window, top_hz) if force.size else None
    if picture is None:
        say_nothing(left, "no force was recorded" if not force.size else "too short for a spectrum")
        say_nothing(right, "")
        return figure
    image = draw_spectrogram(left, picture, scale_of(picture, least_top_db=15.0))
    left.set_ylim(0.0, top_hz)
    left.set_xlim(*window)
    bar = figure.colorbar(image, ax=left, pad=0.015, aspect=28)
    bar.set_label("dB over 1 N")
    bar.outline.set_visible(False)  # pyright: ignore[reportCallIssue]
    mark_times(left, view.marks)
    _draw_spectra(right, view, force, top_hz)
    return figure


def _draw_spectra(axes: Axes, view: View, force: Floats, top_hz: float) -> None:
    rate, low = view.record.sample_rate_hz, 0.04 * top_hz
    top = 0.0
    axes.axvspan(*view.record.search_band_hz, color="#eef3f7", linewidth=0)
    for row, (name, (start, stop), colour) in enumerate(stretches(view)):
        part = force[round(start * rate) : round(stop * rate)]
        if part.size < 64:
            continue
        frequency, amplitude = amplitude_spectrum(part, rate)
        shown = (frequency >= low) & (frequency <= top_hz)
        axes.plot(frequency[shown], amplitude[shown], color=colour, linewidth=1.3)
        top = max(top, float(amplitude[shown].max()))
        words = f"{name}, {start:.2f} to {stop:.2f} s"
        say(axes, 0.985, 0.965 - 0.075 * row, words, colour, transform=axes.transAxes, ha="right", va="top")
    axes.set_xlim(low, top_hz)
    axes.set_ylim(0.0, 1.25 * max(top, 1e-9))
    if view.summary.chatter_hz is not None:
        axes.axvline(view.summary.chatter_hz, color=ALARM, linewidth=0.9, linestyle=(0, (3, 3)))
        say(axes, view.summary.chatter_hz, 1.0 * top, f"{view.summary.chatter_hz:.0f} Hz ", ALARM, ha="right",
            fontsize=9)  # fmt: skip


@styled
def part_figure(view: View, trace: SurfaceTrace | None) -> Figure:
    """Draw the part: unrolled and rough where the truth is known, else what the monitor heard along it."""
    if trace is None or trace.position.size < 2:
        return _heard_along(view)
    figure = new_figure(12.4, 6.4)
    top, bottom = figure.subplots(2, 1, sharex=True, height_ratios=[1.7, 1.0])
    top.set_title("The surface, unrolled: depth that the tools left, each turn about its own mean")
    top.set_ylabel("angle round the bar (deg)")
    bottom.set_ylabel("roughness Ra (µm)")
    bottom.set_xlabel("distance from the free end of the bar (mm)")
    picture, extent = unrolled(trace)
    if picture.size:
        reach = max(float(np.percentile(np.abs(picture), 99.5)), 0.5)
        image = top.imshow(picture, extent=extent, aspect="auto", origin="lower", cmap=DEPTH, vmin=-reach, vmax=reach,
                           interpolation="nearest")  # fmt: skip
        bar = figure.colorbar(image, ax=[top, bottom], pad=0.012, aspect=40)
        bar.set_label("deeper than the mean of the turn (µm)")
        bar.outline.set_visible(False)  # pyright: ignore[reportCallIssue]
        top.set_xlim(extent[0], extent[1])
    top.set_yticks([0, 90, 180, 270, 360])
    top.grid(visible=False)
    cut = view.record.controlled
    if cut.ra_um.size:
        bottom.plot(cut.ra_position_mm, cut.ra_um, color=CONTROLLED, linewidth=2.2, drawstyle="steps-mid")
        bottom.set_ylim(0.0, 1.25 * float(cut.ra_um.max()))
    else:
        say_nothing(bottom, "too short for a roughness")
    _mark_places(bottom, view)
    return figure


def unrolled(trace: SurfaceTrace) -> tuple[Floats, tuple[float, float, float, float]]:
    """Return the depth about the mean of each turn (um), shape (angle, turn), and where it lies (mm, deg).

    Both tools' turns alternate along the part; tool 2 meets a line half a turn after tool 1.
    """
    angles = np.linspace(0.0, 2.0 * np.pi, ANGLES)
    turns: list[tuple[float, Floats]] = []
    for phase, left, ahead in ((trace.phase1, trace.left1, 0.0), (trace.phase2, trace.left2, np.pi)):
        first = int(np.ceil((phase[0] - ahead) / (2.0 * np.pi)))
        last = int(np.floor((phase[-1] - ahead) / (2.0 * np.pi))) - 1
        for turn in range(first, last + 1):
            at = 2.0 * np.pi * turn + ahead + angles
            depth = np.interp(at, phase, left)
            turns.append((float(np.interp(at[0], phase, trace.position)), 1e6 * (depth - depth.mean())))
    turns.sort(key=lambda turn: turn[0])
    if len(turns) < 2:
        return np.zeros((0, 0)), (0.0, 1.0, 0.0, 360.0)
    return np.array([depth for _, depth in turns]).T, (1e3 * turns[0][0], 1e3 * turns[-1][0], 0.0, 360.0)


def _heard_along(view: View) -> Figure:
    """Draw the indicator over the place on the part: what is known where nobody tells the surface."""
    figure = new_figure(12.4, 4.4)
    axes = figure.subplots()
    axes.set_title("Along the part: what the monitor heard (the surface itself was not recorded)")
    axes.set_xlabel("distance from the free end of the bar (mm)")
    axes.set_ylabel("force in the band, RMS (N)")
    record, reports = view.record, view.record.reports
    place = record.controlled.z_mm
    if not place.size or not reports.first_sample.size:
        axes.set_xlabel("")
        say_nothing(axes, "where the tools were was not recorded")
        return figure
    index = np.clip(np.round(reports.first_sample), 0, place.size - 1).astype(int)
    inside = record.controlled.in_cut[index] > 0.5
    if not inside.any():
        say_nothing(axes, "the tools were not in the cut")
        return figure
    at = place[index][inside]
    axes.plot(at, reports.limit[inside], color=INK, linewidth=1.2, linestyle=(0, (5, 2)))
    axes.plot(at, reports.indicator[inside], color=CONTROLLED, linewidth=1.4)
    alarm = np.array([state == CHATTER_STATE for state in reports.state])[inside]
    axes.plot(at[alarm], reports.indicator[inside][alarm], ".", color=ALARM, markersize=6)
    top = 1.25 * float(max(reports.indicator[inside].max(), reports.limit[inside].max()))
    axes.set_ylim(0.0, top)
    say(axes, float(at[-1]), float(reports.limit[inside][-1]) + 0.03 * top, "limit ", INK, ha="right", va="bottom",
        fontweight="normal", fontsize=9)  # fmt: skip
    _mark_places(axes, view)
    return figure


def _mark_places(axes: Axes, view: View) -> None:
    """Mark where along the part things happened; the limits of the axes must be final."""
    place, rate = view.record.controlled.z_mm, view.record.sample_rate_hz
    if not place.size:
        return
    low, high = axes.get_xlim()
    for row, (time_s, word, colour) in enumerate(mark for mark in view.marks if mark[2] != MUTED):
        at = float(place[min(round(time_s * rate), place.size - 1)])
        axes.axvline(at, color=colour, linewidth=1.0, alpha=0.8)
        right = at < low + 0.8 * (high - low)
        words = f" {word}" if right else f"{word} "
        say(axes, at, (0.93 - 0.1 * row) * axes.get_ylim()[1], words, colour, ha="left" if right else "right",
            fontsize=8.5)  # fmt: skip


def write_recorded_figures(record: RunRecord, summary: Summary, trace: SurfaceTrace | None, folder: Path) -> list[Path]:
    """Write the figures of a recording as PNG into a folder and list the files."""
    folder.mkdir(parents=True, exist_ok=True)
    view = View.of(record, summary)
    drawn = {
        "force": force_figure(view), "indicator": indicator_figure(view), "shift": shift_figure(view),
        "part": part_figure(view, trace),
    }  # fmt: skip
    for name, figure in drawn.items():
        figure.savefig(folder / f"{name}.png", metadata={"Software": None})
    return [folder / f"{name}.png" for name in drawn]
