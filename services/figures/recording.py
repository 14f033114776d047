"""A recording with the chatter that was found in it."""

# pyright: reportUnknownMemberType=false

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Protocol

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from chatter.recording import HIGHEST_HZ, LOWEST_HZ, USABLE
from services.figures.spectrum import draw_spectrogram, scale_of, spectrogram, together
from services.figures.style import (
    ALARM,
    INK,
    MUTED,
    draw_band,
    halo,
    new_figure,
    plain_log,
    say,
    say_nothing,
    styled,
)
from services.figures.trace import band_level
from services.messages import Floats

FORCED = "#8a5a00"
MOST_HARMONICS = 40
LINE_HZ, LINE_SHARE = 20.0, 0.03
"""How far a line may wander and still be drawn as one: so many Hz, or this part of its frequency."""


class Episode(Protocol):
    """A stretch of chatter or of forced vibration found in a recording."""

    @property
    def start_s(self) -> float:
        """Begin (s)."""
        ...

    @property
    def end_s(self) -> float:
        """End (s)."""
        ...

    @property
    def frequency_hz(self) -> float | None:
        """Dominant frequency (Hz), if one was found."""
        ...

    @property
    def kind(self) -> str:
        """Either `regenerative` or `forced`."""
        ...


@styled
def detection_figure(
    signal: Floats,
    sample_rate_hz: float,
    *,
    verdict: str,
    events: Sequence[Episode],
    band_hz: tuple[float, float] | None = None,
    title: str = "",
    unit: str = "",
    spindle_hz: float | None = None,
    tools: int | None = None,
    said: str = "",
) -> Figure:
    """Draw waveform, spectrogram and level of a recording, shape (n,) or (n, channels), with every episode found.

    `said` tells how sure the verdict is.
    """
    heading = _heading(title, verdict, events)
    figure = new_figure(12.4, 8.0, f"{heading}, {said}" if said else heading)
    top, middle, bottom = figure.subplots(3, 1, sharex=True, height_ratios=[0.75, 2.0, 1.0])
    samples = np.where(np.isfinite(signal), signal, 0.0)
    samples = samples[:, None] if samples.ndim == 1 else samples
    duration = len(samples) / sample_rate_hz
    top_hz = _top_frequency(sample_rate_hz, events, band_hz)
    shown = samples[:, int(np.argmax(samples.std(axis=0)))] if len(samples) else samples.reshape(-1)
    length_s = max(0.05, duration / 250)
    picture = together([spectrogram(x, sample_rate_hz, (0.0, duration), top_hz, length_s) for x in samples.T])
    top.set_ylabel(f"signal ({unit})" if unit else "signal")
    middle.set_ylabel("frequency (Hz)")
    bottom.set_ylabel(f"RMS in 0.1 s ({unit})" if unit else "RMS in 0.1 s")
    bottom.set_xlabel("time (s)")
    if picture is None:
        say_nothing(middle, "too short to draw")
        return figure
    draw_band(top, np.arange(len(shown)) / sample_rate_hz, shown, MUTED)
    image = draw_spectrogram(middle, picture, scale_of(picture))
    bar = figure.colorbar(image, ax=middle, pad=0.012, aspect=26)
    bar.set_label(f"amplitude (dB over 1 {unit or 'unit'})")
    bar.outline.set_visible(False)  # pyright: ignore[reportCallIssue]
    middle.set_ylim(0.0, top_hz)
    middle.set_xlim(0.0, duration)
    for edge in band_hz or ():
        middle.axhline(edge, color=INK, linewidth=0.8, linestyle=(0, (4, 3)), alpha=0.55)
    if spindle_hz is not None:
        _draw_harmonics(middle, spindle_hz, tools, top_hz)
    for event in events:
        _draw_episode((top, middle, bottom), event, duration)
    _draw_levels(bottom, samples, sample_rate_hz, band_hz, events)
    return figure


def _draw_harmonics(axes: Axes, spindle_hz: float, tools: int | None, top_hz: float) -> None:
    """Dash what the spindle forces: each harmonic while they can be told apart, tooth passing always."""
    edges = max(tools or 1, 1)
    if top_hz / spindle_hz <= MOST_HARMONICS:
        for k in range(1, int(top_hz / spindle_hz) + 1):
            axes.axhline(k * spindle_hz, color=FORCED, linewidth=0.6, linestyle=(0, (2, 5)), alpha=0.55)
    for k in range(1, int(top_hz / (edges * spindle_hz)) + 1):
        axes.axhline(k * edges * spindle_hz, color=FORCED, linewidth=0.9, linestyle=(0, (6, 4)), alpha=0.75)
    name = f"tooth passing {edges * spindle_hz:.0f} Hz" if tools else f"spindle {spindle_hz:.1f} Hz"
    say(axes, axes.get_xlim()[1], edges * spindle_hz, f"{name} and harmonics ", FORCED, va="bottom", ha="right",
        fontsize=8.5)  # fmt: skip


