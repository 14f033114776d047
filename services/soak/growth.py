"""How fast the memory of a process grows, and how well that is known.

A process takes memory in steps and gives some back, a recorder with each part of its file: the points of one minute
tell little of the next. So the time after the warm-up is cut into stretches, and what their means leave of a straight
line tells how far the slope may be off.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from services.messages import Floats

WARM = 0.5
"""Part of the time that does not count: until then caches and pools are filled, and kernels compiled."""
STRETCHES = 8
STUDENT = 2.45
"""Two-sided 95 % point of Student's t for six degrees of freedom: eight means, two of which the line takes."""
LIMIT_MB_H = 20.0
"""A process that grows faster for sure does not run for weeks."""
LEAST_S = 300.0
"""Shorter than this after the warm-up, a slope is told but not judged: a megabyte more or less would be 12 MB/h."""


class Growth(NamedTuple):
    """Slope of the memory of a process, and by how much it may be off with 95 % confidence (MB/h)."""

    slope_mb_h: float
    error_mb_h: float


def growth(time_s: Floats, held_mb: Floats) -> Growth | None:
    """Return how fast memory grows once it has settled, None when too little was seen.

    Parameters
    ----------
    time_s, held_mb
        When (s) and how much (MB), shape (n,); NaN where it is not known.
    """
    if time_s.size < STRETCHES:
        return None
    known = np.isfinite(held_mb) & (time_s >= time_s[0] + WARM * (time_s[-1] - time_s[0]))
    if known.sum() < STRETCHES:
        return None
    hours = np.array([part.mean() for part in np.array_split(time_s[known] / 3600.0, STRETCHES)])
    held = np.array([part.mean() for part in np.array_split(held_mb[known], STRETCHES)])
    line, covariance = np.polyfit(hours - hours.mean(), held, 1, cov=True)
    return Growth(float(line[0]), STUDENT * float(np.sqrt(covariance[0, 0])))


def judged(time_s: Sequence[float], held_mb: Mapping[str, Sequence[float]]) -> dict[str, Any]:
    """Return what a soak tells of memory.

    Parameters
    ----------
    time_s
        When memory was looked at (s).
    held_mb
        How much each process held then (MB).
    """
    time = np.array(time_s)
    found = {name: growth(time, np.array(held)) for name, held in held_mb.items() if len(held) == len(time)}
    known = {name: seen for name, seen in found.items() if seen is not None}
    judged_s = (1.0 - WARM) * float(time[-1] - time[0]) if time.size else 0.0
    grows = [name for name, seen in known.items() if seen.slope_mb_h - seen.error_mb_h > LIMIT_MB_H]
    return {
        "memory_slope_mb_h": max((seen.slope_mb_h for seen in known.values()), default=None),
        "memory_slopes_mb_h": {name: seen and seen.slope_mb_h for name, seen in found.items()},
        "memory_slope_errors_mb_h": {name: seen and seen.error_mb_h for name, seen in found.items()},
        "memory_judged_s": judged_s,
        "memory_limit_mb_h": LIMIT_MB_H,
        "memory_grows": grows if judged_s >= LEAST_S else None,
        "memory_mb": {name: held[-1] for name, held in held_mb.items() if held},
    }
