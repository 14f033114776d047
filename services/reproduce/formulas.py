"""What chapter 6 computes from formulas: natural frequencies, Table 6-4, Fig. 6-14 and Fig. 6-20."""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from pitch import optimal_pitch_difference, pitch_difference_for_phase, regenerative_phase, turret_offset
from services.messages import Floats
from services.reproduce import published as thesis
from services.reproduce.plant import PlantName, prepared_case
from services.reproduce.rows import Row, near, said
from turning_sim import cantilever_frequency_hz

_SPINDLE_HZ = thesis.SPEED_RPM / 60.0
_LAST_DIGIT = 0.5001


def half_angle_deg(phase_pi: float, frequency_hz: float, speed_rpm: float = thesis.SPEED_RPM) -> float:
    """Return the shift (deg) that gives a phase (pi) at a chatter frequency, eq. (6-10)."""
    return math.degrees(pitch_difference_for_phase(frequency_hz, speed_rpm / 60.0, math.pi * phase_pi)) / 2.0


def shift_error_deg(frequency_hz: float, error_hz: Floats) -> Floats:
    """Return by how much the shift (deg) is wrong when the frequency is, as Fig. 6-14 shows it; shape (n,)."""
    right = optimal_pitch_difference(frequency_hz, _SPINDLE_HZ)
    wrong = [optimal_pitch_difference(frequency_hz + float(error), _SPINDLE_HZ) for error in error_hz]
    return np.degrees(np.array(wrong) - right) / 2.0


def phase_pi(frequency_hz: float, difference_deg: float, speed_rpm: float) -> float:
    """Return the phase (pi) at a pitch difference (deg), eq. (6-9), Fig. 6-20."""
    return regenerative_phase(frequency_hz, speed_rpm / 60.0, math.radians(difference_deg)) / math.pi


def natural_frequencies(plant: PlantName) -> list[Row]:
    """Return eq. (6-11) and the hammer test of Fig. 6-4."""
    rows: list[Row] = []
    for diameter, length, printed, where in thesis.NATURAL_HZ:
        computed = cantilever_frequency_hz(1e-3 * diameter, 1e-3 * length)
        what = f"first bending mode of a rigidly held bar, {diameter:g} x {length:g} mm"
        why = "the print is rounded; E 195 GPa and mass density 7930 kg/m3 where the print says specific weight"
        rows.append(near(f"{where}, eq. (6-11)", what, printed, computed, "Hz", within=_LAST_DIGIT, why=why))
    diameter, length = (1e-3 * value for value in thesis.HAMMER_BAR_MM)
    rigid = cantilever_frequency_hz(diameter, length)
    erratum = "Erratum: the bar of Table 6-2 held rigidly is far stiffer; the chuck gives way (next rows)"
    rows.append(
        near(
            "Fig. 6-4, eq. (6-11)", "first mode of the 25 x 130 mm bar, held rigidly", thesis.HAMMER_HZ[0], rigid, "Hz",
            within=0.05 * thesis.HAMMER_HZ[0], why="5 % for a slender rigid bar", otherwise=erratum,
        )
    )  # fmt: skip
    case = prepared_case(plant, "thesis-652")
    bar = dataclasses.replace(case.workpiece, length=length, damping_ratios=(0.12, 0.02), turned_length=0.0)
    for order, (printed, mode) in enumerate(zip(thesis.HAMMER_HZ, bar.modes(0.0), strict=True), start=1):
        what = f"mode {order} of the 25 x 130 mm bar on its elastic chuck"
        why = (
            "the two stiffnesses of the chuck were identified from these two frequencies, so this checks the beam; "
            "that the hammer test was at 130 mm is assumed"
        )
        within = 0.002 * printed
        rows.append(near("Fig. 6-4", what, printed, mode.natural_frequency_hz, "Hz", within=within, why=why))
    return rows


def pitch_differences() -> list[Row]:
    """Return 5.52 deg, Table 6-4 and the half angles of the odd phases."""
    computed = math.degrees(optimal_pitch_difference(thesis.NOMINAL_HZ, _SPINDLE_HZ))
    why = "the print is rounded"
    rows = [
        near(
            "section 6.5.1, eq. (6-10)", "optimum pitch difference at 652 Hz", thesis.PITCH_DIFFERENCE_DEG, computed,
            "deg", within=0.01 * _LAST_DIGIT, why=why,
        )
    ]  # fmt: skip
    for column in thesis.TABLE_6_4:
        rows += _column(column)
    for odd, printed in thesis.ODD_HALF_ANGLES_DEG.items():
        computed = half_angle_deg(odd, thesis.NOMINAL_HZ)
        otherwise = "Erratum: eq. (6-10) gives 8.28 deg at 652 Hz, so 8.3" if odd == 3 else ""
        rows.append(
            near(
                "section 6.5.2, eq. (6-10)", f"half angle for {odd} pi at 652 Hz", printed, computed, "deg",
                within=0.1 * _LAST_DIGIT, why="the print is rounded", otherwise=otherwise,
            )
        )  # fmt: skip
    return rows


