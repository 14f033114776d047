"""Other ways to find chatter, on the same streams: each gives a score, and an alarm where it passes a threshold.

The scores of the two rivals that need a number from the user are relative to what the threshold vibration makes of
force, with the same belief about the cutting stiffness that our monitor gets: a plain number in newtons would do worse.
All know when the machine says that the tools cut, and speak only then.
"""

# pyright: reportMissingTypeStubs=false

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import signal

from services.bench.detector.stream import Stream
from services.messages import Floats

SLIDING, TURNS, SPECTRAL = "thesis", "revolution", "spectral"
NAMES = {
    SLIDING: "thesis: sliding DFT each 444 ms",
    TURNS: "variance between revolutions",
    SPECTRAL: "50 ms spectrum over idle",
}
LEVELS: Floats = np.geomspace(0.02, 1000.0, 97)
"""Thresholds of the sweep; 12 % apart."""

THESIS_WINDOW_S, THESIS_HZ = 1.0, 2.25
REVOLUTIONS, ANGLES = 3, 256
SPECTRUM_S, SPECTRUM_HOP_S, IDLE_S = 0.05, 0.01, 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class Scores:
    """A score and the frequency of what made it, shape (k,) each; NaN where the scheme has no frequency.

    Attributes
    ----------
    time
        When each is known (s), rising.
    score, frequency_hz
        (1), (Hz)
    """

    time: np.ndarray
    score: np.ndarray
    frequency_hz: np.ndarray


def sliding(stream: Stream) -> Scores:
    """Score as on the rig of the thesis (section 6.4.3): a window of 9000 samples, bins of 1 Hz, one axis, each 444 ms.

    The axis is Y1, as there, unless the monitor listens to X1 alone. Zeros precede the start.
    """
    rate, process = stream.rate, stream.process
    axis = process.channels[-1]
    window, step = round(THESIS_WINDOW_S * rate), round(rate / THESIS_HZ)
    force = np.concatenate([np.zeros(window), stream.force[:, axis]])
    ends = np.arange(step, len(stream.force) + 1, step)
    bins = np.arange(math.ceil(process.band_hz[0]), int(process.band_hz[1]) + 1)
    line, peak = np.zeros(ends.size), np.zeros(ends.size)
    for number, end in enumerate(ends):
        amplitude = np.abs(np.fft.rfft(force[end : end + window])[bins]) * 2.0 / window
        line[number], peak[number] = amplitude.max(), bins[int(np.argmax(amplitude))] / THESIS_WINDOW_S
    engaged = stream.engaged[np.minimum(ends // stream.block, len(stream.engaged)) - 1]
    return Scores(time=ends / rate, score=np.where(engaged, line / process.expected([axis]), 0.0), frequency_hz=peak)


def turns(stream: Stream) -> Scores:
    """Score the variance of the force from revolution to revolution, once per revolution.

    In a quiet cut the force repeats with the spindle, in chatter it does not (Schmitz, J. Sound Vib. 262 (2003) 721,
    with one sample per revolution). Here it is taken at 256 angles over the last three revolutions, in the band and on
    all axes listened to, which is faster and steadier than one sample per revolution.
    """
    rate, process = stream.rate, stream.process
    sections = signal.butter(3, process.band_hz, btype="bandpass", fs=rate, output="sos")
    band = np.asarray(signal.sosfilt(sections, stream.force[:, process.channels], axis=0))
    first, last = math.ceil(stream.turned[0]), int(stream.turned[-1])
    marks = (first + np.arange(max(last - first, 0) * ANGLES + 1) / ANGLES)[:-1] if last > first else np.zeros(0)
    at = np.interp(marks, stream.turned, np.arange(stream.turned.size))
    sampled = np.stack([np.interp(at, np.arange(len(band)), column) for column in band.T], axis=1)
    by_turn = sampled.reshape(last - first, ANGLES, -1)
    ends = np.ceil(np.interp(first + 1.0 + np.arange(last - first), stream.turned, np.arange(stream.turned.size)))
    count = max(last - first - REVOLUTIONS + 1, 0)
    groups = np.stack([by_turn[k : k + count] for k in range(REVOLUTIONS)])
    amplitude = np.sqrt(2.0 * groups.var(axis=0, ddof=1).mean(axis=1).sum(axis=1))
    known = ends[REVOLUTIONS - 1 :].astype(np.intp)
    begun = at[::ANGLES][:count].astype(np.intp)
    score = amplitude / process.expected(process.channels)
    score[~_inside(stream, begun, known)] = 0.0
    return Scores(time=known / rate, score=score, frequency_hz=np.full(count, np.nan))


def spectral(stream: Stream) -> Scores:
    """Score the strongest line of a Hann window of 50 ms over what stood there while idling, each 10 ms."""
    rate, process = stream.rate, stream.process
    window, hop = round(SPECTRUM_S * rate), round(SPECTRUM_HOP_S * rate)
    hann = np.hanning(window)
    frequency = np.fft.rfftfreq(window, 1.0 / rate)
    inside = (frequency >= process.band_hz[0]) & (frequency <= process.band_hz[1])
    force = stream.force[:, process.channels]
    count = (len(force) - window) // hop + 1
    begun = hop * np.arange(count)
    power = np.zeros((count, int(inside.sum())))
    for column in force.T:
        pieces = np.lib.stride_tricks.sliding_window_view(column, window)[::hop]
        for start in range(0, count, 4096):
            part = np.fft.rfft(pieces[start : start + 4096] * hann)[:, inside]
            power[start : start + 4096] += np.square(part.real) + np.square(part.imag)
    entered = int(np.argmax(stream.engaged)) * stream.block
    idle = (begun + window <= entered) & (begun + window > entered - round(IDLE_S * rate))
    ratio = np.sqrt(power / power[idle].mean(axis=0))
    peak = np.argmax(ratio, axis=1)
    score = np.where(_inside(stream, begun, begun + window), ratio[np.arange(count), peak], 0.0)
    return Scores(time=(begun + window) / rate, score=score, frequency_hz=frequency[inside][peak])


SCHEMES: dict[str, Callable[[Stream], Scores]] = {SLIDING: sliding, TURNS: turns, SPECTRAL: spectral}


def _inside(stream: Stream, begun: np.ndarray, ended: np.ndarray) -> np.ndarray:
    """Return which windows lie in the cut from their begin to their end."""
    out = np.concatenate([[0], np.cumsum(~stream.engaged)])
    first = np.minimum(begun // stream.block, len(stream.engaged) - 1)
    last = np.clip(-(-ended // stream.block), first + 1, len(stream.engaged))
    return out[last] == out[first]
