"""Verbs that answer from numbers alone: `pitch` and `stability`."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated, Any

import typer

from services.cli.app import JsonFlag, app, emit, positive, require
from services.errors import InputError, RefusalError

if TYPE_CHECKING:
    from pitch import OneModeProcess

SpeedRpm = Annotated[float, typer.Option("--speed-rpm", help="Spindle speed (1/min).")]
Number = float | None


@app.command()
def pitch(
    chatter_hz: Annotated[Number, typer.Option("--chatter-hz", help="One chatter frequency (Hz).")] = None,
    speed_rpm: Annotated[Number, typer.Option("--speed-rpm", help="Spindle speed (1/min; --case has one).")] = None,
    order: Annotated[
        int, typer.Option("--order", help="Whole waves M beside the wanted phase: phase (2 M + P) pi; else the most.")
    ] = 0,
    phase_pi: Annotated[Number, typer.Option("--phase-pi", help="Wanted phase P in units of pi (default 1).")] = None,
    diameter_mm: Annotated[Number, typer.Option("--diameter-mm", help="At the cutting point (mm; default 25).")] = None,
    case: Annotated[str | None, typer.Option("--case", help="Robust pitch for the stretch that a case cuts.")] = None,
    lines: Annotated[str | None, typer.Option("--lines", help="Robust pitch for chatter lines F1,F2,.. (Hz).")] = None,
    band: Annotated[str | None, typer.Option("--band", help="Robust pitch for a band LO:HI (Hz).")] = None,
    travel_mm: Annotated[Number, typer.Option("--travel-mm", help="Travel of both slides (mm).")] = None,
    max_shift_deg: Annotated[Number, typer.Option("--max-shift-deg", help="Largest shift (deg).")] = None,
    spread_hz: Annotated[Number, typer.Option("--spread-hz", help="Of natural frequency (--case; 10).")] = None,
    spread_percent: Annotated[Number, typer.Option("--spread-percent", help="Of stiffness (--case; 30).")] = None,
    as_json: JsonFlag = False,
) -> None:
    """Say where turret 1 must stand: for one frequency in a phase, or where it stands most."""
    asked = {"chatter-hz": chatter_hz, "case": case, "lines": lines, "band": band}
    given = [name for name, value in asked.items() if value is not None]
    if len(given) != 1:
        raise InputError("chatter-hz", ", ".join(given) or None, "given alone, or --case, --lines or --band instead")
    limits = {"travel-mm": travel_mm, "max-shift-deg": max_shift_deg}
    spreads = {"spread-hz": spread_hz, "spread-percent": spread_percent}
    unused = limits | spreads if chatter_hz is not None else {"phase-pi": phase_pi} | ({} if case else spreads)
    for name, value in unused.items():
        if value is not None:
            raise InputError(name, value, f"left out with --{given[0]}")
    if speed_rpm is not None or case is None:
        positive("speed-rpm", math.nan if speed_rpm is None else speed_rpm, "1/min")
        require("speed-rpm", speed_rpm or 0.0, "at most 1000000 1/min", (speed_rpm or 0.0) <= 1e6)
    if diameter_mm is not None:
        positive("diameter-mm", diameter_mm, "mm")
    require("order", order, "a whole number from 0 to 1000", 0 <= order <= 1000)
    if chatter_hz is not None:
        answer, text = _one_phase(chatter_hz, speed_rpm or 0.0, order, phase_pi, diameter_mm)
    else:
        answer, text = _robust((case, lines, band), speed_rpm, order, diameter_mm, limits, spreads)
    emit(answer, text, as_json)


def _robust(
    asked: tuple[str | None, str | None, str | None], speed_rpm: Number, order: int, diameter_mm: Number,
    limits: dict[str, Number], spreads: dict[str, Number],
) -> tuple[dict[str, Any], str]:  # fmt: skip
    """Return the keys and the words of the pitch that stands most."""
    from pitch import robust_for_lines
    from services import robust_pitch
    from services.config import load_case

    for name, most in (("travel-mm", 1000.0), ("max-shift-deg", 20.0)):
        value = limits[name]
        require(name, value or 1.0, f"above 0 and at most {most:g}", value is None or 0.0 < value <= most)
    for name, most in (("spread-hz", 500.0), ("spread-percent", 95.0)):
        value = spreads[name]
        require(name, value or 0.0, f"from 0 to {most:g}", value is None or 0.0 <= value <= most)
    name, lines, band = asked
    known = None if name is None else load_case(name)
    config = robust_pitch.limits(
        None if known is None else known.planner, limits["travel-mm"], limits["max-shift-deg"], order
    )
    if known is not None:
        spindle_hz = known.cutting.spindle_hz if speed_rpm is None else speed_rpm / 60.0
        diameter = known.workpiece.diameter if diameter_mm is None else 1e-3 * diameter_mm
        hertz, percent = (spreads[key] for key in ("spread-hz", "spread-percent"))
        found = robust_pitch.case_pitch(
            known, config, spindle_hz, 10.0 if hertz is None else hertz, 30.0 if percent is None else percent
        )
    else:
        spindle_hz, diameter = (speed_rpm or 0.0) / 60.0, 1e-3 * (diameter_mm or 25.0)
        wanted = robust_pitch.parse_lines(lines) if lines is not None else robust_pitch.parse_band(band or "")
        found = robust_for_lines(wanted, spindle_hz, config, diameter)
    answer = robust_pitch.answer_of(found, spindle_hz, diameter)
    return answer, robust_pitch.in_words(answer, diameter)


def _one_phase(
    chatter_hz: float, speed_rpm: float, order: int, wanted: Number, diameter: Number
) -> tuple[dict[str, Any], str]:
    """Return the keys and the words for one frequency in one phase."""
    from pitch import pitch_difference_for_phase, turret_offset

    phase_pi, diameter_mm = 1.0 if wanted is None else wanted, 25.0 if diameter is None else diameter
    positive("chatter-hz", chatter_hz, "Hz")
    require("chatter-hz", chatter_hz, "at most 100000 Hz", chatter_hz <= 1e5)
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
    return answer, _pitch_words(answer, chatter_hz, speed_rpm, diameter_mm)


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
