"""Verbs that answer from numbers alone: `pitch` and `stability`."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated, Any

import typer

from services.cli.app import JsonFlag, app, emit, positive, require
from services.errors import RefusalError

if TYPE_CHECKING:
    from pitch import OneModeProcess

SpeedRpm = Annotated[float, typer.Option("--speed-rpm", help="Spindle speed (1/min).")]


@app.command()
def pitch(
    chatter_hz: Annotated[float, typer.Option("--chatter-hz", help="Chatter frequency (Hz).")],
    speed_rpm: SpeedRpm,
    order: Annotated[
        int, typer.Option("--order", help="Whole waves M beside the wanted phase: phase (2 M + P) pi.")
    ] = 0,
    phase_pi: Annotated[float, typer.Option("--phase-pi", help="Wanted phase P in units of pi; 1 is antiphase.")] = 1.0,
    diameter_mm: Annotated[float, typer.Option("--diameter-mm", help="Diameter at the cutting point (mm).")] = 25.0,
    as_json: JsonFlag = False,
) -> None:
    """Say where turret 1 must stand so that the two waves meet in the wanted phase."""
    from pitch import pitch_difference_for_phase, turret_offset

    positive("chatter-hz", chatter_hz, "Hz")
    positive("speed-rpm", speed_rpm, "1/min")
    positive("diameter-mm", diameter_mm, "mm")
    require("order", order, "a whole number from 0 to 1000", 0 <= order <= 1000)
    require("phase-pi", phase_pi, "above 0 and at most 2 (add whole waves with --order)", 0 < phase_pi <= 2)
    phase = (2 * order + phase_pi) * math.pi
    difference = pitch_difference_for_phase(chatter_hz, speed_rpm / 60.0, phase)
    shift = difference / 2.0
    require(
        "order", order, f"small enough for a shift below 90 deg (here {math.degrees(shift):.4g})", shift < math.pi / 2
    )
    offset = turret_offset(shift, diameter_mm * 1e-3)
    slide_x1, slide_y1 = offset.slides()
    answer = {
        "pitch_difference_deg": math.degrees(difference),
        "shift_deg": math.degrees(shift),
        "phase_pi": 2 * order + phase_pi,
        "dx1_um": offset.dx1 * 1e6,
        "dy1p_um": offset.dy1p * 1e6,
        "slide_x1_um": slide_x1 * 1e6,
        "slide_y1_um": slide_y1 * 1e6,
    }
    emit(answer, _pitch_words(answer, chatter_hz, speed_rpm, diameter_mm), as_json)


def _pitch_words(answer: dict[str, float], chatter_hz: float, speed_rpm: float, diameter_mm: float) -> str:
    return (
        f"{chatter_hz:g} Hz at {speed_rpm:g} 1/min: pitch difference {answer['pitch_difference_deg']:.3f} deg, "
        f"turret 1 shifts {answer['shift_deg']:.3f} deg round the bar (phase {answer['phase_pi']:g} pi).\n"
        f"On diameter {diameter_mm:g} mm: dx1 {answer['dx1_um']:+.1f} um, dy1' {answer['dy1p_um']:+.1f} um; "
        f"slides X1 {answer['slide_x1_um']:+.1f} um, Y1 {answer['slide_y1_um']:+.1f} um."
    )


@app.command()
def stability(
    mass_kg: Annotated[float, typer.Option("--mass-kg", help="Modal mass at the cutting point (kg).")],
    natural_hz: Annotated[float, typer.Option("--natural-hz", help="Natural frequency (Hz).")],
    damping: Annotated[float, typer.Option("--damping", help="Damping ratio.")],
    speed_rpm: SpeedRpm,
    pitch_difference_deg: Annotated[float, typer.Option("--pitch-difference-deg", help="Pitch difference (deg).")],
    overlap: Annotated[float, typer.Option("--overlap", help="Overlap factor; negative for tools on one side.")] = 1.0,
    process_damping: Annotated[
        float, typer.Option("--process-damping", help="Process damping of a tool (N s/m).")
    ] = 0.0,
    stiffness: Annotated[float | None, typer.Option("--stiffness", help="Dynamic cutting stiffness (N/m).")] = None,
    as_json: JsonFlag = False,
) -> None:
    """Give the limit of stability of one bending mode between two tools, and the root at a given stiffness."""
    from pitch import OneModeProcess, StabilityUnresolved

    positive("mass-kg", mass_kg, "kg")
    positive("natural-hz", natural_hz, "Hz")
    require("damping", damping, "in (0, 1)", 0 < damping < 1)
    spindle_hz = positive("speed-rpm", speed_rpm, "1/min") / 60.0
    require("pitch-difference-deg", pitch_difference_deg, "in (-360, 360) deg", abs(pitch_difference_deg) < 360)
    require("overlap", overlap, "in [-1, 1]", abs(overlap) <= 1)
    require("process-damping", process_damping, "0 N s/m or more", process_damping >= 0)
    process = OneModeProcess(
        modal_mass=mass_kg,
        natural_frequency_hz=natural_hz,
        damping_ratio=damping,
        overlap=overlap,
        process_damping=process_damping,
    )
    if stiffness is not None:
        positive("stiffness", stiffness, "N/m")
    answer: dict[str, Any] = dict.fromkeys(("critical_stiffness_n_m", "critical_hz", "stable_intervals_n_m"))
    answer |= {} if stiffness is None else dict.fromkeys(("growth_rate_1_s", "root_hz", "stable"))
    try:
        text = _stability(process, spindle_hz, math.radians(pitch_difference_deg), stiffness, answer)
    except StabilityUnresolved as error:
        raise RefusalError(str(error), answer) from error
    emit(answer, text, as_json)


def _stability(
    process: OneModeProcess, spindle_hz: float, difference: float, stiffness: float | None, answer: dict[str, Any]
) -> str:
    """Fill the keys of `stability` and return the same in words."""
    from pitch import StabilityUnresolved, critical_stiffness, rightmost_root, stable_intervals

    limit, limit_hz = critical_stiffness(process, spindle_hz, difference)
    answer |= {"critical_stiffness_n_m": limit, "critical_hz": limit_hz}
    text = f"Stability is lost at {limit:.6g} N/m, at {limit_hz:.2f} Hz."
    if not math.isfinite(limit):
        text = "No stiffness loses stability."
    if stiffness is not None:
        root = rightmost_root(process, stiffness, spindle_hz, difference)
        answer |= {
            "growth_rate_1_s": root.real,
            "root_hz": abs(root.imag) / (2 * math.pi),
            "stable": bool(root.real < 0),
        }
        grows = "dies out" if root.real < 0 else "grows"
        text += f"\nAt {stiffness:g} N/m it {grows} at {root.real:+.3f} 1/s, {answer['root_hz']:.2f} Hz."
    try:
        intervals = stable_intervals(process, spindle_hz, difference)
    except StabilityUnresolved as error:
        return f"{text}\nIslands are not searched for: {error}."
    answer["stable_intervals_n_m"] = [list(interval) for interval in intervals]
    return text + "".join(f"\nAn island is stable from {low:.6g} to {high:.6g} N/m." for low, high in intervals[1:])
