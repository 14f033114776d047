"""The pitch difference that stands most: for a case, for several chatter lines, for a band; and how far it carries."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from services.config import Case
from services.errors import InputError, RefusalError

if TYPE_CHECKING:
    from pitch import PlannerConfig, RobustPitch

KEYS = (
    "pitch_difference_deg", "shift_deg", "phase_pi", "dx1_um", "dy1p_um", "slide_x1_um", "slide_y1_um", "order",
    "frequency_hz", "speed_rpm", "worst_growth_1_s", "window_pi", "margin_pi", "margin_deg", "margin_hz", "judged_by",
)  # fmt: skip
PLACES = 3
"""Along the stretch ahead at which a case is judged."""


def parse_lines(text: str) -> list[float]:
    """Return chatter lines (Hz) from `F1,F2,..`."""
    try:
        lines = [float(part) for part in text.split(",")]
    except ValueError as error:
        raise InputError("lines", text, "chatter frequencies in Hz with commas between them") from error
    if not all(math.isfinite(line) and 0.0 < line <= 1e5 for line in lines):
        raise InputError("lines", text, "frequencies above 0 and at most 100000 Hz")
    return lines


def parse_band(text: str) -> list[float]:
    """Return the middle and both edges (Hz) of `LO:HI`."""
    try:
        low, high = (float(part) for part in text.split(":"))
    except ValueError as error:
        raise InputError("band", text, "two frequencies in Hz as LO:HI") from error
    if not (math.isfinite(high) and 0.0 < low < high <= 1e5):
        raise InputError("band", text, "rising, above 0 and at most 100000 Hz")
    return [0.5 * (low + high), low, high]


def limits(base: PlannerConfig | None, travel_mm: float | None, shift_deg: float | None, order: int) -> PlannerConfig:
    """Return what turret 1 may do.

    Parameters
    ----------
    base
        Limits of a case, None for 6 mm on both slides and 20 deg.
    travel_mm, shift_deg
        Of each slide either way and of the shift, in their place.
    order
        Most whole turns of phase.
    """
    from pitch import PlannerConfig

    wide = {"x1_travel": (-6e-3, 6e-3), "y1_travel": (-6e-3, 6e-3), "max_shift": math.radians(20.0)}
    config = PlannerConfig(sample_rate_hz=9000.0, **wide) if base is None else base  # pyright: ignore[reportArgumentType]
    if travel_mm is not None:
        reach = 1e-3 * travel_mm
        config = replace(config, x1_travel=(-reach, reach), y1_travel=(-reach, reach), max_shift=math.radians(20.0))
    if shift_deg is not None:
        config = replace(config, max_shift=math.radians(shift_deg))
    return replace(config, order=min(config.order, order), max_order=order)


def case_pitch(
    case: Case, config: PlannerConfig, spindle_hz: float, spread_hz: float, spread_percent: float
) -> RobustPitch:
    """Return the pitch difference for the stretch of bar that a case cuts.

    Parameters
    ----------
    case
        The case.
    config
        What turret 1 may do.
    spindle_hz
        Spindle speed (Hz).
    spread_hz, spread_percent
        Of natural frequency and of cutting stiffness, to either side, that it must stand.
    """
    from pitch import OneModeProcess, Spread, robust_for_process
    from turning_sim import linear_parameters

    start = case.settings.start_position
    length = case.settings.cut_time * case.cutting.feed_per_rev * case.cutting.spindle_hz
    processes: list[OneModeProcess] = []
    for place in np.linspace(start, min(start + length, 0.9 * case.workpiece.length), PLACES).tolist():
        one = linear_parameters(case.workpiece, case.cutting, place)
        processes.append(
            OneModeProcess(
                one.mass_at_tools, one.natural_frequency_hz, one.damping_ratio, one.overlap, one.process_damping
            )
        )
    stands = Spread(frequency_hz=spread_hz, stiffness=0.01 * spread_percent)
    return robust_for_process(
        processes, case.cutting.cutting_stiffness, spindle_hz, config, case.workpiece.diameter, spread=stands
    )


def answer_of(found: RobustPitch, spindle_hz: float, diameter: float) -> dict[str, Any]:
    """Return the keys of the command line.

    Raises
    ------
    RefusalError
        When nothing fits.
    """
    from pitch import turret_offset

    if not found.found:
        known: dict[str, object] = {"frequency_hz": found.frequency_hz, "speed_rpm": 60.0 * spindle_hz}
        raise RefusalError(found.reason, dict.fromkeys(KEYS) | known)
    shift = 0.5 * found.pitch_difference
    offset = turret_offset(shift, diameter)
    slide_x1, slide_y1 = offset.slides()
    per_pi = found.phase / found.pitch_difference / math.pi
    return {
        "pitch_difference_deg": math.degrees(found.pitch_difference),
        "shift_deg": math.degrees(shift),
        "phase_pi": found.phase / math.pi,
        "dx1_um": 1e6 * offset.dx1,
        "dy1p_um": 1e6 * offset.dy1p,
        "slide_x1_um": 1e6 * slide_x1,
        "slide_y1_um": 1e6 * slide_y1,
        "order": found.order,
        "frequency_hz": found.frequency_hz,
        "speed_rpm": 60.0 * spindle_hz,
        "worst_growth_1_s": found.worst_growth,
        "window_pi": [edge * per_pi for edge in found.window],
        "margin_pi": list(found.margin_pi),
        "margin_deg": [math.degrees(edge) for edge in found.margin],
        "margin_hz": list(found.margin_hz),
        "judged_by": found.reason,
    }


def in_words(answer: dict[str, Any], diameter: float) -> str:
    """Return the same for people."""
    low, high = answer["window_pi"]
    sides = " and ".join(
        f"{answer['margin_hz'][k]:.0f} Hz ({answer['margin_deg'][k]:.2f} deg, {answer['margin_pi'][k]:.2f} pi) {side}"
        for k, side in enumerate(("down", "up"))
    )
    return (
        f"Pitch difference {answer['pitch_difference_deg']:.3f} deg at {answer['speed_rpm']:g} 1/min: turret 1 shifts "
        f"{answer['shift_deg']:.3f} deg, phase {answer['phase_pi']:.3f} pi at {answer['frequency_hz']:.1f} Hz "
        f"(order {answer['order']}; {answer['judged_by']}).\n"
        f"It holds from {low:.2f} to {high:.2f} pi: margin {sides}.\n"
        f"On diameter {1e3 * diameter:g} mm: dx1 {answer['dx1_um']:+.1f} um, dy1' {answer['dy1p_um']:+.1f} um; "
        f"slides X1 {answer['slide_x1_um']:+.1f} um, Y1 {answer['slide_y1_um']:+.1f} um."
    )
