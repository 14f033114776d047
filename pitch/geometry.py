"""Shift of tool 1 round the bar and what the slides of turret 1 do for it, in both directions.

Frame: +X1 from tool 1 towards the spindle axis, +Y1' along the surface motion at tool 1. Without shift the tip of
tool 1 stands at X1 = -d/2, Y1' = 0. The slides X1 and Y1 enclose `axis_angle` (45 deg on the machine of the thesis).
"""

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from pitch._checks import finite, finite_array, positive

AXIS_ANGLE = math.pi / 4


class ArcPosition(NamedTuple):
    """Where a tool stands on the arc: `shift` (rad) and `radial_deviation` (m, positive: off the bar, shallower)."""

    shift: Any
    radial_deviation: Any


@dataclass(frozen=True, slots=True)
class TurretOffset:
    """Displacement of tool 1 from its place at equal pitch.

    Attributes
    ----------
    dx1 : float or ndarray
        Along X1, towards the spindle axis (m).
    dy1p : float or ndarray
        Along Y1', with the surface motion (m).
    """

    dx1: Any
    dy1p: Any

    def slides(self, axis_angle: float = AXIS_ANGLE) -> tuple[Any, Any]:
        """Travel of the two slides whose axes enclose an angle other than 90 deg.

        The Y1 slide alone makes the motion along Y1'; X1 takes back what Y1 carries along X1.

        Parameters
        ----------
        axis_angle : float
            Angle between X1 and Y1 (rad).

        Returns
        -------
        x1, y1 : float or ndarray
            Slide travel (m).
        """
        sine, cosine = _sine_cosine(axis_angle)
        y1 = self.dy1p / sine
        return self.dx1 - y1 * cosine, y1


def turret_offset(shift: Any, diameter: Any) -> TurretOffset:
    """Offset that moves tool 1 along the arc by half the pitch difference, so that the depth of cut stays.

    Yamada, PhD thesis, Keio University, 2017, Fig. 6-15 and Table 6-4.

    Parameters
    ----------
    shift : float or ndarray
        Angle round the bar (rad), in (-pi/2, pi/2); positive with the surface motion.
    diameter : float
        Diameter at the cutting point (m).

    Returns
    -------
    TurretOffset
        Floats for a scalar shift, otherwise arrays of its shape.
    """
    radius = positive("diameter", diameter) / 2
    angle = finite_array("shift", shift)
    if np.abs(angle).max(initial=0.0) >= math.pi / 2:
        raise ValueError(f"shift must be in (-pi/2, pi/2) rad, got {shift!r}")
    dx1 = 2 * radius * np.sin(angle / 2) ** 2
    dy1p = radius * np.sin(angle)
    return TurretOffset(_plain(dx1), _plain(dy1p))


def offset_from_slides(x1: Any, y1: Any, axis_angle: float = AXIS_ANGLE) -> TurretOffset:
    """Displacement of tool 1 from the travel of its slides; the inverse of `TurretOffset.slides`.

    Parameters
    ----------
    x1, y1 : float or ndarray
        Slide travel (m).
    axis_angle : float
        Angle between X1 and Y1 (rad).

    Returns
    -------
    TurretOffset
        Floats or arrays like the input.
    """
    sine, cosine = _sine_cosine(axis_angle)
    along_x, along_y = finite_array("x1", x1), finite_array("y1", y1)
    return TurretOffset(_plain(along_x + along_y * cosine), _plain(along_y * sine))


def arc_position(offset: TurretOffset, diameter: Any) -> ArcPosition:
    """Shift round the bar and distance from the arc of a displaced tool; the inverse of `turret_offset`.

    Parameters
    ----------
    offset : TurretOffset
        Displacement of tool 1 (m).
    diameter : float
        Diameter at the cutting point (m).

    Returns
    -------
    ArcPosition
        `shift` (rad) and `radial_deviation` (m).
    """
    radius = positive("diameter", diameter) / 2
    dx1, dy1p = finite_array("dx1", offset.dx1), finite_array("dy1p", offset.dy1p)
    distance = np.hypot(radius - dx1, dy1p)
    # distance - radius, written so that nothing cancels: the deviations of interest are 1e-6 of the radius
    deviation = (dx1 * (dx1 - 2 * radius) + dy1p**2) / (distance + radius)
    return ArcPosition(_plain(np.arctan2(dy1p, radius - dx1)), _plain(deviation))


def slide_set_points(shift: Any, diameter: Any, axis_angle: float = AXIS_ANGLE) -> tuple[Any, Any]:
    """Slide positions for each point of a path along the arc, relative to equal pitch.

    Parameters
    ----------
    shift : float or ndarray
        Path of the shift (rad), shape (n,).
    diameter : float
        Diameter at the cutting point (m).
    axis_angle : float
        Angle between X1 and Y1 (rad).

    Returns
    -------
    x1, y1 : float or ndarray
        Set points of the slides (m), shape (n,).
    """
    return turret_offset(shift, diameter).slides(axis_angle)


def _sine_cosine(axis_angle: float) -> tuple[float, float]:
    angle = finite("axis_angle", axis_angle)
    if not 0.0 < angle < math.pi:
        raise ValueError(f"axis_angle must be in (0, pi) rad, got {angle}")
    return math.sin(angle), math.cos(angle)


def _plain(value: Any) -> Any:
    return float(value) if np.ndim(value) == 0 else value
