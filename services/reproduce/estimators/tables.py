"""Tables 3-2 to 3-4, 4-5 and 6-1 of the thesis, and lengths that its text turns into forces and frequencies."""

from __future__ import annotations

import numpy as np

from chatter.observers.damping import resonance
from chatter.observers.delays import align
from chatter.observers.family import linear_observer
from chatter.observers.notch import away_from_tooth_passing, encoder_lines_hz
from chatter.observers.prediction import least_forces
from chatter.observers.stage_model import sensed
from services.reproduce.estimators import independent
from services.reproduce.estimators import published as print_
from services.reproduce.estimators.kit import believed, checked, drive_of
from services.reproduce.rows import Row, near, said
from turning_sim import thesis_condition

_LAST_DIGIT = 0.5001
_ROUNDED = "the print is rounded"


def table_rows() -> list[Row]:
    """Return every row of this file."""
    rows: list[Row] = []
    for name in print_.MACHINES:
        rows += [*_encoders(name), *_machine(name), *_dead_times(name), *_least(name)]
    return [*rows, *_turret(), *_notches(), *_waves(), *_lengths(), *_tooth_passing()]


def _encoders(name: str) -> list[Row]:
    drive, said_of, title = drive_of(name).drive, print_.PRINTED[name], print_.TITLE[name]
    rotary = 1e9 * drive.lead / 2**said_of.rotary_bits
    rows = [
        near("Table 3-4", f"{title}: count of the rotary encoder at the stage", said_of.rotary_nm, rotary, "nm",
             within=0.1 * _LAST_DIGIT, why=f"{said_of.rotary_bits} bit over the lead; {_ROUNDED}"),
    ]  # fmt: skip
    if name == "machine-b":
        step = 1e3 * print_.SCALE_PERIOD_UM / print_.SCALE_STEPS
        rows.append(near("Table 3-4", f"{title}: count of the scale", said_of.linear_nm, step, "nm", within=5e-4,
                         why=f"signal period over its interpolation; {_ROUNDED}"))  # fmt: skip
    return rows


def _machine(name: str) -> list[Row]:
    said_of, title = print_.PRINTED[name], print_.TITLE[name]
    drive = believed(drive_of(name), lags=False, counts=False)
    mode = resonance(drive)
    hz = np.linspace(0.8, 1.1, 6001) * mode.frequency_hz
    moved = sensed(drive, hz)
    peak = float(hz[np.argmax(np.abs(moved[:, 0] - moved[:, 1]))])
    source = "Table 3-3"
    why = "that the listed resonance is the peak of the relative displacement is an erratum; 1 Hz"
    expected = independent.RELATIVE_PEAK_HZ[name]
    return [
        near(source, f"{title}: resonance", said_of.resonance_hz, peak, "Hz", within=1.0, why=why),
        near(source, f"{title}: inertia ratio", said_of.mass_ratio, drive.mass_ratio, "", within=1e-3 * _LAST_DIGIT,
             why=_ROUNDED),
        checked(source, f"{title}: peak of the relative displacement", expected, peak, "Hz", within=0.1),
        checked(source, f"{title}: inertia ratio, more digits", independent.MASS_RATIO[name], drive.mass_ratio,
                within=1e-5),
        checked(source, f"{title}: undamped natural frequency", independent.NATURAL_HZ[name], mode.frequency_hz,
                "Hz", within=0.01),
        checked(source, f"{title}: damping ratio", independent.DAMPING_RATIO[name], mode.damping_ratio,
                within=1e-4),
    ]  # fmt: skip


