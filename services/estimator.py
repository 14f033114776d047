"""The estimator of the cutting force that a case names, for the two slides of turret 1."""

from __future__ import annotations

from typing import Any

import numpy as np

from services.config import Case
from services.messages import Floats


def force_observer(case: Case) -> Any:
    """Return the estimator of a case; it knows the belief about the drives and how their loops are tuned.

    Parameters
    ----------
    case
        The case.
    """
    from chatter.observers.stage_model import NominalControl
    from chatter.observers.turret import turret_observer

    names = ("position_gain", "velocity_gain", "disturbance_bandwidth", "derivative_bandwidth")
    loops = [
        NominalControl(**{name: getattr(axis, name) for name in names})
        for axis in (case.drives.x1_control, case.drives.y1_control)
    ]
    settings = case.settings
    return turret_observer(
        settings.force_estimator, case.belief, settings.sample_rate_hz, cutoff_hz=settings.force_cutoff_hz,
        band_hz=case.monitor.band_hz, controls=(loops[0], loops[1]), spindle_hz=case.cutting.spindle_hz,
    )  # fmt: skip


def estimated_force(observer: Any, signals: Any, motor: Floats, stage: Floats) -> Floats:
    """Return the force on the tool of a block (N), shape (n, 2).

    Parameters
    ----------
    observer
        From `force_observer`.
    signals
        Both thrusts (N), each shape (n,).
    motor, stage
        Positions (m), shape (n, 2).
    """
    if not observer.needs_thrust:
        return observer.update(motor, stage)
    thrust = np.empty(motor.shape)
    thrust[:, 0], thrust[:, 1] = signals
    return observer.update(motor, stage, thrust)
