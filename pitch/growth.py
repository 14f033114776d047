"""Which cutting stiffness makes chatter grow at a wanted rate."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pitch._checks import finite, positive
from pitch.stability import OneModeProcess, _symbols

Floats = NDArray[np.float64]

_PER_TURN = 48
"""Samples of the crossing condition per turn of its fastest phase."""
_HALVINGS = 45


def stiffness_for_growth(
    process: OneModeProcess, growth: float, spindle_hz: float, pitch_difference: float, largest: float
) -> tuple[Floats, Floats]:
    """Return every cutting stiffness at which a root has the real part `growth`, the smallest first.

    With s = growth + i w, D(s) = 0 gives K(w); where it is real and positive a root crosses Re s = growth. Without
    cutting all roots lie left of that (for growth > -damping_ratio omega_n), so at the smallest K the rightmost root
    has just arrived, and the next ones say how close its rivals are. For growth = 0 the smallest is the critical
    stiffness. Yamada, PhD thesis, Keio University, 2017, chapter 6.

    Parameters
    ----------
    process : OneModeProcess
        Bar and cut.
    growth : float
        Real part of the root (1/s).
    spindle_hz : float
        Spindle speed (Hz).
    pitch_difference : float
        Pitch difference (rad).
    largest : float
        Where to stop (N/m).

    Returns
    -------
    stiffness : ndarray
        Radial stiffness of one tool (N/m), rising, shape (n,); empty when none up to `largest` does.
    frequency_hz : ndarray
        Frequency of the root (Hz), shape (n,).
    """
    p = _symbols(process, spindle_hz, pitch_difference)
    sigma, most = finite("growth", growth), positive("largest", largest)
    waves = 1.0 + abs(p.mu) * max(math.exp(-sigma * p.tau_1), math.exp(-sigma * p.tau_2))
    top = math.sqrt((p.k + p.m * sigma**2 + abs(p.C * sigma) + 2.0 * most * waves) / p.m)
    step = math.pi / (_PER_TURN * p.half_turn)
    grid = step * np.arange(1, math.ceil(top / step) + 2)
    value = _crossing(p, sigma, grid)
    at = np.flatnonzero(value[:-1] * value[1:] < 0.0)
    low, high, sign = grid[at], grid[at + 1], value[at]
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        same = _crossing(p, sigma, middle) * sign > 0.0
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    bar, wave = _sides(p, sigma, low)
    stiffness = np.asarray(-0.5 * (bar / wave).real, dtype=np.float64)
    kept = np.flatnonzero((stiffness > 0.0) & (stiffness <= most))
    kept = kept[np.argsort(stiffness[kept])]
    return stiffness[kept], np.asarray(low[kept] / (2.0 * math.pi), dtype=np.float64)


def _sides(p: Any, sigma: float, w: Any) -> tuple[Any, Any]:
    """Return what is without cutting in D(s), and what 2 K multiplies."""
    s = sigma + 1j * w
    wave = 0.5 * p.mu * (np.exp(-s * p.tau_1) + np.exp(-s * p.tau_2))
    return p.m * s * s + p.C * s + p.k, 1.0 + wave


def _crossing(p: Any, sigma: float, w: Any) -> Any:
    """Return what is zero where K is real."""
    bar, wave = _sides(p, sigma, w)
    return (bar * np.conj(wave)).imag
