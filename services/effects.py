"""What a shift leaves on the part of a case: its geometry and its bar, in the units of a report."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from services.alternatives import alternatives_of
from services.config import Case
from services.errors import InputError, RefusalError
from services.messages import ADVICE, BLOCK_S
from services.record import RunRecord

KEYS = (
    "shift_deg", "mark_widths_um", "mark_heights_um", "extra_height_um", "step_um", "diameter_error_um",
    "roundness_error_um", "move_turns", "rake_deg", "clearance_mm",
)  # fmt: skip


def effects_of(case: Case, shift: float) -> dict[str, Any]:
    """Return what a shift leaves behind.

    The diameter is taken to be wrong by two depths of cut: the arc of the bar before the cut for the one behind it. The
    path may be off the arc by what the guard lets through.

    Parameters
    ----------
    case
        The case.
    shift
        Of turret 1 (rad).
    """
    from pitch import ShiftTrajectory, side_effects

    cutting, diameter = case.cutting, case.workpiece.cutting_diameter
    path = ShiftTrajectory(case.path, case.settings.sample_rate_hz)
    path.retarget(shift)
    turns = path.samples_to_rest / case.settings.sample_rate_hz * cutting.spindle_hz
    found = side_effects(
        shift, diameter, cutting.feed_per_rev, cutting.nose_radius,
        diameter_error=2.0 * cutting.depth_of_cut, path_error=case.limits.path_slide, thrust=cutting.steady_forces[0],
        thrust_exponent=1.0 - cutting.force_law.thrust_exponent, bar_stiffness=bar_stiffness(case), move_turns=turns,
    )  # fmt: skip
    return {
        "shift_deg": math.degrees(shift),
        "mark_widths_um": [1e6 * width for width in found.mark_widths],
        "mark_heights_um": [1e6 * height for height in found.mark_heights],
        "extra_height_um": 1e6 * found.extra_height,
        "step_um": 1e6 * found.step,
        "diameter_error_um": 1e6 * found.diameter_error,
        "roundness_error_um": 1e6 * found.roundness_error,
        "move_turns": found.move_turns,
        "rake_deg": math.degrees(found.rake_change),
        "clearance_mm": None if case.room is None else 1e3 * case.room.clearance(shift, diameter),
    }  # fmt: skip


def bar_stiffness(case: Case) -> float:
    """Return the stiffness of the bar at the tools where they enter (N/m), as believed or else as configured."""
    belief = case.foresight
    if belief is not None:
        return belief.modal_mass * (2.0 * math.pi * belief.natural_frequency_hz) ** 2
    modes = case.workpiece.modes(case.settings.start_position)
    give = sum(m.shape**2 / (m.modal_mass * (2.0 * math.pi * m.natural_frequency_hz) ** 2) for m in modes)
    return 1.0 / give


def effect_rows(effects: dict[str, Any]) -> tuple[tuple[str, str, str], ...]:
    """Return label, value and meaning of each side effect, for people."""
    one, two = effects["mark_widths_um"]
    rows = [
        ("Feed marks", f"{one:.1f} and {two:.1f} µm", "tool 1 and tool 2 no longer share the feed in halves"),
        ("Height of the marks", f"{max(effects['mark_heights_um']):.2f} µm",
         f"of an ideal round nose; {effects['extra_height_um']:.2f} µm above equal pitch"),
        ("Step", f"≤ {effects['step_um']:.1f} µm", "radial: a wrong diameter, a path off the arc, the bar that bends"),
        ("Diameter", f"≤ {effects['diameter_error_um']:.1f} µm", "behind the shift against before it"),
        ("Roundness", f"≤ {effects['roundness_error_um']:.1f} µm",
         f"in the {effects['move_turns']:.1f} turns of the spindle while turret 1 moves, not behind them"),
        ("Rake of tool 1", f"{effects['rake_deg']:+.2f}°".replace("-", "−"), "turned by the shift"),
    ]  # fmt: skip
    room = effects["clearance_mm"]
    if room is None:
        rows.append(("Clearance of turret 2", "not stated", "the case has no table [clearance]"))
    else:
        rows.append(("Clearance of turret 2", f"{room:.2f} mm", "least distance of the turrets on the way"))
    return tuple(rows)


def with_advice(case: Case, record: RunRecord) -> RunRecord:
    """Return the record with what its shift leaves on the part and what else could be done."""
    shift_deg = shift_of(record)
    effects = () if shift_deg is None else effect_rows(effects_of(case, math.radians(shift_deg)))
    if shift_deg is not None:
        effects = (*effects, *_realised(record))
    try:
        other = alternatives_of(case).sentences()
    except (InputError, RefusalError, ArithmeticError) as error:
        other = (f"What else could be done is not known: {error}",)
    return replace(record, effects=effects, alternatives=other)


def _realised(record: RunRecord) -> tuple[tuple[str, str, str], ...]:
    """Return how far off its arc tool 1 was, in means over blocks: at most on the way, and at the end."""
    from pitch import TurretOffset, arc_position

    block = round(BLOCK_S * record.sample_rate_hz)
    known = np.isfinite(record.controlled.dx1_um) & np.isfinite(record.controlled.dy1p_um)
    whole = np.count_nonzero(known) // block * block
    if not whole or not np.isfinite(record.reports.shift_requested_deg).any():
        return ()
    dx1, dy1p = (
        1e-6 * series[known][:whole].reshape(-1, block).mean(axis=1)
        for series in (record.controlled.dx1_um, record.controlled.dy1p_um)
    )
    off_um = 1e6 * arc_position(TurretOffset(dx1, dy1p), 1e-3 * record.diameter_mm).radial_deviation
    worst, last = (round(float(off), 2) + 0.0 for off in (off_um[np.argmax(np.abs(off_um))], off_um[-1]))
    meaning = "tool 1 off its arc in this run, at most and at the end; positive is shallower"
    return (("Step, as the slides went", f"{worst:+.2f} and {last:+.2f} µm".replace("-", "−"), meaning),)


def shift_of(record: RunRecord) -> float | None:
    """Return the widest shift that was commanded or, by a controller that only advises, named (deg)."""
    commanded = record.reports.shift_requested_deg
    named = [event.shift_deg for event in record.events if event.kind == ADVICE and event.shift_deg is not None]
    every = [*commanded[np.isfinite(commanded) & (commanded != 0.0)].tolist(), *named]
    return max(every, key=abs, default=None)
