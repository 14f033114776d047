"""Sections 2.3.3, 4.2.2 and 5.2.1 of the thesis and its appendix: frequency responses with and without errors."""

from __future__ import annotations

import numpy as np

from chatter.observers.analytic import analytic_response, mass_error_response, rigid_response
from chatter.observers.family import linear_observer
from chatter.observers.prediction import response_of
from chatter.observers.stage_model import sensed
from services.messages import Floats
from services.reproduce.estimators import independent
from services.reproduce.estimators import published as print_
from services.reproduce.estimators.kit import (
    LOST,
    axis_of,
    believed,
    bounded,
    checked,
    degrees,
    drive_of,
    exceeds,
    line,
    loop_of,
)
from services.reproduce.rows import Row, near, said

FINE_HZ: Floats = np.linspace(20.0, 1000.0, 4901)
_WIDE_S = 0.5


def response_rows() -> list[Row]:
    """Return every row of this file."""
    rows: list[Row] = []
    for name in print_.MACHINES:
        rows += _rigid(name)
        rows += _exact(name)
    return [*rows, *_closed_loop(), *_misprints(), *_parts(), *_mass(), *_stiffness(), *_delays(), *_angle()]


def good_up_to(gain: np.ndarray, hz: Floats) -> float:
    """Return up to where a gain stays within 10 % (Hz)."""
    bad = np.flatnonzero(np.abs(np.abs(gain) - 1.0) > 0.1)
    return float(hz[bad[0]] if bad.size else hz[-1])


def gain_of(estimator: str, compensation: str, hz: Floats, *, lags: bool = True, mass: float = 1.0) -> np.ndarray:
    """Return estimate over true force of machine A in its loop, relative to the ideal one, shape (k,)."""
    named = drive_of("machine-a")
    rate = named.settings.sample_rate_hz
    true = believed(named, lags=lags, counts=False)
    observer = linear_observer(
        estimator,
        believed(named, lags=lags, counts=False, factors={"stage_mass": mass}),
        rate,
        compensation=compensation,
    )
    return response_of(observer, true, hz, control=loop_of(named), sample_rate_hz=rate)


def _rigid(name: str) -> list[Row]:
    drive, title = believed(drive_of(name), lags=False, counts=False), print_.TITLE[name]
    gain = np.abs(analytic_response("dob", drive, drive, FINE_HZ))
    size, at, ten = independent.DOB_PEAK[name]
    low, high = (float(np.abs(analytic_response("dob", drive, drive, [hz])[0])) for hz in (1.0, 4.0 * at))
    source = "section 2.3.3, Fig. 2-3"
    return [
        said(source, f"{title}: DOB at low frequency", "close to 0 dB", low, abs(low - 1.0) < 0.01, why="1 % at 1 Hz"),
        said(source, f"{title}: DOB far above the resonance", "drastically decreases", high, high < 0.1,
             why="below a tenth at four times the resonance"),
        checked(source, f"{title}: peak of DOB, open loop", size, float(gain.max()), within=0.01 * size),
        checked(source, f"{title}: where", at, float(FINE_HZ[gain.argmax()]), "Hz", within=0.2),
        checked(source, f"{title}: DOB is 10 % wrong from", ten, good_up_to(gain, FINE_HZ), "Hz", within=0.015 * ten),
    ]  # fmt: skip


def _exact(name: str) -> list[Row]:
    named = drive_of(name)
    title, rate = print_.TITLE[name], named.settings.sample_rate_hz
    drive = believed(named, lags=False, counts=False)
    hz = FINE_HZ[FINE_HZ <= 500.0]
    rows: list[Row] = []
    for estimator, most, why in (
        ("medob", 1e-9, ""),
        ("vibration", 2e-3, "its modal damping is exact only where damping is proportional to mass (erratum to 2-41)"),
    ):
        off = float(np.abs(analytic_response(estimator, drive, drive, FINE_HZ) - 1.0).max())
        rows.append(bounded("section 4.2.2, 5.2.1", f"{title}: {estimator}, exact parameters, no sampling", most, off,
                            why=why))  # fmt: skip
        observer = linear_observer(estimator, believed(named, counts=False), rate, cutoff_hz=0.4 * rate)
        gain = response_of(observer, believed(named, counts=False), hz, control=loop_of(named), sample_rate_hz=rate)
        off = float(np.abs(np.abs(gain) - 1.0).max())
        rows.append(said("section 4.2.2, Fig. 4-3", f"{title}: {estimator}, phase lags compensated, to 500 Hz",
                         "the same gain as without lags", off, off <= 0.03,
                         why="3 %: largest difference of the sampled gain from 1 in the loop"))  # fmt: skip
    return rows


