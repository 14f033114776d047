"""A recording with the chatter that was found in it."""

# pyright: reportUnknownMemberType=false

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Protocol

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from services.figures.spectrum import draw_spectrogram, scale_of, spectrogram
from services.figures.style import (
    ALARM,
    INK,
    MUTED,
    draw_band,
    halo,
    new_figure,
    say,
    say_nothing,
    styled,
)
from services.messages import Floats

FORCED = "#8a5a00"


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
) -> Figure:
    """Draw the waveform and the spectrogram of a recording with every episode found laid over."""
    figure = new_figure(12.4, 6.4, _heading(title, verdict, events))
    top, bottom = figure.subplots(2, 1, sharex=True, height_ratios=[1.0, 1.9])
    top.set_ylabel(f"signal ({unit})" if unit else "signal")
    bottom.set_ylabel("frequency (Hz)")
    bottom.set_xlabel("time (s)")
    duration = signal.size / sample_rate_hz
    top_hz = _top_frequency(sample_rate_hz, events, band_hz)
    shown = np.where(np.isfinite(signal), signal, 0.0)
    picture = spectrogram(shown, sample_rate_hz, (0.0, duration), top_hz, length_s=max(0.05, duration / 250))
    if picture is None:
        say_nothing(top, "too short to draw")
        return figure
    draw_band(top, np.arange(signal.size) / sample_rate_hz, shown, MUTED)
    image = draw_spectrogram(bottom, picture, scale_of(picture))
    bar = figure.colorbar(image, ax=bottom, pad=0.012, aspect=26)
    bar.set_label(f"amplitude (dB over 1 {unit or 'unit'})")
    bar.outline.set_visible(False)  # pyright: ignore[reportCallIssue]
    bottom.set_ylim(0.0, top_hz)
    bottom.set_xlim(0.0, duration)
    if band_hz is not None:
        for edge in band_hz:
            bottom.axhline(edge, color=INK, linewidth=0.8, linestyle=(0, (4, 3)), alpha=0.55)
    for event in events:
        _draw_episode(top, bottom, event, duration)
    return figure


def _heading(title: str, verdict: str, events: Sequence[Episode]) -> str:
    chatter = [event for event in events if event.kind != "forced"]
    words = {"chatter": f"chatter, {len(chatter)} episode{'s' if len(chatter) != 1 else ''}", "stable": "no chatter"}
    return f"{title}: {words.get(verdict, verdict)}" if title else words.get(verdict, verdict).capitalize()


def _top_frequency(sample_rate_hz: float, events: Sequence[Episode], band_hz: tuple[float, float] | None) -> float:
    told = [event.frequency_hz for event in events if event.frequency_hz is not None]
    wanted = max([1.15 * band_hz[1]] if band_hz else [2.5 * f for f in told] or [2000.0])
    return min(wanted, 0.5 * sample_rate_hz)


def _draw_episode(top: Axes, bottom: Axes, event: Episode, duration_s: float) -> None:
    colour = FORCED if event.kind == "forced" else ALARM
    end = min(event.end_s, duration_s)
    top.axvspan(event.start_s, end, color=colour, alpha=0.13, linewidth=0)
    top.plot([event.start_s, end], [1.0, 1.0], color=colour, linewidth=4, solid_capstyle="butt", clip_on=False,
             transform=top.get_xaxis_transform())  # fmt: skip
    bottom.axvline(event.start_s, color=colour, linewidth=1.0)
    bottom.axvline(end, color=colour, linewidth=1.0)
    words = f"{event.start_s:.2f} to {event.end_s:.2f} s"
    if end - event.start_s > 0.12 * duration_s:
        halo(top.text(0.5 * (event.start_s + end), 0.95, words, transform=top.get_xaxis_transform(), ha="center",
                      va="top", fontsize=9, color=colour))  # fmt: skip
    if event.frequency_hz is not None:
        bottom.plot([event.start_s, end], [event.frequency_hz] * 2, color=colour, linewidth=1.2, linestyle=(0, (2, 2)))
        right = event.start_s < 0.6 * duration_s
        name = f" {event.kind}, {event.frequency_hz:.0f} Hz "
        say(bottom, event.start_s if right else end, event.frequency_hz, name, colour, va="bottom",
            ha="left" if right else "right")  # fmt: skip


def write_detection_figure(figure: Figure, path: Path) -> Path:
    """Write a figure of a recording and return where."""
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, metadata={"Software": None})
    return path
