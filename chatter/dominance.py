"""Which lines stand out of a wide spectrum, and how much of their energy one of them holds."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

CHANCE = 1e-3
"""Probability that noise alone shows a line anywhere in one spectrum."""
NEIGHBOURS = 32
"""Bins over which the floor is taken, as their median."""
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


def is_harmonic(frequency_hz: Floats, spindle_hz: float, tolerance_hz: Floats) -> NDArray[np.bool_]:
    """Return which frequencies are harmonics of the spindle.

    Parameters
    ----------
    frequency_hz : ndarray, shape (m,)
        Frequencies (Hz).
    spindle_hz : float
        Spindle speed (Hz).
    tolerance_hz : ndarray, shape (m,)
        How far a harmonic may lie from its nominal place (Hz).
    """
    return np.abs(frequency_hz - spindle_hz * np.round(frequency_hz / spindle_hz)) <= tolerance_hz


def peaks(power: Floats, limit: Floats) -> tuple[NDArray[np.intp], Floats]:
    """Return the bins of the lines and their distance from the true frequencies in bins (Hann window).

    Parameters
    ----------
    power : ndarray, shape (bins,)
        Squared amplitude of every bin.
    limit : ndarray, shape (bins,)
        Power over which a bin holds a line.
    """
    padded = np.concatenate([[0.0], power, [0.0]])
    below, above = padded[:-2], padded[2:]
    found = np.flatnonzero((power > limit) & (power >= below) & (power > above))
    ratio = np.sqrt(np.maximum(below, above)[found] / power[found])
    away = np.clip((2.0 * ratio - 1.0) / (ratio + 1.0), 0.0, 0.5)
    return found, np.where(above[found] > below[found], away, -away)


def strongest(
    power: Floats,
    limit: Floats,
    square: float,
    frequencies_hz: Floats,
    spindle_hz: float | None,
    uncertainty: float,
    kept_hz: float = np.inf,
) -> Dominant | None:
    """Return the strongest line that is no harmonic of the spindle; None when there is none that matters.

    Parameters
    ----------
    power : ndarray, shape (bins,)
        Squared amplitude of every bin.
    limit : ndarray, shape (bins,)
        Power over which a bin holds a line.
    square : float
        Mean square of the band.
    frequencies_hz : ndarray, shape (bins,)
        Bins (Hz), equally spaced.
    spindle_hz : float or None
        Spindle speed (Hz).
    uncertainty : float
        Relative uncertainty of the speed.
    kept_hz : float
        A line known to chatter (Hz), which may drift over a harmonic without becoming one.
    """
    found, away = peaks(power, limit)
    if not found.size:
        return None
    padded = np.concatenate([[0.0], power, [0.0]])
    own = padded[found] + padded[found + 1] + padded[found + 2]
    free = np.ones(found.size, dtype=bool)
    if spindle_hz:
        spacing = frequencies_hz[1] - frequencies_hz[0]
        frequency = frequencies_hz[found] + away * spacing
        free = ~is_harmonic(frequency, spindle_hz, uncertainty * frequency + 0.25 * spacing)
        free |= np.abs(frequency - kept_hz) <= spacing
    total, competing = float(own.sum()), float(own[free].sum())
    best = int(np.argmax(np.where(free, own, 0.0)))
    if not free[best] or own[best] < MATERIAL * total:
        return None
    rest = max(square - (total - competing) / HANN_SQUARES, own[best] / HANN_SQUARES)
    return Dominant(
        peak=int(found[best]), share=float(own[best]) / competing, whole=float(own[best]) / HANN_SQUARES / rest
    )
