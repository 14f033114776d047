"""Where tool 1 is: slides of the skewed axes, shift round the bar, forces."""

from __future__ import annotations

import math

import numpy as np


def slides_of_shift(shift: float | np.ndarray, diameter: float, axis_angle: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the slide positions (m) that put tool 1 at a shift (rad) round a bar of `diameter` (m).

    Yamada, PhD thesis, Keio University, 2017, section 6.4, as in the frames of the plant: +X1 towards the axis, +Y1'
    along the surface motion, Y1 riding on X1 at `axis_angle` (rad).
    """
    h = np.asarray(shift, dtype=float)
    infeed = diameter / 2.0 * (1.0 - np.cos(h))
    along = diameter / 2.0 * np.sin(h)
    return infeed - along / math.tan(axis_angle), along / math.sin(axis_angle)


def tool_of_slides(x1: np.ndarray, y1: np.ndarray, axis_angle: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the offsets of tool 1 along X1 and Y1' (m) from the slide positions (m)."""
    return x1 + y1 * math.cos(axis_angle), y1 * math.sin(axis_angle)


def shift_of_tool(dx1: np.ndarray, dy1p: np.ndarray, diameter: float) -> np.ndarray:
    """Return the shift (rad) of a tool offset (m)."""
    return np.arctan2(dy1p, diameter / 2.0 - dx1)


def loads_of_force(force_x: float, force_y: float, axis_angle: float) -> tuple[float, float]:
    """Return the loads (N) that oppose X1 and Y1 for a force on tool 1, out along -X1 and along +Y1' (N)."""
    return force_x, force_x * math.cos(axis_angle) - force_y * math.sin(axis_angle)
