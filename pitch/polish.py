"""From rough characteristic roots to exact ones."""

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Characteristic = Callable[[NDArray[np.complex128]], tuple[NDArray[np.complex128], NDArray[np.complex128]]]


def polished(
    characteristic: Characteristic, rough: NDArray[np.complex128], half_turn: float, longest: float
) -> NDArray[np.complex128]:
    """Newton's method from each rough root; those that wander off or do not settle were spurious.

    Parameters
    ----------
    characteristic : callable
        Returns the characteristic function and its derivative at roots (1/s), shape (n,) each.
    rough : ndarray
        Roots (1/s), shape (n,).
    half_turn : float
        Half a turn of the spindle (s): neighbours of one family lie two spindle frequencies apart.
    longest : float
        Longest delay (s); a wave that dies 300 times over in it is no root.

    Returns
    -------
    ndarray
        The roots that settled (1/s), shape (k,).
    """
    rough = rough[rough.real > -300.0 / longest]
    s, near = rough.copy(), 0.1 * math.pi / half_turn
    step = np.zeros_like(s)
    for _ in range(12):
        value, slope = characteristic(s)
        step = value / np.where(slope == 0.0, 1.0, slope)
        s = s - step * np.minimum(1.0, near / np.maximum(np.abs(step), 1e-300))
    good = (np.abs(step) < 1e-8 * (1 + np.abs(s))) & (np.abs(s - rough) < near)
    return s[good]


def distinct(found: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Sort roots (1/s), shape (n,), the rightmost first, with imaginary part >= 0 and each of them once."""
    kept: list[complex] = []
    for one in sorted((complex(z.real, abs(z.imag)) for z in found), key=lambda z: -z.real):
        if all(abs(one - other) > 1e-6 * (1 + abs(one)) for other in kept):
            kept.append(one)
    return np.array(kept, dtype=np.complex128)
