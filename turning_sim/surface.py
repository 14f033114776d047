"""The finished surface: arcs of both tools and what vibration did to them."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

_CUTOFF = 0.8e-3
_LINES = 12
_PROFILE_STEP = 1e-6


class SurfaceTrace(NamedTuple):
    """What both tools left, sample by sample, shape (n,) each.

    Attributes
    ----------
    left1, left2 : ndarray
        Depth (m) that each tool left, deeper positive.
    phase1, phase2 : ndarray
        Material phase under each tool, rising (rad).
    position : ndarray
        Tools from the tip (m); only samples in the cut belong in here.
    """

    left1: np.ndarray
    left2: np.ndarray
    phase1: np.ndarray
    phase2: np.ndarray
    position: np.ndarray


def finished_roughness(
    trace: SurfaceTrace, start: float, stop: float, *, nose_radius: float, feed_per_rev: float
) -> float:
    """Return Ra (m) of the finished surface between two tool positions.

    Both tools' nose arcs, as deep as each pass left them, are laid over each other along lines on the bar; the
    lowest of them remains. Parts that are not yet cut on all sides do not count.

    Parameters
    ----------
    trace : SurfaceTrace
        What both tools left.
    start, stop : float
        Tools from the tip (m).
    nose_radius, feed_per_rev : float
        (m)

    Returns
    -------
    float
        nan if nothing remains.
    """
    if not start < stop:
        raise ValueError(f"start must be before stop ({stop}), got {start}")
    margin = 2.0 * feed_per_rev
    near = (trace.position >= start - 2.0 * margin) & (trace.position <= stop + 2.0 * margin)
    part = SurfaceTrace(*(values[near] for values in trace))
    if part.position.size < 2:
        return math.nan
    low, high = max(start, part.position[0] + margin), min(stop, part.position[-1] - margin)
    z = np.arange(low, high, _PROFILE_STEP)
    if z.size < 100:
        return math.nan
    angles = 2.0 * np.pi * (np.arange(_LINES) + 0.5) / _LINES
    return float(np.mean([mean_roughness(_height(part, a, nose_radius, z), _PROFILE_STEP) for a in angles]))


def _height(trace: SurfaceTrace, angle: float, nose_radius: float, z: np.ndarray) -> np.ndarray:
    # tool 2 meets a line half a turn after tool 1
    one = generatrix(trace.phase1, trace.left1, trace.position, angle)
    two = generatrix(trace.phase2, trace.left2, trace.position, angle + np.pi)
    positions, depths = (np.concatenate(parts) for parts in zip(one, two, strict=True))
    return profile(positions, depths, nose_radius, z)


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