def _draw_levels(
    axes: Axes, samples: Floats, sample_rate_hz: float, band_hz: tuple[float, float] | None, events: Sequence[Episode]
) -> None:
    """Draw how strong the band is, and the line of the longest episode in it."""
    low, high = band_hz or (LOWEST_HZ, min(HIGHEST_HZ, USABLE * sample_rate_hz))
    if not 0.0 < low < 0.45 * sample_rate_hz or len(samples) < 0.3 * sample_rate_hz:
        say_nothing(axes, "too short or too slow for a level")
        return
    at, level = band_level(samples, sample_rate_hz, (low, high))
    floor = max(float(np.percentile(level, 2.0)), 1e-6 * float(level.max(initial=0.0)), 1e-12)
    axes.plot(at, np.maximum(level, 0.1 * floor), color=MUTED, linewidth=1.2)
    plain_log(axes)
    ends = [(f"all from {low:.0f} to {high:.0f} Hz", MUTED)]
    told = [event for event in events if event.frequency_hz is not None]
    if told:
        longest = max(told, key=lambda event: (event.kind != "forced", event.end_s - event.start_s))
        line_hz, colour = longest.frequency_hz or 0.0, FORCED if longest.kind == "forced" else ALARM
        half = max(LINE_HZ, LINE_SHARE * line_hz)
        at, line = band_level(samples, sample_rate_hz, (max(line_hz - half, 0.5 * line_hz), line_hz + half))
        axes.plot(at, np.maximum(line, 0.01 * floor), color=colour, linewidth=1.4)
        floor = min(floor, max(float(np.percentile(line, 2.0)), 0.01 * floor))
        ends.append((f"within {half:.0f} Hz of {line_hz:.0f} Hz", colour))
    axes.set_ylim(0.7 * floor, 3.0 * float(level.max(initial=floor)))
    for height, (words, colour) in zip((0.95, 0.81), ends, strict=False):
        halo(axes.text(0.995, height, words, transform=axes.transAxes, ha="right", va="top", fontsize=9.5,
                       fontweight="bold", color=colour))  # fmt: skip


def _heading(title: str, verdict: str, events: Sequence[Episode]) -> str:
    chatter = [event for event in events if event.kind != "forced"]
    found = f"chatter, {len(chatter)} episodes"
    if len(chatter) == 1 and chatter[0].frequency_hz is not None:
        one = chatter[0]
        found = f"chatter from {one.start_s:.1f} s to {one.end_s:.1f} s at {one.frequency_hz:.0f} Hz"
    words = {"chatter": found, "stable": "no chatter"}
    return f"{title}: {words.get(verdict, verdict)}" if title else words.get(verdict, verdict).capitalize()


def _top_frequency(sample_rate_hz: float, events: Sequence[Episode], band_hz: tuple[float, float] | None) -> float:
    told = [event.frequency_hz for event in events if event.frequency_hz is not None]
    wanted = max([1.15 * band_hz[1]] if band_hz else [2.5 * f for f in told] or [2000.0])
    return min(wanted, 0.5 * sample_rate_hz)


def _draw_episode(rows: tuple[Axes, Axes, Axes], event: Episode, duration_s: float) -> None:
    top, middle, bottom = rows
    colour = FORCED if event.kind == "forced" else ALARM
    end = min(event.end_s, duration_s)
    for axes in (top, bottom):
        axes.axvspan(event.start_s, end, color=colour, alpha=0.11, linewidth=0)
    top.plot([event.start_s, end], [1.0, 1.0], color=colour, linewidth=4, solid_capstyle="butt", clip_on=False,
             transform=top.get_xaxis_transform())  # fmt: skip
    middle.axvline(event.start_s, color=colour, linewidth=1.0)
    middle.axvline(end, color=colour, linewidth=1.0)
    words = f"{event.start_s:.2f} to {event.end_s:.2f} s"
    if end - event.start_s > 0.12 * duration_s:
        halo(top.text(0.5 * (event.start_s + end), 0.95, words, transform=top.get_xaxis_transform(), ha="center",
                      va="top", fontsize=9, color=colour))  # fmt: skip
    if event.frequency_hz is not None:
        middle.plot([event.start_s, end], [event.frequency_hz] * 2, color=colour, linewidth=1.2, linestyle=(0, (2, 2)))
        right = event.start_s < 0.6 * duration_s
        name = f" {event.kind}, {event.frequency_hz:.0f} Hz "
        say(middle, event.start_s if right else end, event.frequency_hz, name, colour, va="bottom",
            ha="left" if right else "right")  # fmt: skip


def write_detection_figure(figure: Figure, path: Path) -> Path:
    """Write a figure of a recording and return where."""
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, metadata={"Software": None})
    return path