def _column(column: thesis.Phase) -> list[Row]:
    name = f"{column.phase_pi:g} pi"
    half = half_angle_deg(column.phase_pi, thesis.NOMINAL_HZ)
    implied = half / column.half_angle_deg * thesis.NOMINAL_HZ
    why = "0.5 % is 3 Hz of chatter frequency, what a spectrogram can be read to"
    if abs(half - column.half_angle_deg) > 0.01 * _LAST_DIGIT:
        off = column.half_angle_deg - half
        why += f"; the print is {off:+.3f} deg off, more than rounding, as if from {implied:.1f} Hz"
    offset = turret_offset(math.radians(column.half_angle_deg), 1e-3 * column.diameter_mm)
    exact = f"to the last printed digit, from the printed half angle and diameter {column.diameter_mm:g} mm"
    last = 0.1 * _LAST_DIGIT
    return [
        near(
            "Table 6-4", f"{name}: half angle at 652 Hz", column.half_angle_deg, half, "deg",
            within=0.005 * column.half_angle_deg, why=why,
        ),
        near("Table 6-4", f"{name}: dx1", column.dx1_um, 1e6 * offset.dx1, "um", within=last, why=exact),
        near("Table 6-4", f"{name}: dy1'", column.dy1p_um, 1e6 * offset.dy1p, "um", within=last, why=exact),
    ]  # fmt: skip


def error_of_the_shift() -> list[Row]:
    """Return Fig. 6-14."""
    rows: list[Row] = []
    for frequency in thesis.ERROR_AT_HZ:
        ends = np.array([-thesis.ERROR_HZ, thesis.ERROR_HZ])
        largest = float(np.abs(shift_error_deg(frequency, ends)).max())
        rows.append(
            said(
                "Fig. 6-14", f"largest error of the half angle for +-10 Hz about {frequency:g} Hz", "<= 0.1", largest,
                largest <= thesis.ERROR_DEG, why="printed as a bound, 'less than or comparable to 0.1 deg'", unit="deg",
            )
        )  # fmt: skip
    return rows


def phase_and_difference() -> list[Row]:
    """Return what Fig. 6-20 states."""
    low, high = thesis.STABLE_BAND_PI
    source = "Fig. 6-20, eq. (6-9)"
    at_652 = phase_pi(thesis.NOMINAL_HZ, thesis.PITCH_DIFFERENCE_DEG, thesis.SPEED_RPM)
    rows = [near(source, "phase at 5.52 deg, 652 Hz, 1200 1/min", 1.0, at_652, "pi", within=0.001, why="rounded print")]
    at_532 = phase_pi(thesis.LINES_HZ[-1], thesis.PITCH_DIFFERENCE_DEG, thesis.SPEED_RPM)
    why = f"at 532 Hz over at 652 Hz, same pitch difference; it stays in the band {low:g}...{high:g} pi"
    rows.append(
        said(source, "the higher the frequency, the larger the phase", "< 1", at_532 / at_652, low < at_532 < at_652,
             why=why)
    )  # fmt: skip
    slow, fast = (half_angle_deg(1.0, thesis.NOMINAL_HZ, speed) for speed in (600.0, thesis.SPEED_RPM))
    why = "shift for pi at 600 over at 1200 1/min: proportional to the speed"
    rows.append(said(source, "at low speed a small difference is enough", "< 1", slow / fast, slow < fast, why=why))
    widths = [
        half_angle_deg(high, thesis.NOMINAL_HZ, speed) - half_angle_deg(low, thesis.NOMINAL_HZ, speed)
        for speed in (600.0, thesis.SPEED_RPM)
    ]
    why = f"width of {low:g}...{high:g} pi in deg of shift: {widths[0]:.2f} over {widths[1]:.2f}"
    rows.append(
        said(source, "and the range that works is narrower", "< 1", widths[0] / widths[1], widths[0] < widths[1],
             why=why)
    )  # fmt: skip
    return rows
