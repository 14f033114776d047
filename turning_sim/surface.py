"""The finished surface: arcs of both tools and what vibration did to them."""

from __future__ import annotations

import numpy as np

_CUTOFF = 0.8e-3


def generatrix(
    phases: np.ndarray, depths: np.ndarray, positions: np.ndarray, angle: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return where one tool crossed a line along the bar: position (m) and depth (m) of each pass.

    Parameters
    ----------
    phases : ndarray
        Material phase under the tool, rising (rad), shape (n,).
    depths : ndarray
        What the tool left, deeper positive (m), shape (n,).
    positions : ndarray
        Tool position (m), shape (n,).
    angle : float
        Phase of the line (rad).
    """
    turn = 2.0 * np.pi
    first = np.ceil((phases[0] - angle) / turn)
    last = np.floor((phases[-1] - angle) / turn)
    at = angle + turn * np.arange(first, last + 1.0)
    return np.interp(at, phases, positions), np.interp(at, phases, depths)


def profile(positions: np.ndarray, depths: np.ndarray, nose_radius: float, z: np.ndarray) -> np.ndarray:
    """Return the height (m) left by the deepest of the arcs at each `z` (m); arcs further than one radius do not count.

    Parameters
    ----------
    positions, depths : ndarray
        Centre (m) and depth (m) of each arc, any order, shape (n,).
    nose_radius : float
        (m)
    z : ndarray
        Rising (m), shape (k,).
    """
    order = np.argsort(positions)
    positions, depths = positions[order], depths[order]
    height = np.full(z.size, np.inf)
    lows = np.searchsorted(z, positions - nose_radius)
    highs = np.searchsorted(z, positions + nose_radius)
    for centre, depth, low, high in zip(positions, depths, lows, highs, strict=True):
        away = z[low:high] - centre
        arc = nose_radius - np.sqrt(np.maximum(nose_radius**2 - away * away, 0.0)) - depth
        np.minimum(height[low:high], arc, out=height[low:high])
    return height


def mean_roughness(height: np.ndarray, spacing: float) -> float:
    """Return Ra (m) of an evenly spaced profile (m), sampling lengths of 0.8 mm levelled one by one (ISO 4288)."""
    count = max(1, round(height.size * spacing / _CUTOFF))
    parts = np.array_split(height, count)
    return float(np.concatenate([np.abs(part - part.mean()) for part in parts]).mean())
