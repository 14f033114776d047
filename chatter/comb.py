"""Whether a line belongs to a periodic force: a comb of harmonics that is not the line's own."""

import numpy as np
from numpy.typing import NDArray

from chatter.dominance import peaks, standing_limit

Floats = NDArray[np.float64]

LOWEST_HZ = 5.0
"""Lowest fundamental: 300 1/min."""
MOST = 4
"""Highest order at which the strongest line can stand in its comb: tooth passing of four teeth, or its fourth
harmonic. Chatter with sidebands fits such a comb by chance when the ratio to tooth passing is near a fraction: in
0.5 % of cases up to order 4, in 7 % up to order 16."""
FEWEST = 3
"""Other lines of the comb that must be there: two fall onto one of so many combs by chance in some of 10 cases."""
RICH = 0.3
"""Energy of the harmonics over the fundamental from which a line with nothing but harmonics counts as an impact
train; a self-excited vibration near its onset is all but sinusoidal (clipped hard, it has 0.2)."""
FAINT = 2.5e-3
"""Power below which a line does not count, over the strongest (-26 dB)."""
PRECISION = 0.3
"""Error of an interpolated frequency in bins."""


def fundamental(segment: Floats, sample_rate_hz: float, line_hz: float, reach_hz: float) -> float | None:
    """Return the fundamental (Hz) of the comb that a line belongs to, None when it stands for itself.

    A regenerative line makes harmonics of its own and sidebands at the distance of tooth passing, but neither are
    multiples of a fraction of it; a forced line stands among other harmonics of the spindle.

    Parameters
    ----------
    segment : ndarray, shape (n, channels)
        Signal, some 100 periods of the line or more.
    sample_rate_hz : float
        Sampling rate (Hz).
    line_hz : float
        About where the line is (Hz).
    reach_hz : float
        How far from there it may be (Hz).
    """
    frequency, power = _lines(segment, sample_rate_hz)
    near = np.flatnonzero(np.abs(frequency - line_hz) <= reach_hz)
    if not near.size:
        return None
    line = frequency[near[np.argmax(power[near])]]
    own = power[near].max()
    spacing = sample_rate_hz / len(segment)
    for order in range(1, MOST + 1):
        base = line / order
        if base < max(LOWEST_HZ, 5.0 * spacing):
            return None
        multiple = np.round(frequency / base)
        slack = PRECISION * spacing * np.maximum(1.0, 0.5 * multiple / order)
        fits = (np.abs(frequency - multiple * base) <= slack) & (multiple > 0)
        own_harmonic = (multiple % order == 0) & fits
        if order == 1:
            others = multiple != 1
            enough = power[fits & others].sum() >= RICH * own
        else:
            others = ~own_harmonic
            enough = True
        matched = int((fits & others).sum())
        if enough and matched >= FEWEST and 2 * matched >= int(others.sum()):
            return float(base)
    return None


def _lines(segment: Floats, sample_rate_hz: float) -> tuple[Floats, Floats]:
    """Return frequencies (Hz) and powers of the lines that stand out of a stretch."""
    count = len(segment)
    window = np.sin(np.pi * (np.arange(count) + 0.5) / count) ** 2
    spectrum = np.fft.rfft((segment - segment.mean(axis=0)) * window[:, None], axis=0)
    power = (spectrum.real**2 + spectrum.imag**2).sum(axis=1)
    found, away = peaks(power, np.maximum(standing_limit(power), FAINT * power.max()))
    return (found + away) * sample_rate_hz / count, power[found]


def comb_of(
    signal: Floats, sample_rate_hz: float, start: float, end: float, line_hz: float, reach_hz: float
) -> float | None:
    """Return the fundamental (Hz) that most seconds of an episode agree on, None when they do not.

    Parameters
    ----------
    signal : ndarray, shape (n, channels)
        The recording.
    sample_rate_hz : float
        Sampling rate (Hz).
    start, end : float
        The episode (s).
    line_hz : float
        Its frequency (Hz).
    reach_hz : float
        How far the line may wander (Hz).
    """
    length = min(1.0, end - start)
    starts = np.arange(start, end - 0.999 * length, length)[:10]
    found = []
    for begin in starts:
        first = int(begin * sample_rate_hz)
        segment = signal[first : first + int(length * sample_rate_hz)]
        if len(segment) > 1 and np.isfinite(segment).all():
            base = fundamental(segment, sample_rate_hz, line_hz, reach_hz)
            if base is not None:
                found.append(base)
    if 2 * len(found) <= len(starts):
        return None
    bases = np.sort(found)
    alike = (np.abs(bases[:, None] / bases - 1.0) < 0.01).sum(axis=1)
    return float(bases[np.argmax(alike)])  # the commonest, and the lowest of those
