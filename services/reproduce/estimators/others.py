"""The fitting paper, the damping-force paper, the servo-current thesis, and three inertias."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.linalg import block_diag
from scipy.signal import cont2discrete, dlsim

from chatter.observers.damping import damping_observer, resonance
from chatter.observers.family import linear_observer
from chatter.observers.fitted import fitted_taps
from chatter.observers.kalman import HARMONICS, ForceModel, KalmanObserver, alias_hz
from chatter.observers.legacy import smoothed_inertia
from chatter.observers.nominal import NominalFeedDrive
from chatter.observers.prediction import filtered_variance, ideal_response, response_of
from chatter.observers.triple import triple_observer
from chatter.observers.triple_axis import TripleAxis
from services.messages import Floats
from services.reproduce.estimators import independent
from services.reproduce.estimators import published as print_
from services.reproduce.estimators.kit import believed, bounded, checked, degrees, drive_of, line
from services.reproduce.rows import Row, near, said
from turning_sim import Milling

_LAST_DIGIT = 0.5001
_HALF, _HARMONICS, _SPINDLE_HZ, _RATE_HZ = 10, 4, 1300.0 / 60.0, 1000.0
_SUBSTEPS, _CUT_S, _SKIPPED = 20, 6.0, 500
_DELAYS = (0, 1, 2)
"""Samples of delay of which the filter without lines is granted the best: a random walk cannot foresee."""
_TRIPLE_KG = (60.0, 20.0, 6.6)
_TRIPLE_N_PER_M = (3.2520e8, 3.4811e7)
LEAD = 5e-3


@dataclass(frozen=True, slots=True, kw_only=True)
class Kalman:
    """Forces of a simulated cut, true and estimated, and error ratios with and without lines of tooth passing."""

    time_s: Floats
    true_n: Floats
    known_n: Floats
    blind_n: Floats
    known: float
    blind: float


def study_kalman(
    tooth_pass_hz: float = independent.KALMAN_TOOTH_PASS_HZ,
    runout: float = 0.0,
    drifts: Sequence[float] = (10.0, 30.0, 100.0, 200.0, 400.0, 1e3, 3e3, 1e4, 1e5),
) -> Kalman:
    """Estimate a force from the thrust of a plant with two modes, knowing the lines and not.

    Parameters
    ----------
    tooth_pass_hz
        Of the force (Hz).
    runout
        Amplitude of the line at half of it over that of tooth passing.
    drifts
        What is tried without lines: how fast the force may wander (N/sqrt(s)).
    """
    rate = print_.SERVO_RATE_HZ
    model = _two_modes()
    time = np.arange(round(_CUT_S * rate * _SUBSTEPS)) / (rate * _SUBSTEPS)
    turn = 2.0 * math.pi * tooth_pass_hz * time
    lines = np.sin(turn) + np.sin(2.0 * turn + 1.0) / 3.0 + runout * np.sin(0.5 * turn)
    force = np.where(time > 0.5, 100.0 + 60.0 * lines, 0.0)
    held = cont2discrete((model.a, model.b[:, None], model.c[None, :], np.zeros((1, 1))), time[1], method="zoh")
    thrust = np.asarray(dlsim(held, force)[1]).reshape(-1)[::_SUBSTEPS]
    thrust = thrust + np.random.default_rng(0).standard_normal(thrust.size)
    true = force[::_SUBSTEPS]

    known = KalmanObserver(model, rate, lines_hz=[h * tooth_pass_hz for h in HARMONICS]).update(None, None, thrust)
    tries = [KalmanObserver(model, rate, drift=d).update(None, None, thrust) for d in drifts]
    late = [np.concatenate([found[late:], np.repeat(found[-1], late)]) for found in tries for late in _DELAYS]
    blind = min(late, key=lambda found: _ratio(found, true))
    return Kalman(
        time_s=time[::_SUBSTEPS], true_n=true, known_n=known, blind_n=blind, known=_ratio(known, true),
        blind=_ratio(blind, true),
    )  # fmt: skip


def _ratio(found: Floats, true: Floats) -> float:
    rest = slice(_SKIPPED, true.size - max(_DELAYS))
    return float(np.std(found[rest] - true[rest]) / np.std(true[rest]))


def _two_modes() -> ForceModel:
    parts: list[tuple[Floats, list[float], list[float]]] = []
    for hz, damping, share in zip(independent.KALMAN_MODES_HZ, (0.12, 0.08), (0.7, 0.3), strict=True):
        omega = 2.0 * math.pi * hz
        parts.append(
            (np.array([[0.0, 1.0], [-(omega**2), -2.0 * damping * omega]]), [0.0, share * omega**2], [1.0, 0.0])
        )
    return ForceModel(
        a=np.asarray(block_diag(*(part[0] for part in parts)), dtype=np.float64),
        b=np.array([value for part in parts for value in part[1]]),
        c=np.array([value for part in parts for value in part[2]]),
    )


def other_rows(study: Kalman) -> list[Row]:
    """Return the rows of the three other sources and of three inertias."""
    return [*_fitted(), *_damping(), *_kalman(study), *_triple()]


def _fitted() -> list[Row]:
    drive = drive_of("cmx-1100v").drive
    taps = fitted_taps(_HALF, _HARMONICS, _SPINDLE_HZ, _RATE_HZ)
    source = "fitting paper, section V"
    expected = independent.FIT_SQUARE_SUM
    rows = [
        checked(source, "sum of the squares of the taps, N 10, N_max 4, 1300 1/min", expected,
                float((taps**2).sum()), within=2e-4),
    ]  # fmt: skip
    variances: list[float] = []
    for edge, ratio in independent.FIT_STD_RATIO.items():
        section = smoothed_inertia(edge, _RATE_HZ, drive.stage_mass, drive.stage_damping)
        bare, fitted = filtered_variance(np.ones(1), section), filtered_variance(taps, section)
        variances.append(bare)
        rows.append(checked(f"{source}, Fig. 9", f"noise of the scale, fitted over not, Q at {edge:g} Hz", ratio,
                            math.sqrt(fitted / bare), within=0.02 * ratio, why="standard deviations"))  # fmt: skip
    travel = drive.ratio
    motor = smoothed_inertia(150.0, _RATE_HZ, drive.motor_inertia / travel, drive.motor_damping / travel)
    expected = independent.FIT_VARIANCE
    growth = float(min(np.diff(variances)) / variances[0])
    return [
        *rows,
        near("fitting paper, Table I", "travel per radian", print_.FIT_TRAVEL_MM, 1e3 * travel, "mm", within=0.005,
             why="12 mm of lead; the print is rounded"),
        near("fitting paper, section VI", "spindle at 1300 1/min", print_.FIT_SPINDLE_HZ, _SPINDLE_HZ, "Hz",
             within=0.1 * _LAST_DIGIT, why="the print is rounded"),
        checked("fitting paper, Fig. 5", "variance by the rotary encoder, 12 times over count squared, Q at 150 Hz",
                expected["rotary"], filtered_variance(np.ones(1), motor), "N2/rad2", within=2e-3 * expected["rotary"],
                why="Butterworth, prewarped; travel per radian rounded there to 1.91 mm"),
        checked("fitting paper, Fig. 5", "variance by the scale, 12 times over count squared, Q at 150 Hz",
                expected["linear"], variances[0], "N2/m2", within=1e-3 * expected["linear"]),
        said("fitting paper, section IV", "least growth of the variance from one edge of Q to the next, over the first",
             "more significant, > 0", growth, growth > 0.0, why="150, 300, 450 Hz"),
        said("fitting paper, section VI", "noise fitted over not, Q at 150 Hz", "reduced, < 1",
             float(rows[1].computed or 0.0), float(rows[1].computed or 1.0) < 0.5, why="below half"),
    ]  # fmt: skip


def _damping() -> list[Row]:
    named = drive_of("damping-stage")
    drive, rate = believed(named), named.settings.sample_rate_hz
    mode = resonance(drive)
    low, high = print_.DAMPING_BAND_HZ
    printed_stiffness = dataclasses.replace(drive, screw_stiffness=print_.DAMPING_STIFFNESS)
    tooth_pass = 2.0 * print_.DAMPING_SPEED_RPM / 60.0
    plain = complex(response_of(damping_observer(drive, rate, corrected=False), drive, [367.0])[0])
    right = complex(response_of(damping_observer(drive, rate), drive, [367.0])[0])
    at_peak = abs(complex(response_of(damping_observer(drive, rate, corrected=False), drive, [mode.frequency_hz])[0]))
    (gain, angle), (gain_right, angle_right) = independent.DAMPING_GAIN, independent.DAMPING_CORRECTED
    source = "damping paper, section 3"
    why = (
        f"erratum: K_r is printed as {print_.DAMPING_STIFFNESS:g} N/m, which gives "
        f"{resonance(printed_stiffness).frequency_hz:.1f} Hz; 3.59e7 N/m is meant"
    )
    return [
        near(source, "A", print_.DAMPING_SHARE, mode.share, "", within=1e-3 * _LAST_DIGIT, why="the print is rounded"),
        said(source, "resonance inside the pass band", f"{low:g}...{high:g}", mode.frequency_hz,
             low < mode.frequency_hz < high, unit="Hz", why=why),
        checked(source, "A, more digits", independent.DAMPING_SHARE, mode.share, within=1e-4),
        checked(source, "resonance", independent.DAMPING_HZ, mode.frequency_hz, "Hz", within=0.3),
        near(source, "tooth passing at 11000 1/min", print_.DAMPING_TOOTH_PASS_HZ, tooth_pass, "Hz",
             within=_LAST_DIGIT, why="the print is rounded"),
        said("damping paper, section 2.2", "gain of eq. (3) at the resonance", "1", at_peak, abs(at_peak - 1.0) < 0.02,
             why="2 %: eq. (2) is of leading order in the damping"),
        checked(source, "gain of eq. (3) at 367 Hz", gain, abs(plain), within=0.005),
        checked(source, "its phase", angle, degrees(plain), "deg", within=0.5),
        said(source, "estimate over force at tooth passing, 367 Hz", "accurately", abs(plain),
             abs(plain - 1.0) < 0.1, why=f"off resonance inertia and spring weigh too: eq. (3) is {degrees(plain):.1f} "
             f"deg ahead there; with them put in it is {abs(right):.3f} at {degrees(right):.1f} deg"),
        checked(source, "gain with inertia and spring put in, 367 Hz", gain_right, abs(right), within=0.01),
        checked(source, "its phase", angle_right, degrees(right), "deg", within=1.0),
    ]  # fmt: skip


def _kalman(study: Kalman) -> list[Row]:
    (known, blind), rate = independent.KALMAN, print_.SERVO_RATE_HZ
    source = "current thesis, section 7.5"
    what = "error over force, tooth passing at 55 Hz between modes at 32 and 88 Hz"
    why = "of that plant only the frequencies are known, so its value is a bound here; 1 N of noise"
    hertz = np.arange(1.0, rate)
    folded = float(hertz[[alias_hz(f, rate) < f for f in hertz]].min()) - 1.0
    bent = alias_hz(print_.ALIASED_TOOTH_PASS_HZ, rate)
    half, tooth = print_.CUT_LINES_HZ
    cut = study_kalman(tooth, runout=0.4, drifts=(200.0,))
    gains = [
        abs(line(cut.known_n[_SKIPPED:], hz, rate) / line(cut.true_n[_SKIPPED:], hz, rate)) for hz in (half, tooth)
    ]
    worst = float(max(abs(gain - 1.0) for gain in gains))
    return [
        bounded(source, f"{what}, lines in the model", known, study.known, why=why),
        checked(source, f"{what}, best without", blind, study.blind, within=0.2 * blind,
                why="over how fast the force may wander, its delay of a sample granted"),
        near("current thesis, chapter 10", "tooth passing may not be above, 250 Hz sampling", print_.NYQUIST_HZ,
             folded, "Hz", within=1.0, expected=print_.CORRECTED_NYQUIST_HZ,
             why="erratum: 250 Hz is the sampling rate; aliases begin at half of it"),
        said("current thesis, section 6.2.2", "tooth passing at 140 Hz, sampled at 250 Hz, shows at",
             "aliasing", bent, bent < print_.ALIASED_TOOTH_PASS_HZ, unit="Hz", why="folded about 125 Hz"),
        said("current thesis, section 9.2.2", "lines at 30 and 60 Hz of the estimate: largest error of an amplitude",
             "the same components", worst, worst < 0.2, why="20 %; tooth passing at 60 Hz, run-out at 30 Hz"),
        *_runout(),
    ]  # fmt: skip


def _runout() -> list[Row]:
    """Return the line at half of tooth passing that one deeper tooth of two makes."""
    values: list[float] = []
    for deeper in (0.0, 5e-6):
        milling = Milling(
            spindle_hz=40.0, teeth=2, feed_per_tooth=30e-6, tool_diameter=6e-3, axial_depth=1e-3, radial_depth=1e-3,
            tangential_coefficient=1800e6, radial_coefficient=820e6, runout=deeper,
        )  # fmt: skip
        rate = 8000.0
        force = milling.force((np.arange(8000) + 0.5) / rate)
        values.append(abs(line(force, 40.0, rate)) / abs(line(force, 80.0, rate)))
    return [
        said("current thesis, section 6.2.2", "line at half of tooth passing over at it, with run-out",
             "attributed to run-out, > 0", values[1], values[1] > 0.05 > values[0],
             why=f"5 um at 30 um per tooth; without run-out {values[0]:.1e}"),
    ]  # fmt: skip


def three_inertias() -> TripleAxis:
    """Return the drive of section 2.6.2, with the damping of machine B in proportion."""
    rotor, nut, stage = _TRIPLE_KG
    torsion, spring = _TRIPLE_N_PER_M
    travel = LEAD / (2.0 * math.pi)
    return TripleAxis(
        lead=LEAD, rotor_inertia=rotor * travel**2, rotor_damping=60.0 * rotor * travel**2, nut_mass=nut,
        nut_damping=60.0 * nut, stage_mass=stage, stage_damping=60.0 * stage, torsion_stiffness=torsion,
        torsion_damping=5e-5 * torsion, screw_stiffness=spring, screw_damping=5e-5 * spring,
    )  # fmt: skip


def triple_gains(hz: Floats) -> dict[str, np.ndarray]:
    """Return estimate over force on a drive of three inertias by models of one, two and three, shape (k,) each."""
    drive, rate = three_inertias(), 20_000.0
    seen = drive.sensed(hz)
    dual = NominalFeedDrive(
        lead=drive.lead, rotor_inertia=drive.rotor_inertia + drive.nut_mass * (LEAD / (2.0 * math.pi)) ** 2,
        rotor_damping=drive.rotor_damping + drive.nut_damping * (LEAD / (2.0 * math.pi)) ** 2,
        stage_mass=drive.stage_mass, stage_damping=drive.stage_damping, screw_stiffness=drive.screw_stiffness,
        screw_damping=drive.screw_damping, motor_resolution=0.0, stage_resolution=0.0, motor_delay=0.0,
        stage_delay=0.0, thrust_delay=0.0, omega_current=math.inf,
    )  # fmt: skip
    observers: dict[str, Any] = {
        "three, MEDOB": triple_observer(drive, rate),
        "three, first mode": triple_observer(drive, rate, mode="first"),
        "two, MEDOB": linear_observer("medob", dual, rate),
        "two, vibration mode": linear_observer("vibration", dual, rate),
        "one, DOB": linear_observer("dob", dual, rate),
    }
    gains: dict[str, np.ndarray] = {}
    for name, observer in observers.items():
        weights = observer.weights(hz)[:, 0]
        columns = [0, 1, 2] if name.startswith("three") else [0, 2]
        gains[name] = (weights[:, :-1] * seen[:, columns]).sum(axis=1) / ideal_response(observer, hz)
    return gains


def _triple() -> list[Row]:
    drive = three_inertias()
    frequency, shapes = drive.modes()
    source = "section 2.6.2"
    rows = [
        near(source, f"natural frequency {order} of the drive of three inertias", printed, float(frequency[order]),
             "Hz", within=_LAST_DIGIT, why="stiffnesses chosen for the printed frequencies; masses 60, 20, 6.6 kg")
        for order, printed in enumerate(print_.TRIPLE_HZ, start=1)
    ]  # fmt: skip
    rows += [
        checked("eq. (2-57)", f"phi_t of vibration mode {order}", expected, float(shapes[2, order]), within=1e-4,
                why="the print has M_m for M_r")
        for order, expected in enumerate(independent.TRIPLE_SHAPE, start=1)
    ]  # fmt: skip
    low, *at = (triple_gains(np.array([hz])) for hz in (20.0, *print_.TRIPLE_HZ))
    slow = max(abs(complex(low[name][0]) - 1.0) for name in ("three, MEDOB", "two, MEDOB", "one, DOB"))
    rows.append(said(f"{source}, Fig. 2-9", "largest error at 20 Hz, DOB and MEDOB of any model", "accurately", slow,
                     slow < 0.05,
                     why="5 %"))  # fmt: skip
    for name in ("two, MEDOB", "two, vibration mode", "one, DOB"):
        error = max(abs(complex(gains[name][0]) - 1.0) for gains in at)
        rows.append(said(f"{source}, Fig. 2-9", f"model of {name}: larger error at 366 and 770 Hz", "decreases", error,
                         error > 0.2, why="more than 20 %"))  # fmt: skip
    for name in ("three, MEDOB", "three, first mode"):
        error = max(abs(complex(gains[name][0]) - 1.0) for gains in at)
        rows.append(said(f"{source}, section 2.7", f"model of {name}: larger error at 366 and 770 Hz",
                         "as many sensors as inertias", error, error < 0.02, why="2 %"))  # fmt: skip
    return rows