def _closed_loop() -> list[Row]:
    named = drive_of("machine-a")
    drive = believed(named, lags=False, counts=False)
    rows: list[Row] = []
    for loop, (size, angle) in independent.DOB_500HZ.items():
        gain = complex(analytic_response("dob", drive, drive, [500.0], loop_of(named) if loop == "closed" else None)[0])
        why = "eq. (2-19) neglects the thrust, which holds for the open loop only (erratum)"
        what = f"machine A: DOB at 500 Hz, {loop} loop"
        rows += [
            checked("eq. (2-19)", f"{what}: gain", size, abs(gain), within=0.005, why=why),
            checked("eq. (2-19)", f"{what}: phase", angle, degrees(gain), "deg", within=0.5, why=why),
        ]
    return rows


def _misprints() -> list[Row]:
    drives = {name: believed(drive_of(name), lags=False, counts=False) for name in print_.MACHINES}
    a = drives["machine-a"]
    exact = float(np.abs(rigid_response(a, FINE_HZ) - analytic_response("dob", a, a, FINE_HZ)).max())
    rows = [bounded("eq. (2-19)", "as corrected, against the equations of motion", 1e-9, exact)]
    peak = float(FINE_HZ[np.abs(rigid_response(a, FINE_HZ)).argmax()])
    for hz, expected in zip((peak, 1000.0), independent.MISPRINT_2_19, strict=True):
        off = abs(complex(rigid_response(a, [hz], as_printed=True)[0] / rigid_response(a, [hz])[0]) - 1.0)
        rows.append(checked("eq. (2-19)", f"machine A: what the misprint of its first coefficient costs at {hz:.0f} Hz",
                            expected, off, within=0.05 * expected, why="omega_s for (alpha + 1) omega_t"))  # fmt: skip
    for name, expected in independent.MISPRINT_B_5.items():
        good, bad = (
            complex(mass_error_response(drives[name], [500.0], 0.5, as_printed=printed)[0]) for printed in (False, True)
        )
        rows.append(checked("eq. (B-5)", f"{print_.TITLE[name]}: what its misprint costs at 500 Hz, half the mass",
                            expected, abs(bad / good - 1.0), within=0.05 * expected, why="Q is missing"))  # fmt: skip
    half = believed(drive_of("machine-a"), lags=False, counts=False, factors={"stage_mass": 0.5})
    exact = mass_error_response(a, FINE_HZ, 0.5) - analytic_response("medob", half, a, FINE_HZ)
    rows.append(bounded("eq. (B-5)", "as corrected, against the equations of motion", 1e-9, float(np.abs(exact).max())))
    return rows


def _parts() -> list[Row]:
    """Return what the forces that MEDOB sums up do with frequency."""
    named = drive_of("machine-a")
    drive = believed(named, lags=False, counts=False)
    hz = np.array([1.0, 335.0, 900.0])
    seen = sensed(drive, hz, control=loop_of(named), sample_rate_hz=named.settings.sample_rate_hz)
    thrust = np.abs(seen[:, 2])
    inertia = drive.stage_mass * np.abs(seen[:, 1]) * (2.0 * np.pi * hz) ** 2
    source = "section 4.2.1, Fig. 4-1"
    return [
        said(source, "thrust over force at 1 Hz", "identical", float(thrust[0]), abs(thrust[0] - 1.0) < 0.02,
             why="2 %"),
        said(source, "thrust over force at 900 Hz", "decreases in high frequencies", float(thrust[2]),
             bool(thrust[2] < 0.2), why="below a fifth"),
        said(source, "inertia force of the stage over force at 1 Hz", "low", float(inertia[0]), bool(inertia[0] < 0.01),
             why="below 1 %"),
        said(source, "the same at 335 Hz", "increases near the resonance", float(inertia[1]), bool(inertia[1] > 1.0),
             why="above the force itself"),
        said("section 5.2.1, Fig. 5-1", "thrust in the vibration mode, over force at 1 Hz",
             f"low, inertia ratio {print_.PRINTED['machine-a'].mass_ratio:g}", float(drive.mass_ratio * thrust[0]),
             bool(drive.mass_ratio * thrust[0] < 0.15), why="inertia ratio times the thrust"),
    ]  # fmt: skip


