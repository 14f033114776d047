"""What a detector is measured against: true onset, the earliest moment at which it could know, the true lines."""

# pyright: reportMissingTypeStubs=false

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from services.messages import BLOCK_S, Floats
from services.metrics import ONSET_HOLD_S, first_held, vibration_envelope

if TYPE_CHECKING:
    from services.bench.detector.stream import Stream

AHEAD_S = 0.2
"""After a detection: in which the line that dominates is the true one."""
PADDING = 16
TOGETHER = 0.5
"""Least amplitude of a second line over the first: below, there is one line."""
PEAK_HZ = 12.0
"""Within so much of a line belongs to it: half of the main lobe of a Hann window of 150 ms."""


def envelope(stream: Stream) -> Floats:
    """Return the vibration in the band over the threshold, 5 % of the feed per tool, shape (n,)."""
    process = stream.process
    return vibration_envelope(stream.vibration, stream.rate, process.band_hz) / process.threshold


def onset_sample(stream: Stream) -> int | None:
    """Return the true onset: from where the vibration stays above the threshold for 20 ms; None when it never does.

    As `chatter_onset_s` of the command line: at least one revolution after the tools entered; after a stable stretch,
    not before the growth begins.
    """
    hold = round(ONSET_HOLD_S * stream.rate)
    if len(stream.vibration) < stream.judged + hold:
        return None
    return first_held(envelope(stream) > 1.0, hold, stream.judged)


def least_time(
    force: Floats,
    limit: Floats,
    rate: float,
    band_hz: tuple[float, float],
    *,
    latency: float,
    begin: float,
    onset: float,
) -> float | None:
    """Return the earliest time (s) at which a detector with these limits could know.

    That is when the amplitude of the force in the band reaches the limit in force at that moment, to stay above it:
    the beginning of the stretch above the limit in which the true onset lies or, when the limit is reached later, the
    first such moment after the onset. The amplitude is that of the estimated force itself, with zero phase and a 5 ms
    envelope, root sum of squares over the axes listened to, and the latency of the estimate is taken off. So it holds
    what growth, noise and limit make unavoidable, and nothing of window, filter, confirmation, block or estimate.

    Parameters
    ----------
    force
        Estimated force (N), shape (n, channels).
    limit
        Limit of the line amplitude in force in each block (N), shape (m,); the last one holds on.
    rate
        (Hz)
    band_hz
        Band of the monitor (Hz).
    latency
        Of the estimate (s).
    begin
        When the growth began (s).
    onset
        True onset (s).
    """
    envelopes = [vibration_envelope(column, rate, band_hz) for column in force.T]
    amplitude = np.sqrt(np.sum(np.square(envelopes), axis=0))
    block = round(BLOCK_S * rate)
    held = np.append(np.repeat(limit, block), np.full(max(amplitude.size - limit.size * block, 0), limit[-1]))
    size = amplitude.size
    above = amplitude > held[:size]
    first, at = round((begin + latency) * rate), min(round((onset + latency) * rate), size - 1)
    if above[at]:
        below = np.flatnonzero(~above[first:at])
        return (first + (int(below[-1]) + 1 if below.size else 0)) / rate - latency
    after = np.flatnonzero(above[at:])
    return (at + int(after[0])) / rate - latency if after.size else None


def spectrum(vibration: Floats, rate: float, band_hz: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
    """Return the frequencies (Hz) of the band and the amplitudes under a Hann window, finely interpolated."""
    window = np.hanning(vibration.size)
    frequency = np.fft.rfftfreq(PADDING * vibration.size, 1.0 / rate)
    amplitude = np.abs(np.fft.rfft((vibration - vibration.mean()) * window, PADDING * vibration.size))
    inside = (frequency >= band_hz[0]) & (frequency <= band_hz[1])
    return frequency[inside], 2.0 / window.sum() * amplitude[inside]


def true_lines(stream: Stream, start: float, span: float = AHEAD_S) -> tuple[float, ...]:
    """Return the line that dominates a stretch of the truth (Hz), and a second one when it is half as strong.

    Parameters
    ----------
    stream
        The cut.
    start, span
        The stretch (s); with less than half of it left there is no answer.
    """
    rate, band_hz = stream.rate, stream.process.band_hz
    first = round(start * rate)
    part = stream.vibration[max(first, 0) : first + round(span * rate)]
    if part.size < 0.5 * span * rate:
        return ()
    frequency, amplitude = spectrum(part, rate, band_hz)
    peak = int(np.argmax(amplitude))
    strongest, height = _vertex(frequency, amplitude, peak), float(amplitude[peak])
    rest = amplitude[1:-1].copy()
    summit = (rest >= amplitude[:-2]) & (rest >= amplitude[2:]) & (np.abs(frequency[1:-1] - strongest) > PEAK_HZ)
    rest[~summit] = 0.0
    second = int(np.argmax(rest)) + 1
    if rest.max(initial=0.0) < TOGETHER * height:
        return (strongest,)
    return strongest, _vertex(frequency, amplitude, second)


def _vertex(frequency: np.ndarray, amplitude: np.ndarray, peak: int) -> float:
    """Return the frequency (Hz) of the summit of a parabola through a peak and its neighbours."""
    if not 0 < peak < frequency.size - 1:
        return float(frequency[peak])
    below, top, above = np.log(np.maximum(amplitude[peak - 1 : peak + 2], 1e-300))
    bend = below - 2.0 * top + above
    shift = 0.5 * (below - above) / bend if bend else 0.0
    return float(frequency[peak] + shift * (frequency[1] - frequency[0]))
