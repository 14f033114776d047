"""Which lines stand out of a wide spectrum, and how much of their energy one of them holds."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

CHANCE = 1e-3
"""Probability that noise alone shows a line anywhere in one spectrum."""
NEIGHBOURS = 32
"""Bins over which the floor is taken, as their median."""
LOBE = 2
"""Bins to either side of a line under a Hann window that hold its energy."""
HANN_SQUARES = 3.0
"""Sum of the squared amplitudes over the bins of a line under a Hann window, over the mean square of the line."""
MATERIAL = 0.1
"""Least energy of a line relative to all that is periodic, forced vibration included (-10 dB)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Dominant:
    """The strongest of the lines that stand out.

    Parameters
    ----------
    peak : int
        Its bin.
    share : float
        Its part of the energy of the lines that it competes with, 0...1.
    whole : float
        Its part of all energy in the band that is not forced, noise included, 0...1.
    """

    peak: int
    share: float
    whole: float


def floor_of(power: Floats) -> Floats:
    """Return the power of the noise around every bin, from the median of its neighbours, shape (bins,).

    Parameters
    ----------
    power : ndarray, shape (bins,)
        Squared amplitude of every bin.
    """
    size = min(NEIGHBOURS, len(power))
    parts = len(power) // size
    rows = power[: parts * size].reshape(parts, size)
    medians = np.partition(rows, size // 2, axis=1)[:, size // 2]
    last = np.full(len(power) - parts * size, medians[-1])
    return np.concatenate([np.repeat(medians, size), last]) / np.log(2.0)  # exponential: the median is ln 2 means


def standing_limit(power: Floats) -> Floats:
    """Return the power over which a bin holds a line, shape (bins,).

    Parameters
    ----------
    power : ndarray, shape (bins,)
        Squared amplitude of every bin.
    """
    return np.maximum(floor_of(power) * np.log(len(power) / CHANCE), np.finfo(np.float64).tiny)


def harmonic_bins(frequencies_hz: Floats, spindle_hz: float | None, uncertainty: float) -> NDArray[np.bool_] | None:
    """Return the bins that a harmonic of the spindle reaches; None when that leaves too few to look at.

    Parameters
    ----------
    frequencies_hz : ndarray, shape (bins,)
        Bins (Hz), equally spaced.
    spindle_hz : float or None
        Spindle speed (Hz).
    uncertainty : float
        Relative uncertainty of the speed.
    """
    spacing = frequencies_hz[1] - frequencies_hz[0]
    if not spindle_hz or spindle_hz < 4.0 * LOBE * spacing:
        return None
    away = np.abs(frequencies_hz - spindle_hz * np.round(frequencies_hz / spindle_hz))
    return away <= LOBE * spacing + uncertainty * frequencies_hz


def strongest(power: Floats, limit: Floats, square: float, forced: NDArray[np.bool_] | None = None) -> Dominant | None:
    """Return the strongest line outside the forced bins with its share; None when none stands out.

    Parameters
    ----------
    power : ndarray, shape (bins,)
        Squared amplitude of every bin.
    limit : ndarray, shape (bins,)
        Power over which a bin holds a line.
    square : float
        Mean square of the band.
    forced : ndarray of bool, shape (bins,), or None
        Bins of forced vibration, left out.
    """
    lines = np.where(power > limit, power, 0.0)
    total = float(lines.sum())
    if forced is not None:
        lines[forced] = 0.0
    peak = int(lines.argmax())
    free = float(lines.sum())
    own = float(lines[max(peak - LOBE, 0) : peak + LOBE + 1].sum())
    if own == 0.0 or own < MATERIAL * total:
        return None
    rest = max(square - (total - free) / HANN_SQUARES, own / HANN_SQUARES)
    return Dominant(peak=peak, share=own / free, whole=own / HANN_SQUARES / rest)
