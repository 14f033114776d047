"""Chip of a round-nosed tool and its steady forces."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from turning_sim._check import require

LEANS_MOST = math.radians(120.0)
"""Beyond, no cutting edge leans."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Chip:
    """Cross-section of the steady cut.

    Attributes
    ----------
    area : float
        (m2)
    edge_length : float
        Engaged edge (m).
    thrust_direction : float
        Angle of the thrust from the radial direction, that of the normal to the chord of the engaged edge (rad).
    """

    area: float
    edge_length: float
    thrust_direction: float

    @property
    def mean_thickness(self) -> float:
        """Area over edge length (m)."""
        return self.area / self.edge_length


def steady_chip(
    depth_of_cut: float, feed_per_tool: float, nose_radius: float, approach_angle: float = math.radians(95.0)
) -> Chip:
    """Return the chip that a tool removes in the steady cut.

    The edge is an arc about the nose centre that goes over into a straight flank, which leans over the cut beyond
    90 deg; it reaches back to where the previous pass, `feed_per_tool` behind, has left its cusp.

    Parameters
    ----------
    depth_of_cut, feed_per_tool, nose_radius : float
        (m)
    approach_angle : float
        Between flank and feed direction (rad), below 120 deg.

    Returns
    -------
    Chip
        Area, engaged edge and direction of the thrust.
    """
    require(depth_of_cut > 0.0, "depth_of_cut", "positive", depth_of_cut)
    require(nose_radius > 0.0, "nose_radius", "positive", nose_radius)
    require(0.0 < approach_angle < LEANS_MOST, "approach_angle", "in (0, 120 deg)", approach_angle)
    require(0.0 < feed_per_tool < 2.0 * nose_radius, "feed_per_tool", "in (0, two nose radii)", feed_per_tool)
    r, a = nose_radius, depth_of_cut
    start = math.asin(feed_per_tool / (2.0 * r))
    full = r * (1.0 - math.cos(approach_angle))
    end = math.acos(1.0 - a / r) if a < full else approach_angle
    straight = max(a - full, 0.0) / math.sin(approach_angle)
    edge = r * (start + end) + straight
    last = np.array([r * math.sin(end) + straight * math.cos(approach_angle), a])
    first = np.array([-r * math.sin(start), r * (1.0 - math.cos(start))])
    chord = last - first
    cusp = _cusp_area(feed_per_tool, r)
    return Chip(area=a * feed_per_tool - cusp, edge_length=edge, thrust_direction=float(math.atan2(chord[1], chord[0])))


def _cusp_area(feed: float, r: float) -> float:
    """Return the area that stays behind between two neighbouring arcs (m2)."""
    half = feed / 2.0
    return r * feed - (half * math.sqrt(r * r - half * half) + r * r * math.asin(half / r))


@dataclass(frozen=True, slots=True, kw_only=True)
class ForceLaw:
    """Mean pressure on the chip, falling with its thickness.

    Attributes
    ----------
    thrust_coefficient, tangential_coefficient : float
        (Pa)
    thrust_exponent, tangential_exponent : float
        Exponents of the mean thickness over 33 um, with the sign turned.
    """

    thrust_coefficient: float = 3.19e9
    tangential_coefficient: float = 3.8e9
    thrust_exponent: float = 0.3
    tangential_exponent: float = 0.25

    def __post_init__(self) -> None:
        require(self.thrust_coefficient > 0.0, "thrust_coefficient", "positive", self.thrust_coefficient)
        require(self.tangential_coefficient > 0.0, "tangential_coefficient", "positive", self.tangential_coefficient)

    def forces(self, chip: Chip) -> tuple[float, float]:
        """Return the radial and the tangential force of the steady cut (N)."""
        ratio = chip.mean_thickness / 33e-6
        radial = self.thrust_coefficient * chip.area * ratio**-self.thrust_exponent * math.cos(chip.thrust_direction)
        return radial, self.tangential_coefficient * chip.area * ratio**-self.tangential_exponent
