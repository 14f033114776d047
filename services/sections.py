"""The tables of a case file: which object each becomes, and in which unit each key is written."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from services.case_settings import CaseSettings
from services.errors import InputError
from services.toml_section import Section, read_section

DRIVE_UNITS = {
    "lead": "mm",
    "motor_inertia": "kg_m2",
    "motor_damping": "n_m_s_per_rad",
    "stage_mass": "kg",
    "stage_damping": "n_s_per_m",
    "drive_stiffness": "n_per_m",
    "drive_damping": "n_s_per_m",
    "current_bandwidth": "rad_per_s",
    "thrust_delay": "ms",
    "motor_delay": "ms",
    "stage_delay": "ms",
    "motor_resolution": "nm",
    "stage_resolution": "nm",
    "scale_noise": "nm",
    "motor_friction": "n",
    "presliding_stiffness": "n_per_m",
}
_BELIEF = {
    "lead": "mm",
    "rotor_inertia": "kg_m2",
    "rotor_damping": "n_m_s_per_rad",
    "stage_mass": "kg",
    "stage_damping": "n_s_per_m",
    "screw_stiffness": "n_per_m",
    "screw_damping": "n_s_per_m",
    "motor_resolution": "nm",
    "stage_resolution": "nm",
    "motor_delay": "ms",
    "stage_delay": "ms",
    "thrust_delay": "ms",
    "omega_current": "rad_per_s",
    "motor_period": "um",
    "stage_period": "um",
}
CONTROL_UNITS = {
    "position_gain": "1_per_s",
    "velocity_gain": "1_per_s",
    "disturbance_bandwidth": "rad_per_s",
    "derivative_bandwidth": "rad_per_s",
}
_LIMITS = {
    "axis_angle": "deg",
    "shift": "deg",
    **dict.fromkeys(("dx", "dy", "x1", "y1"), "mm"),
    "shift_speed": "deg_per_s",
    "slide_speed": "mm_per_s",
    "shift_acceleration": "deg_per_s2",
    "slide_acceleration": "m_per_s2",
    "shift_jerk": "deg_per_s3",
    "slide_jerk": "m_per_s3",
    "interval": "ms",
    **dict.fromkeys(("shift_step", "shift_travel", "shift_following", "path_shift"), "deg"),
    **dict.fromkeys(("slide_step", "slide_travel", "slide_following", "path_slide"), "mm"),
    "target": "deg",
    "target_step": "deg",
    "dwell": "s",
    "command_age": "ms",
    "command_lead": "ms",
    "return_speed": "deg_per_s",
    "spindle_hz_min": "rpm",
    "spindle_hz_max": "rpm",
    "spindle_change": "percent",
    "spindle_settle": "s",
    "loss_hold": "ms",
    "loss_return": "s",
    "loss_fault": "s",
}


_CASE = {"start_position": "mm", "air_time": "s", "cut_time": "s", "threshold": "percent"}
_CHUCK = {"lateral_stiffness": "n_per_m", "tilt_stiffness": "n_m_per_rad", "tilt_damping": "n_m_s_per_rad"}
_WORKPIECE = {
    **dict.fromkeys(("diameter", "length", "turned_diameter", "turned_length", "finished_diameter"), "mm"),
    "young_modulus": "gpa",
    "density": "kg_per_m3",
}
_FORCE_LAW = {"thrust_coefficient": "gpa", "tangential_coefficient": "gpa"}
_CUTTING = {
    "spindle_hz": "rpm",
    **dict.fromkeys(("feed_per_rev", "depth_of_cut", "nose_radius"), "mm"),
    "cutting_stiffness": "n_per_m",
    "process_damping": "n_s_per_m",
    "approach_angle": "deg",
    "flank_clearance": "deg",
    "rake_gain": "percent_per_deg",
    "setting_difference": "um",
    "force_noise": "n_per_rthz",
}
_PATH = {"max_speed": "deg_per_s", "max_acceleration": "deg_per_s2", "max_jerk": "deg_per_s3"}
_MONITOR = {
    "block": "ms",
    "window": "ms",
    **dict.fromkeys(("refine_window", "air_time", "cutting_time", "memory_time", "false_alarm_interval"), "s"),
    "expected_limit": "n",
    "speed_uncertainty": "percent",
}
_PLANNER = {
    "target_phase": "pi",
    "fallback_phases": "pi",
    **dict.fromkeys(("min_shift", "max_shift", "arrival_tolerance", "reaim_threshold"), "deg"),
    **dict.fromkeys(("x1_travel", "y1_travel"), "mm"),
    **dict.fromkeys(("dwell", "settle_time", "persist_time", "arrive_time", "calm_time"), "s"),
}
_FORESIGHT = {
    "modal_mass": "kg",
    "cutting_stiffness": "n_per_m",
    "process_damping": "n_s_per_m",
    **dict.fromkeys(("frequency_error", "stiffness_error", "damping_error", "overlap_error"), "percent"),
}
_ROOM: dict[str, str] = dict.fromkeys(("turret1_envelope", "turret2_envelope", "least_clearance"), "mm")
_OPTIONAL = "belief.process"
_COMMON = ("sample_rate_hz", "axis_angle")
_SPEEDS = {"spindle_hz_min": "spindle_speed_min", "spindle_hz_max": "spindle_speed_max"}


def known_sections() -> dict[str, Section]:
    """Return the tables that become one object each; the packages are imported late, so that `--help` stays quick."""
    return {"case": Section(kind=CaseSettings, units=_CASE), **_plant(), **_turret(), **_decision()}


def _plant() -> dict[str, Section]:
    from turning_sim import Chuck, Cutting, ForceLaw, ProcessModel, Workpiece

    speed = {"spindle_hz": "spindle_speed"}
    return {
        "chuck": Section(kind=Chuck, units=_CHUCK),
        "workpiece": Section(kind=Workpiece, units=_WORKPIECE, given=("chuck",)),
        "process": Section(kind=ProcessModel, units={"cell": "um"}),
        "force_law": Section(kind=ForceLaw, units=_FORCE_LAW),
        "cutting": Section(kind=Cutting, units=_CUTTING, given=("force_law",), renamed=speed),
    }


def _turret() -> dict[str, Section]:
    from turning_sim import AxisControl, FeedDrive, TurretDrives

    parts = ("x1", "y1", "x1_control", "y1_control")
    return {
        "drive.x1": Section(kind=FeedDrive, units=DRIVE_UNITS),
        "drive.y1": Section(kind=FeedDrive, units=DRIVE_UNITS),
        "control.x1": Section(kind=AxisControl, units=CONTROL_UNITS),
        "control.y1": Section(kind=AxisControl, units=CONTROL_UNITS),
        "turret": Section(kind=TurretDrives, units={"upper_mass": "kg", "axis_angle": "deg"}, given=parts),
    }


def _decision() -> dict[str, Section]:
    from chatter import MonitorConfig, NominalFeedDrive, NominalTurret
    from pitch import PlannerConfig, ProcessBelief, TrajectoryLimits
    from services.guard_limits import GuardLimits
    from services.job import Job, Room
    from services.learned import UNITS, Learned

    return {
        "job": Section(kind=Job, units={}, renamed={"pass_kind": "pass"}),
        "clearance": Section(kind=Room, units=_ROOM),
        "learned": Section(kind=Learned, units=UNITS),
        "limits": Section(kind=GuardLimits, units=_LIMITS, given=_COMMON, renamed=_SPEEDS),
        "path": Section(kind=TrajectoryLimits, units=_PATH),
        "monitor": Section(kind=MonitorConfig, units=_MONITOR),
        "belief.x1": Section(kind=NominalFeedDrive, units=_BELIEF),
        "belief.y1": Section(kind=NominalFeedDrive, units=_BELIEF),
        _OPTIONAL: Section(kind=ProcessBelief, units=_FORESIGHT),
        "belief": Section(kind=NominalTurret, units={"upper_mass": "kg"}, given=("x1", "y1", "axis_angle")),
        "planner": Section(kind=PlannerConfig, units=_PLANNER, given=_COMMON),
    }


def build(tables: Mapping[str, Any]) -> dict[str, Any]:
    """Return the objects of a case from its tables.

    Raises
    ------
    InputError
        For a table that is missing or not known, and for every key that breaks a rule.
    """
    sections = known_sections()
    _only_known(tables, sections)

    def part(name: str, **given: Any) -> Any:
        return read_section(_table(tables, name, sections), name, sections[name], **given)

    settings: CaseSettings = part("case")
    drives = part(
        "turret", x1=part("drive.x1"), y1=part("drive.y1"), x1_control=part("control.x1"),
        y1_control=part("control.y1"),
    )  # fmt: skip
    common = {"sample_rate_hz": settings.sample_rate_hz, "axis_angle": drives.axis_angle}
    parts: dict[str, Any] = {
        "settings": settings,
        "workpiece": part("workpiece", chuck=part("chuck")),
        "cutting": part("cutting", force_law=part("force_law")),
        "process": part("process"),
        "drives": drives,
        "limits": part("limits", **common),
        "path": part("path"),
        "monitor": part("monitor"),
        "belief": part("belief", x1=part("belief.x1"), y1=part("belief.y1"), axis_angle=drives.axis_angle),
        "planner": part("planner", **common),
        "foresight": part(_OPTIONAL) if "process" in tables["belief"] else None,
        "job": part("job") if "job" in tables else None,
        "learned": part("learned") if "learned" in tables else None,
        "room": part("clearance") if "clearance" in tables else None,
    }
    _agree(parts)
    return parts


def _agree(parts: Mapping[str, Any]) -> None:
    """Say which of two tables contradicts the other, before anything is started."""
    limits, planner, path, rate_hz = parts["limits"], parts["planner"], parts["path"], parts["settings"].sample_rate_hz
    rules = (
        ("monitor.band_hz", parts["monitor"].band_hz[1], 0.5 * rate_hz, "case.sample_rate_hz / 2", 1.0, False),
        ("planner.max_shift_deg", planner.max_shift, limits.target, "limits.target_deg", 180.0 / math.pi, True),
        ("planner.min_shift_deg", -planner.min_shift, limits.target, "limits.target_deg", 180.0 / math.pi, True),
        *(
            (f"planner.{axis}_travel_mm", max(abs(end) for end in getattr(planner, f"{axis}_travel")),
             getattr(limits, axis), f"limits.{axis}_mm", 1e3, True)
            for axis in ("x1", "y1")
        ),
        ("limits.dwell_s", limits.dwell, planner.dwell, "planner.dwell_s", 1.0, True),
        ("path.max_speed_deg_per_s", path.max_speed, limits.shift_speed, "limits.shift_speed_deg_per_s",
         180.0 / math.pi, True),
    )  # fmt: skip
    for key, value, most, other, unit, equal in rules:
        if value > most * (1.0 + 1e-9) or (value == most and not equal):
            word = "at most" if equal else "below"
            raise InputError(key, value * unit, f"{word} {other} ({most * unit:g})")
    room, diameter = parts["room"], parts["workpiece"].cutting_diameter
    if room is not None:
        near = min(room.clearance(sign * limits.target, diameter) for sign in (-1.0, 1.0))
        if near < room.least_clearance:
            least = f"clearance.least_clearance_mm ({1e3 * room.least_clearance:g})"
            rule = f"so small that {least} remains between the turrets, not {1e3 * near:.3g}"
            raise InputError("limits.target_deg", math.degrees(limits.target), rule)


def _table(tables: Mapping[str, Any], name: str, sections: Mapping[str, Section]) -> dict[str, Any]:
    """Return the keys of `[name]`, without the tables below it."""
    found: Any = tables
    for word in name.split("."):
        found = found.get(word) if isinstance(found, Mapping) else None
    if not isinstance(found, Mapping):
        raise InputError(name, None, f"given as a table [{name}]")
    below = {known.split(".")[1] for known in sections if known.startswith(name + ".")}
    return {key: value for key, value in found.items() if key not in below}


def _only_known(tables: Mapping[str, Any], sections: Mapping[str, Section]) -> None:
    known = {name.split(".")[0] for name in sections}
    for name in tables:
        if name not in known:
            raise InputError(name, str(tables[name])[:60], f"one of the tables {', '.join(sorted(known))}")