def _dead_times(name: str) -> list[Row]:
    drive, title = believed(drive_of(name)), print_.TITLE[name]
    rate = drive_of(name).settings.sample_rate_hz
    ages = rate * np.array([-drive.thrust_delay, drive.motor_delay, drive.stage_delay])
    found = align(ages)
    taps = np.arange(found.weights.shape[1])
    held = 1e3 / rate * (found.first + (found.weights * taps).sum(axis=1))
    held -= held.min()
    signals = ("T1 of the thrust", "T2 of the motor angle", "T3 of the stage position")
    why = "what the observer delays each signal by so that all are as old as the oldest"
    if name == "machine-b":
        why += "; section 2.4.2 prints (0.2, 0, 0) ms and 0.2 s, which are errata"
    return [
        near("Table 3-3", f"{title}: {signal}", printed, float(ms), "ms", within=1e-6, why=why)
        for signal, printed, ms in zip(signals, print_.PRINTED[name].dead_ms, held, strict=True)
    ]


_TERMS = {
    "rotor_inertia": "inertia of what rotates",
    "stage_inertia": "inertia of the stage",
    "rotor_damping": "damping of what rotates",
    "stage_damping": "damping of the stage",
    "vibration_inertia": "inertia in the vibration mode",
    "vibration_damping": "damping in the vibration mode",
    "vibration_elastic": "spring in the vibration mode",
}


def _least(name: str) -> list[Row]:
    named, said_of, title = drive_of(name), print_.PRINTED[name], print_.TITLE[name]
    drive = believed(named)
    forces = least_forces(drive, named.settings.sample_rate_hz)
    rows: list[Row] = []
    for term, printed in said_of.least_n.items():
        modal = term.startswith("vibration")
        value = forces[term] / drive.mass_ratio if modal else forces[term]
        corrected = print_.LEAST_CORRECTED_N.get((name, term))
        part = max(0.015, said_of.digits.get(term, 0.0))
        why = f"{100 * part:g} % for rounding"
        if corrected is not None:
            why += f"; erratum: {printed:g} is printed, the listed count and inertia give {corrected:g}"
        if modal:
            why += f"; a modal force: as cutting force, times the inertia ratio, it is {forces[term]:.3g} N"
        rows.append(
            near("Table 3-4", f"{title}: least force by one count in one sample, {_TERMS[term]}", printed, value, "N",
                 within=part * (corrected or printed), why=why, expected=corrected)
        )  # fmt: skip
    modal_terms = [term for term in _TERMS if term.startswith("vibration")]
    for term, expected in zip(modal_terms, independent.LEAST_VIBRATION_N[name], strict=True):
        rows.append(
            checked("Table 3-4", f"{title}: least cutting force, {_TERMS[term]}", expected, forces[term], "N",
                    within=0.05 * expected, why="the modal row times the inertia ratio")
        )  # fmt: skip
    return rows


def _turret() -> list[Row]:
    rows: list[Row] = []
    for name, (lead_mm, counts, printed) in print_.TURRET_NM.items():
        drive = drive_of(name).drive
        rows.append(
            near("Table 6-1", f"{print_.TITLE[name]}: count of the rotary encoder at the stage", printed,
                 1e9 * drive.lead / counts, "nm", within=0.1 * _LAST_DIGIT,
                 why=f"{lead_mm:g} mm over {counts} counts; {_ROUNDED}")
        )  # fmt: skip
    return rows


def _feed(speed_rpm: float) -> float:
    return 1e-3 * print_.NOTCH_FEED_MM * 2.0 * speed_rpm / 60.0