def _mass() -> list[Row]:
    named = drive_of("machine-a")
    rate = named.settings.sample_rate_hz
    at = np.array([10.0, 335.0])
    rows: list[Row] = []
    for factor, (size, angle) in independent.MASS_ERROR.items():
        medob, vibration = (gain_of(name, "full", at, lags=False, mass=factor) for name in ("medob", "vibration"))
        gain, what = complex(medob[1]), f"machine A, mass times {factor:g}"
        apart = abs(complex(vibration[1] / medob[1]) - 1.0)
        rows += [
            checked("section 4.2.2, Fig. 4-2", f"{what}: gain of MEDOB at 335 Hz", size, abs(gain), within=0.01 * size),
            checked("section 4.2.2, Fig. 4-2", f"{what}: phase", angle, degrees(gain), "deg", within=1.0),
            said("section 5.2.1, Fig. 5-6", f"{what}: vibration mode beside MEDOB", "no differences", apart,
                 apart < 0.02, why="2 % of the response at 335 Hz"),
            said("section 4.2.2", f"{what}: error at 10 Hz", "accurate mass not required",
                 abs(complex(medob[0]) - 1.0), abs(complex(medob[0]) - 1.0) < 0.01, why="1 %"),
        ]  # fmt: skip
        if factor > 1.0:
            high = float(np.abs(gain_of("medob", "full", np.array([900.0]), lags=False, mass=factor))[0])
            rows += [
                said("section 4.2.2", f"{what}: gain at 900 Hz", "overestimated", high, high > 1.05, why="above 1.05"),
                said("section 4.2.2", f"{what}: phase at 335 Hz", "lead", degrees(gain), degrees(gain) > 0.0,
                     why="positive", unit="deg"),
            ]  # fmt: skip
    return [*rows, _in_time(rate)]


def _in_time(rate: float) -> Row:
    """Return the response by formula beside that of the simulated loop, mass times 0.5."""
    named, hz = drive_of("machine-a"), 335.0
    axis = axis_of(named, lags=False)
    count = round(_WIDE_S * rate)
    block = axis.advance(np.zeros(2 * count), print_.SWEEP_N * np.sin(2.0 * np.pi * hz * axis.force_times(2 * count)))
    observer = linear_observer("medob", believed(named, lags=False, counts=False, factors={"stage_mass": 0.5}), rate)
    found = observer.update(block.motor_position, block.stage_position, block.thrust)[-count:]
    ideal = linear_observer("medob", believed(named, lags=False, counts=False), rate)
    right = ideal.update(block.motor_position, block.stage_position, block.thrust)[-count:]
    simulated = line(found, hz, rate) / line(right, hz, rate)
    formula = complex(gain_of("medob", "full", np.array([hz]), lags=False, mass=0.5)[0])
    off = abs(simulated / formula - 1.0)
    return said("section 4.2.1, appendix", "response by formula beside the time-domain simulation, mass times 0.5",
                "almost coincided", off, off < 0.01, why="1 % at 335 Hz, 20 N")  # fmt: skip


