"""What leaves the plant, block by block."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, slots=True, kw_only=True)
class PlantBlock:
    """What happened in `n` servo samples; every array has shape (n,).

    Attributes
    ----------
    first_sample : int
        Index of the first sample.
    sample_rate_hz : float
        (Hz)
    x1_thrust, y1_thrust : ndarray
        Commanded thrust (N).
    x1_motor_position, y1_motor_position, x1_stage_position, y1_stage_position : ndarray
        Encoders (m).
    dx1, dy1p, shift : ndarray
        Offset of tool 1 (m) and shift (rad) from the linear scales.
    bar_displacement : ndarray
        Bar at the tools along +X1 (m). Truth, as all that follow.
    bar_displacement_y : ndarray
        Bar at the tools along +Y1' (m); 0 with one direction.
    vibration : ndarray
        Bar relative to tool 1 along +X1 (m).
    force_x1, force_y1p : ndarray
        Force on tool 1, out along -X1 and along +Y1' (N).
    force_x2 : ndarray
        Radial force on tool 2 (N).
    contact1, contact2, in_cut : ndarray
        Whether the tools cut.
    spindle_angle : ndarray
        (rad), not wrapped.
    tool_position : ndarray
        Distance of the tools from the tip (m).
    left1, left2 : ndarray
        Depth that each tool left on the surface, deeper positive (m).
    phase1, phase2 : ndarray
        Material phase under each tool (rad), not wrapped.
    """

    first_sample: int
    sample_rate_hz: float
    x1_thrust: np.ndarray
    x1_motor_position: np.ndarray
    x1_stage_position: np.ndarray
    y1_thrust: np.ndarray
    y1_motor_position: np.ndarray
    y1_stage_position: np.ndarray
    dx1: np.ndarray
    dy1p: np.ndarray
    shift: np.ndarray
    bar_displacement: np.ndarray
    bar_displacement_y: np.ndarray
    vibration: np.ndarray
    force_x1: np.ndarray
    force_y1p: np.ndarray
    force_x2: np.ndarray
    contact1: np.ndarray
    contact2: np.ndarray
    spindle_angle: np.ndarray
    tool_position: np.ndarray
    in_cut: np.ndarray
    left1: np.ndarray
    left2: np.ndarray
    phase1: np.ndarray
    phase2: np.ndarray
