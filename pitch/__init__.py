"""From chatter frequency and spindle speed to the turret offset that puts the two regenerative waves in antiphase."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pitch.advice import advise
    from pitch.belief import ProcessBelief
    from pitch.chart import StabilityChart, stability_chart
    from pitch.choice import PlannerConfig
    from pitch.geometry import (
        ArcPosition,
        TurretOffset,
        arc_position,
        offset_from_slides,
        slide_set_points,
        turret_offset,
    )
    from pitch.growth import stiffness_for_growth
    from pitch.islands import stable_intervals
    from pitch.many_roots import growth_rates
    from pitch.modes import Mode, TurningProcess, process_roots
    from pitch.optimum import optimal_pitch_difference, pitch_difference_for_phase, regenerative_phase
    from pitch.planner import Planner
    from pitch.robust import RobustPitch, Spread, robust_for_lines, robust_for_process
    from pitch.shift_effects import Box, SideEffects, clearance, cusp_height, off_arc, side_effects, wrong_arc
    from pitch.situation import Cause, Decision, Situation
    from pitch.stability import OneModeProcess, StabilityUnresolved, critical_stiffness, rightmost_root, roots
    from pitch.trajectory import ShiftTrajectory, TrajectoryLimits

__all__ = [
    "ArcPosition",
    "Box",
    "Cause",
    "Decision",
    "Mode",
    "OneModeProcess",
    "Planner",
    "PlannerConfig",
    "ProcessBelief",
    "RobustPitch",
    "ShiftTrajectory",
    "SideEffects",
    "Situation",
    "Spread",
    "StabilityChart",
    "StabilityUnresolved",
    "TrajectoryLimits",
    "TurningProcess",
    "TurretOffset",
    "advise",
    "arc_position",
    "clearance",
    "critical_stiffness",
    "cusp_height",
    "growth_rates",
    "off_arc",
    "offset_from_slides",
    "optimal_pitch_difference",
    "pitch_difference_for_phase",
    "process_roots",
    "regenerative_phase",
    "rightmost_root",
    "robust_for_lines",
    "robust_for_process",
    "roots",
    "side_effects",
    "slide_set_points",
    "stability_chart",
    "stable_intervals",
    "stiffness_for_growth",
    "turret_offset",
    "wrong_arc",
]

_HOME = {
    "advice": ("advise",),
    "belief": ("ProcessBelief",),
    "chart": ("StabilityChart", "stability_chart"),
    "choice": ("PlannerConfig",),
    "geometry": (
        "ArcPosition", "TurretOffset", "arc_position", "offset_from_slides", "slide_set_points", "turret_offset",
    ),
    "growth": ("stiffness_for_growth",),
    "islands": ("stable_intervals",),
    "many_roots": ("growth_rates",),
    "modes": ("Mode", "TurningProcess", "process_roots"),
    "optimum": ("optimal_pitch_difference", "pitch_difference_for_phase", "regenerative_phase"),
    "planner": ("Planner",),
    "robust": ("RobustPitch", "Spread", "robust_for_lines", "robust_for_process"),
    "shift_effects": ("Box", "SideEffects", "clearance", "cusp_height", "off_arc", "side_effects", "wrong_arc"),
    "situation": ("Cause", "Decision", "Situation"),
    "stability": ("OneModeProcess", "StabilityUnresolved", "critical_stiffness", "rightmost_root", "roots"),
    "trajectory": ("ShiftTrajectory", "TrajectoryLimits"),
}  # fmt: skip


def __getattr__(name: str) -> Any:
    for module, names in _HOME.items():
        if name in names:
            return getattr(import_module(f"pitch.{module}"), name)
    raise AttributeError(f"module 'pitch' has no attribute {name!r}")


def __dir__() -> list[str]:
    return __all__
