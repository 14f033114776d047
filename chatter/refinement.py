"""The frequency of a line that stands still, from the longest stretch in which it does."""

import numpy as np
from numpy.typing import NDArray

from chatter.spectrum import PRESENT

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

ROUNDS = 3


def settled(slow: Complexes, start_hz: float, shortest: float, rate: float) -> tuple[float, float] | None:
    """Return frequency (Hz) and span (s) from the longest end of a baseband in which a line is steady, None without.

    The stretch is doubled as long as its estimate agrees with that of its newer half within half a bin, and as long
    as the line is there all along.

    Parameters
    ----------
    slow : ndarray, shape (m, channels)
        Baseband, the newest last.
    start_hz : float
        Frequency to start from, counted from the centre of the baseband (Hz).
    shortest : float
        First stretch (s).
    rate : float
        Rate of the baseband (Hz).
    """
    length = round(shortest * rate)
    if not 4 <= length <= len(slow):
        return None
    found = _interpolated(slow[len(slow) - length :], start_hz, rate)
    span = length / rate
    while found is not None and length < len(slow):
        length = min(2 * length, len(slow))
        longer = _interpolated(slow[len(slow) - length :], found[0], rate)
        if longer is None or abs(longer[0] - found[0]) > 0.5 * rate / length or longer[1] < PRESENT * found[1]:
            break
        found, span = longer, length / rate
    return None if found is None else (found[0], span)


def _interpolated(slow: Complexes, start_hz: float, rate: float) -> tuple[float, float] | None:
    """Return frequency (Hz) and amplitude of the line near a frequency, None when there is none within 1 / length.

    Two values of the Hann spectrum half a bin to either side give the distance to the line exactly when it stands
    alone: 1.5 (r - 1) / (r + 1), with r their ratio (Grandke, IEEE Trans. IM 32 (1983) 350, at half bins).
    """
    count = len(slow)
    spacing = rate / count
    time = np.arange(count) - 0.5 * (count - 1)
    windowed = slow * np.cos(np.pi * time / count)[:, None] ** 2
    frequency, size = start_hz, 0.0
    for _ in range(ROUNDS):
        sides = np.array([frequency - 0.5 * spacing, frequency + 0.5 * spacing])
        values = np.exp((-2j * np.pi / rate) * np.outer(sides, time)) @ windowed
        below, above = np.sqrt((values.real**2 + values.imag**2).sum(axis=1))
        if below + above == 0.0:
            return None
        frequency += 1.5 * (above - below) / (above + below) * spacing
        if abs(frequency - start_hz) > spacing:
            return None
        size = (below + above) / count
    return float(frequency), float(size)
