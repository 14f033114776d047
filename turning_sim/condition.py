"""How stiffness, overlap and damping of a cut change with its depth and feed: the chip of a round nose, in quadrature.

The slow and simple twin of the surface map's `cut_derivatives`, for edges within the nose: the tool `now` deeper, the
pass before it `before` deeper; the thrust is normal to the chord of the engaged edge.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq

from turning_sim._check import require
from turning_sim.chip import Chip
from turning_sim.cutting import Cutting

_POINTS = 2001
_CHANGE = 0.2e-6


class ConditionChange(NamedTuple):
    """Of a changed cut over the present one: radial stiffness, overlap, process damping (1)."""

    stiffness: float
    overlap: float
    damping: float


def condition_change(
    cutting: Cutting, *, depth_of_cut: float | None = None, feed_per_rev: float | None = None
) -> ConditionChange:
    """Return by how much another depth or feed changes what stability depends on.

    Parameters
    ----------
    cutting : Cutting
        The present cut.
    depth_of_cut, feed_per_rev : float or None
        The other ones (m); None keeps what is.

    Returns
    -------
    ConditionChange
        Ratios; process damping goes with the engaged edge.
    """
    feed = cutting.feed_per_rev if feed_per_rev is None else feed_per_rev
    depth = cutting.depth_of_cut if depth_of_cut is None else depth_of_cut
    other = replace(cutting, feed_per_rev=feed, depth_of_cut=depth, setting_difference=0.0)
    (stiff, overlap), (stiff0, overlap0) = chip_derivatives(other), chip_derivatives(cutting)
    edge = other.chip.edge_length / cutting.chip.edge_length
    return ConditionChange(stiffness=stiff / stiff0, overlap=overlap / overlap0, damping=edge)


def chip_derivatives(cutting: Cutting) -> tuple[float, float]:
    """Return radial stiffness (N/m) and overlap (1) of one tool about the steady cut.

    Parameters
    ----------
    cutting : Cutting
        Its edge must end within the nose.

    Returns
    -------
    tuple of float
        By central differences.
    """
    full = cutting.nose_radius * (1.0 - math.cos(min(cutting.approach_angle, 0.5 * math.pi)))
    depth = cutting.depth_of_cut
    require(depth + _CHANGE < full, "depth_of_cut", f"below the height of the nose ({full:g} m)", depth)
    now = _thrust(cutting, _CHANGE, 0.0) - _thrust(cutting, -_CHANGE, 0.0)
    before = _thrust(cutting, 0.0, -_CHANGE) - _thrust(cutting, 0.0, _CHANGE)
    return now / (2.0 * _CHANGE), before / now


def _thrust(cutting: Cutting, now: float, before: float) -> float:
    """Return the radial force of a tool for its depth and that of the pass before it (m)."""
    r, a, f = cutting.nose_radius, cutting.depth_of_cut, cutting.feed_per_rev / 2.0

    def tool(z: np.ndarray | float) -> np.ndarray:
        return r - now - np.sqrt(r * r - np.square(z))

    def left(z: np.ndarray | float) -> np.ndarray:
        return np.minimum(r - before - np.sqrt(r * r - np.square(np.minimum(z + f, end_before))), a)

    end = math.sqrt(r * r - (r - now - a) ** 2)
    end_before = math.sqrt(r * r - (r - before - a) ** 2)
    start = float(brentq(lambda z: float(tool(z) - left(z)), -f, 0.0, xtol=1e-14))  # pyright: ignore[reportArgumentType]
    turn = min(end_before - f, end)
    area = sum(
        float(np.trapezoid(left(z) - tool(z), z))
        for z in (np.linspace(start, turn, _POINTS), np.linspace(turn, end, _POINTS))
    )
    edge = r * (math.asin(end / r) - math.asin(start / r))
    direction = math.atan2(float(tool(end)) - float(tool(start)), end - start)
    return cutting.force_law.forces(Chip(area=area, edge_length=edge, thrust_direction=direction))[0]
