"""The lines of a spectrum: where they stand, how strong, how far their feet reach, and the noise around them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d

from chatter.peaks import peaks

Floats = NDArray[np.float64]
Bins = NDArray[np.intp]

CHANCE = 1e-2
"""Probability that noise alone shows a line anywhere in one spectrum: three lines must agree before one counts."""
NEIGHBOURS, QUIET = 48, 0.3
"""Bins over which the floor is taken, and which quantile: half of a dense comb is lines, but not the lower third."""
SKIRT_BINS, SKIRT = 21, 2.5e-3
"""A line that fluctuates has a skirt of false ones: within 10 bins only what is less than 26 dB weaker counts."""
FOOT_BINS, FOOT_SHARE = 3, 0.003
"""How far a foot reaches at most: the lobe of the window, and 0.3 % of the frequency, by which a spindle wanders."""
LOBE_SQUARES = 1.5
"""Sum of the squared amplitudes of a Hann lobe over the squared peak."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Lines:
    """Lines of one stretch of a recording, in order of frequency.

    Parameters
    ----------
    frequency_hz : ndarray, shape (n,)
        Interpolated frequencies (Hz).
    power : ndarray, shape (n,)
        Mean squares, summed over the channels.
    prominence : ndarray, shape (n,)
        Peak over the floor of noise (power).
    floor : ndarray, shape (n,)
        Mean square that noise alone would show in place of the line.
    first, last : ndarray, shape (n,)
        Bins of the feet.
    spacing_hz : float
        Distance of the bins (Hz).
    sample_rate_hz : float
        Sampling rate (Hz).
    spectrum : ndarray, shape (bins, channels)
        The spectrum under its Hann window.
    """

    frequency_hz: Floats
    power: Floats
    prominence: Floats
    floor: Floats
    first: Bins
    last: Bins
    spacing_hz: float
    sample_rate_hz: float
    spectrum: NDArray[np.complex128]


def hann(count: int) -> Floats:
    """Return a window whose halves add up to one, shape (n,).

    Parameters
    ----------
    count : int
        Length in samples.
    """
    return np.asarray(np.sin(np.pi * (np.arange(count) + 0.5) / count) ** 2, dtype=np.float64)


def lines_of(segment: Floats, sample_rate_hz: float, lowest_hz: float) -> Lines:
    """Return the lines that stand out of a stretch.

    Parameters
    ----------
    segment : ndarray, shape (n, channels)
        Samples.
    sample_rate_hz : float
        Sampling rate (Hz).
    lowest_hz : float
        Below this nothing counts (Hz).
    """
    count = len(segment)
    spacing = sample_rate_hz / count
    spectrum = np.fft.rfft((segment - segment.mean(axis=0)) * hann(count)[:, None], axis=0)
    power = (spectrum.real**2 + spectrum.imag**2).sum(axis=1)
    level = _floor(power)
    found, away = peaks(power, np.maximum(level * np.log(0.5 * count / CHANCE), np.finfo(np.float64).tiny))
    near = maximum_filter1d(power, SKIRT_BINS)[found]
    kept = (power[found] >= SKIRT * near) & (found * spacing >= lowest_hz) & (found > 2) & (found < len(power) - 3)
    found, away = found[kept], away[kept]
    scale = 16.0 / (2.0 * LOBE_SQUARES * count**2)  # a line of amplitude A peaks at A n / 4 and holds A^2 / 2
    first, last = _feet(power, level, found)
    return Lines(
        frequency_hz=(found + away) * spacing,
        power=scale * np.sum([power[found + k] for k in (-2, -1, 0, 1, 2)], axis=0),
        prominence=power[found] / np.maximum(level[found], np.finfo(np.float64).tiny),
        floor=scale * 5.0 * level[found],
        first=first,
        last=last,
        spacing_hz=spacing,
        sample_rate_hz=sample_rate_hz,
        spectrum=spectrum,
    )


def _floor(power: Floats) -> Floats:
    """Return the mean power of the noise around every bin."""
    size = min(NEIGHBOURS, len(power))
    parts = len(power) // size
    rows = power[: parts * size].reshape(parts, size)
    rank = int(QUIET * size)
    level = np.partition(rows, rank, axis=1)[:, rank] / -np.log1p(-QUIET)  # exponential: a quantile q is -ln(1-q) means
    centres = (np.arange(parts) + 0.5) * size
    return np.asarray(np.interp(np.arange(len(power)), centres, level), dtype=np.float64)


def _feet(power: Floats, level: Floats, found: Bins) -> tuple[Bins, Bins]:
    """Return how far every line falls steadily to either side, down to the noise."""
    most = (FOOT_BINS + FOOT_SHARE * found).astype(np.intp)
    ends = []
    for step in (-1, 1):
        at, going = found.copy(), np.ones(len(found), dtype=bool)
        for _ in range(int(most.max(initial=0))):
            after = np.clip(at + step, 0, len(power) - 1)
            going &= (np.abs(after - found) <= most) & (power[after] < power[at]) & (power[after] > level[after])
            at = np.where(going, after, at)
        ends.append(at)
    return ends[0], ends[1]