def _notches() -> list[Row]:
    period = drive_of("machine-b").drive.lead / print_.SIGNAL_PERIODS
    rows: list[Row] = []
    for speed, lines in print_.NOTCH_LINES_HZ.items():
        for order, printed in lines.items():
            found = float(encoder_lines_hz(_feed(speed), [period], order, 2e3)[order - 1])
            why = "0.1 %: the print takes 9.77 um for 5 mm / 512 = 9.765625 um"
            rows.append(near("Table 4-5", f"{speed} 1/min, harmonic {order} of the rotary signal period", printed,
                             found, "Hz", within=1e-3 * printed, why=why))  # fmt: skip
    lowest = float(encoder_lines_hz(_feed(1000), [period], 1, 2e3)[0])
    kept = away_from_tooth_passing(np.array([lowest]), 2.0 * 1000.0 / 60.0)
    why = f"the line at {lowest:.1f} Hz lies beside the third harmonic of tooth passing (100 Hz), and is left alone"
    rows.append(said("Table 4-5, section 4.3.3", "1000 1/min, harmonic 1: notch", "none", float(kept.size),
                     kept.size == 0, why=why))  # fmt: skip
    lines = [(speed, order) for speed, found in print_.NOTCH_LINES_HZ.items() for order in found]
    each = [(encoder_lines_hz(_feed(speed), [period], order, 2e3)[order - 1:], 2.0 * speed / 60.0)
            for speed, order in lines]  # fmt: skip
    notched = sum(away_from_tooth_passing(line, teeth).size for line, teeth in each)
    why = (
        f"0.030 mm per tooth over 9.77 um is {lowest / (2.0 * 1000.0 / 60.0):.3f}: each line lies 2.4 % above a "
        "harmonic of tooth passing at any speed, and within 5 % no notch is set here, since it would take the force too"
    )
    rows.append(said("Table 4-5", "entries with a notch", f"all {len(lines)}", float(notched), notched == len(lines),
                     why=why))  # fmt: skip
    return rows


def _waves() -> list[Row]:
    lead = drive_of("machine-b").drive.lead
    rows = [
        near("section 3.4", f"harmonic {order} of the rotary signal period, as travel", printed,
             1e6 * lead / print_.SIGNAL_PERIODS / order, "um", within=0.05, why=_ROUNDED)
        for order, printed in print_.ENCODER_WAVES_UM.items()
    ]  # fmt: skip
    orders = "the thesis says 10 poles and 6 slots here and 12 slots in Table 3-2: lcm(10, 6) = 30, lcm(10, 12) = 60"
    rows += [
        near("section 3.4", f"torque ripple of machine B, {times} periods per turn, as travel", printed,
             1e3 * lead / times, "mm", within=1e-3 * _LAST_DIGIT, why=f"{_ROUNDED}; {orders}")
        for times, printed in print_.COGGING_WAVES_MM.items()
    ]  # fmt: skip
    found = float(encoder_lines_hz(1e-3 * print_.LEAD_LINE_AT_MM_S, [lead], 1, 100.0)[0])
    rows.append(near("section 5.3", "line of the lead at 20 mm/s", print_.LEAD_LINE_HZ, found, "Hz", within=1e-6,
                     why="feed over lead"))  # fmt: skip
    return rows


def _lengths() -> list[Row]:
    named = drive_of("machine-b")
    rate = named.settings.sample_rate_hz
    stiff, modal = (
        float(linear_observer(kind, believed(named), rate).weights([1e-3])[0, 0, 0].real)
        for kind in ("load_side", "vibration")
    )
    why = f"what the load-side law makes of a standing stretch; the vibration mode makes {modal / stiff:.3f} times this"
    return [
        near("section 5.3", "force for 0.2 um of relative displacement left over", print_.RELATIVE_ERROR_N,
             1e-6 * print_.RELATIVE_ERROR_UM * stiff, "N", within=0.05, why=why),
        near("section 5.4.2", "constant force for 0.60 um of relative displacement", print_.STATIC_N,
             1e-6 * print_.STATIC_UM * stiff, "N", within=0.05, why=why),
    ]  # fmt: skip


def _tooth_passing() -> list[Row]:
    return [
        near("section 4.2.3", f"tooth passing in condition {number}", printed, thesis_condition(number).tooth_pass_hz,
             "Hz", within=0.1 * _LAST_DIGIT, why=_ROUNDED)
        for number, printed in print_.TOOTH_PASS_HZ.items() if number > 2
    ]  # fmt: skip
