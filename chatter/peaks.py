"""The floor of a spectrum, and the lines that stand out of it."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

NEIGHBOURS = 32
"""Bins over which the floor is taken, as their median."""


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