def _stiffness() -> list[Row]:
    named = drive_of("machine-a")
    drive, rate = believed(named, counts=False), named.settings.sample_rate_hz
    rows: list[Row] = []
    gains: dict[str, complex] = {}
    for factor, expected in independent.STIFFNESS_ERROR.items():
        for estimator in ("vibration", "medob"):
            wrong = linear_observer(estimator, believed(named, counts=False, factors={"screw_stiffness": factor}), rate)
            gains[estimator] = complex(response_of(wrong, drive, [1.0], control=loop_of(named))[0])
        rows.append(checked("section 5.2.1, Fig. 5-8", f"vibration mode at 1 Hz, stiffness times {factor:g}", expected,
                            abs(gains["vibration"]), within=0.002))  # fmt: skip
    off = abs(abs(gains["vibration"]) - 1.0)
    rows += [
        said("section 5.2.1, Fig. 5-8", "vibration mode: a wrong stiffness at 1 Hz", "alters from DC on", off,
             off > 0.1, why="stiffness times 1.5; more than 10 %"),
        said("section 2.4.1", "MEDOB: the same", "stiffness not needed", abs(abs(gains["medob"]) - 1.0),
             abs(abs(gains["medob"]) - 1.0) < 0.002, why="0.2 %"),
    ]  # fmt: skip
    return rows


def _delays() -> list[Row]:
    gains = {
        "full": gain_of("medob", "full", FINE_HZ),
        "thrust": gain_of("medob", "thrust", FINE_HZ),
        "none": gain_of("medob", "none", FINE_HZ),
        "thrust alone": gain_of("thrust", "full", FINE_HZ),
    }
    words = {"full": "all dead times compensated", "thrust": "T1 only", "none": "none compensated"}
    source = "section 4.2.2, Fig. 4-3"
    rows: list[Row] = []
    for case, gain in gains.items():
        expected, found = independent.GOOD_TO_HZ[case], good_up_to(gain, FINE_HZ)
        what = f"machine A: MEDOB within 10 %, {words[case]}" if case in words else "machine A: thrust within 10 %"
        if case == "full":
            rows.append(exceeds(source, what, expected, found, "Hz"))
        else:
            rows.append(checked(source, what, expected, found, "Hz", within=0.02 * expected, why="from 20 Hz up"))
    at = int(np.argmin(np.abs(FINE_HZ - 100.0)))
    alone = gain_of("thrust", "full", FINE_HZ[at : at + 1], lags=False)[0]
    bare, thrust, late = (
        abs(abs(complex(gain)) - 1.0) for gain in (gains["none"][at], alone, gains["thrust alone"][at])
    )
    worst = float(np.abs(np.abs(gains["thrust"]) - 1.0).max())
    return [
        *rows,
        said(source, "error at 100 Hz, MEDOB without compensation over thrust", "lower accuracy, > 1", bare / thrust,
             bare > thrust, why="error of the gain; thrust in the reference condition, as in Fig. 4-1: in a loop with "
             f"the dead times the thrust is worse, and the ratio {bare / late:.2f}"),
        said(source, "MEDOB with T1 only: largest error of its gain", "decreases at certain frequencies", worst,
             worst > 0.1, why="more than 10 %"),
    ]  # fmt: skip


def _angle() -> list[Row]:
    """Return where the motor moves less than a count, and by how much less than the stage."""
    named = drive_of("machine-a")
    drive = believed(named, lags=False, counts=False)
    seen = sensed(drive, FINE_HZ, control=loop_of(named), sample_rate_hz=named.settings.sample_rate_hz)
    motor, stage = np.abs(seen[:, 0]), np.abs(seen[:, 1])
    above = np.flatnonzero(print_.SWEEP_N * motor > named.drive.motor_resolution)
    low, high = print_.SMALLEST_HZ_SPREAD
    ratio = float(motor[-1] / stage[-1] / (motor[0] / stage[0]))
    return [
        near("section 4.2.2, Fig. 4-4", "machine A, 20 N: motor moves less than a count above",
             print_.SMALLEST_ANGLE_HZ, float(FINE_HZ[above[-1]]), "Hz", within=0.5 * (high - low),
             expected=print_.CORRECTED_SMALLEST_HZ,
             why=f"erratum: 87 Hz cannot be had; all variants of the loop give {low:g} to {high:g} Hz"),
        said("section 4.2.2, Fig. 4-4", "motor over stage motion at 1 kHz, over the same at 20 Hz",
             "drastically decreased", ratio, ratio < 0.1, why="below a tenth"),
    ]  # fmt: skip


__all__ = ["FINE_HZ", "LOST", "gain_of", "good_up_to", "response_rows"]
