"""What a shift of turret 1 leaves on the part and how near it brings the turrets: geometry, and one spring.

Tool 1 at the angle h from its place is (pi + h)/(2 pi) of a turn behind tool 2 one way and (pi - h)/(2 pi) the other:
two tools set alike then leave feed marks of two widths and take chips of two thicknesses. The difference of their
forces bends the bar; a wrong diameter turns the arc into another one.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from pitch._checks import finite, positive, within
from pitch.geometry import TurretOffset, arc_position, turret_offset

PLACES = 65


class Box(NamedTuple):
    """What a turret fills: lowest and highest X1, lowest and highest Y1' (m), about the axis of the spindle."""

    x_low: float
    x_high: float
    y_low: float
    y_high: float


@dataclass(frozen=True, slots=True, kw_only=True)
class SideEffects:
    """What a shift leaves behind.

    Attributes
    ----------
    mark_widths : tuple of float
        Feed that tool 1 and tool 2 take (m); half the feed each without a shift.
    mark_heights : tuple of float
        Of the cusps that a round nose leaves at these widths (m); the higher one stays on the part.
    extra_height : float
        How much the higher cusp rises above that of equal pitch (m).
    step : float
        By how much tool 1 stands off its depth because of the diameter, the path and the bar (m), at most.
    diameter_error : float
        Of the part behind the shift against before it (m), at most.
    roundness_error : float
        In the turns in which the turret moves (m), at most: the step is then part of a turn.
    move_turns : float
        Turns of the spindle that the move takes.
    rake_change : float
        By how much the rake of tool 1 turns (rad); negative is towards a more negative rake.
    """

    mark_widths: tuple[float, float]
    mark_heights: tuple[float, float]
    extra_height: float
    step: float
    diameter_error: float
    roundness_error: float
    move_turns: float
    rake_change: float


def side_effects(
    shift: float,
    diameter: float,
    feed_per_rev: float,
    nose_radius: float,
    *,
    diameter_error: float = 0.0,
    path_error: float = 0.0,
    thrust: float = 0.0,
    thrust_exponent: float = 1.0,
    bar_stiffness: float = math.inf,
    move_turns: float = 0.0,
) -> SideEffects:
    """Return what a shift leaves behind.

    Parameters
    ----------
    shift : float
        Of turret 1 (rad).
    diameter : float
        At the cutting point (m).
    feed_per_rev, nose_radius : float
        (m)
    diameter_error : float
        By how much the diameter may be another than believed (m), either way.
    path_error : float
        How far the slides may be off the arc (m).
    thrust : float
        Radial force of one tool at equal pitch (N).
    thrust_exponent : float
        Power of the feed of a tool with which its thrust grows.
    bar_stiffness : float
        Of the bar at the tools (N/m).
    move_turns : float
        Turns of the spindle that the move takes.

    Returns
    -------
    SideEffects
        Lengths in m.
    """
    h = within("shift", shift, -math.pi / 4, math.pi / 4)
    feed, nose = positive("feed_per_rev", feed_per_rev), positive("nose_radius", nose_radius)
    d, off = positive("diameter", diameter), abs(finite("diameter_error", diameter_error))
    if off >= d:
        raise ValueError(f"diameter_error must be below the diameter ({d}), got {off}")
    widths = feed * (math.pi + h) / (2 * math.pi), feed * (math.pi - h) / (2 * math.pi)
    heights = cusp_height(widths[0], nose), cusp_height(widths[1], nose)
    arc = max(abs(wrong_arc(h, d + sign * off, d)) for sign in (-1, 1))
    pushed = [finite("thrust", thrust) * (2 * width / feed) ** thrust_exponent for width in widths]
    bend = abs(pushed[0] * math.cos(h) - pushed[1]) / bar_stiffness
    step = arc + abs(finite("path_error", path_error)) * (h != 0.0) + bend
    return SideEffects(
        mark_widths=widths,
        mark_heights=heights,
        extra_height=max(heights) - cusp_height(feed / 2, nose),
        step=step,
        diameter_error=2 * step,
        roundness_error=step,
        move_turns=finite("move_turns", move_turns),
        rake_change=-abs(h),
    )


def cusp_height(width: float, nose_radius: float) -> float:
    """Return the height that a round nose leaves between two marks (m).

    Parameters
    ----------
    width : float
        From mark to mark (m).
    nose_radius : float
        (m)
    """
    half = within("width", width, 0.0, 2 * positive("nose_radius", nose_radius)) / 2
    return half**2 / (nose_radius + math.sqrt(nose_radius**2 - half**2))


def wrong_arc(shift: float, believed: float, diameter: float) -> float:
    """Return how far off the bar a tool ends that was moved along the arc of another diameter (m).

    Parameters
    ----------
    shift : float
        (rad)
    believed, diameter : float
        Diameter of the arc, and of the bar (m).
    """
    return float(arc_position(turret_offset(shift, believed), diameter).radial_deviation)


def off_arc(dx1: float, dy1p: float, diameter: float) -> float:
    """Return how far off the arc a displaced tool stands (m); positive is shallower.

    Parameters
    ----------
    dx1, dy1p : float
        Displacement (m).
    diameter : float
        At the cutting point (m).
    """
    return float(arc_position(TurretOffset(dx1, dy1p), diameter).radial_deviation)


def clearance(shift: float, diameter: float, moving: Box, fixed: Box) -> float:
    """Return the least distance between two boxes while one goes along the arc with tool 1 (m); 0 when they touch.

    Parameters
    ----------
    shift : float
        Where it goes (rad).
    diameter : float
        Of the arc (m).
    moving, fixed : Box
        At equal pitch.
    """
    way = turret_offset(np.linspace(0.0, shift, PLACES), diameter)
    gap_x = np.maximum(fixed.x_low - moving.x_high - way.dx1, moving.x_low + way.dx1 - fixed.x_high)
    gap_y = np.maximum(fixed.y_low - moving.y_high - way.dy1p, moving.y_low + way.dy1p - fixed.y_high)
    return float(np.hypot(np.maximum(gap_x, 0.0), np.maximum(gap_y, 0.0)).min())
