"""Every estimator on one simulated cut, beside the force that the stage felt."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from services.drives import NamedDrive
from services.errors import InputError
from services.messages import Floats

Sensors = Literal["ideal", "real"]
TURNS = 8
"""Revolutions of the cutter that are simulated; the first is left out."""
IDLE_S = 0.3
LEAST_THRUST_NOISE_N = 0.01
"""Below this no thrust is known."""
LINE_HZ = 335.0
"""Where the gain is told: the resonance of machine A as the thesis gives it."""
UNKNOWN = {"stage_mass": 0.05, "rotor_inertia": 0.02, "screw_stiffness": 0.05, "thrust": 0.02}
"""Standard uncertainties that the optimal weight is chosen for: what an identification leaves."""
FRICTION_LEFT = 0.1
"""Part of the dry friction of a moving axis that stays unknown."""
WITHOUT_SCALE = ("thrust", "dob", "kalman")
CUTOFF_OVER_RATE = 0.4


@dataclass(frozen=True, slots=True, kw_only=True)
class AxisCut:
    """Signals of one axis in a cut, at the servo rate.

    Attributes
    ----------
    time_s, force_n
        shape (n,); the true force on the stage.
    thrust_n, motor_m, stage_m
        What the servo commands and sees, shape (n,); the stage is NaN without a scale.
    rate_hz, tooth_pass_hz, spindle_hz
        (Hz)
    idle_thrust_n
        Standard deviation of the thrust before the cut: what no force explains.
    """

    time_s: Floats
    force_n: Floats
    thrust_n: Floats
    motor_m: Floats
    stage_m: Floats
    rate_hz: float
    tooth_pass_hz: float
    spindle_hz: float
    idle_thrust_n: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """What one estimator made of a cut.

    Attributes
    ----------
    name
        Of the estimator.
    estimate_n, reference_n
        The force as estimated, and the true one through the same filters and as late, shape (n,).
    error_ratio, error_std_n
        Standard deviation of their difference, over that of the reference; the first revolution left out.
    gain_335hz
        Size of the response at 335 Hz relative to the ideal one, None where the estimator has no fixed one.
    latency_ms
        By which the estimate lags.
    predicted_error_n
        What was predicted from counts, friction and uncertainties; None where nothing predicts it.
    weight
        lambda of the two-encoder family, None outside it.
    """

    name: str
    estimate_n: Floats
    reference_n: Floats
    error_ratio: float
    error_std_n: float
    gain_335hz: float | None
    latency_ms: float
    predicted_error_n: float | None
    weight: float | None

    def row(self) -> dict[str, Any]:
        """Return the numbers, without the series."""
        return {
            "estimator": self.name,
            "error_ratio": self.error_ratio,
            "error_std_n": self.error_std_n,
            "gain_335hz": self.gain_335hz,
            "latency_ms": self.latency_ms,
            "predicted_error_n": self.predicted_error_n,
            "lambda": self.weight,
        }


def simulated_cut(named: NamedDrive, condition: int, *, sensors: Sensors, lags: bool, seed: int) -> AxisCut:
    """Cut a condition of the thesis (Table 4-2) with a drive that holds its place.

    Parameters
    ----------
    named
        The drive.
    condition
        1, 2, 3 or 4.
    sensors
        `ideal`: no counts, no noise, no friction; without lags the reference condition of the thesis. `real`: as the
        file says.
    lags
        Whether current loop, command and encoders are as late as the file says.
    seed
        Of the noise of the encoders.
    """
    from turning_sim import ServoAxis
    from turning_sim.milling_force import thesis_condition

    if named.control is None:
        raise InputError("drive", named.name, "a drive with a position loop")
    drive = named.drive if sensors == "real" else named.drive.ideal()
    if not lags:
        drive = drive.without_lags()
    milling = thesis_condition(condition)
    rate = named.settings.sample_rate_hz
    if milling.tooth_pass_hz > CUTOFF_OVER_RATE * rate:
        raise InputError(
            "drive", named.name, f"sampled fast enough for tooth passing at {milling.tooth_pass_hz:g} Hz ({rate:g} Hz)"
        )
    axis = ServoAxis(drive, named.control, rate, seed=seed)
    idle = round(IDLE_S * rate)
    before = axis.advance(np.zeros(idle), np.zeros(idle * axis.substeps)).thrust
    samples = math.ceil(TURNS / milling.spindle_hz * rate)
    block = axis.advance(np.zeros(samples), milling.force(axis.force_times(samples) - idle / rate))
    time = np.arange(samples) / rate
    return AxisCut(
        time_s=time, force_n=milling.force(time), thrust_n=block.thrust, motor_m=block.motor_position,
        stage_m=block.stage_position, rate_hz=rate, tooth_pass_hz=milling.tooth_pass_hz, spindle_hz=milling.spindle_hz,
        idle_thrust_n=float(np.std(before[idle // 2 :])),
    )  # fmt: skip


def compare(
    named: NamedDrive,
    condition: int,
    *,
    mass_error: float = 1.0,
    compensation: bool = True,
    sensors: Sensors = "ideal",
    lags: bool = False,
    names: Sequence[str] = (),
    seed: int = 1,
) -> tuple[AxisCut, list[Comparison]]:
    """Return a cut and what every estimator makes of it.

    Parameters
    ----------
    named
        The drive.
    condition
        Of the thesis, Table 4-2.
    mass_error
        Nominal over true mass of the stage.
    compensation
        Whether dead times are compensated.
    sensors, lags, seed
        See `simulated_cut`.
    names
        Estimators; all that the drive has the sensors for when empty.
    """
    from chatter.observers.named import NAMES

    cut = simulated_cut(named, condition, sensors=sensors, lags=lags, seed=seed)
    possible = NAMES if np.isfinite(cut.stage_m).all() else WITHOUT_SCALE
    for name in names:
        if name not in possible:
            raise InputError("estimator", name, f"one of {', '.join(possible)}")
    belief = _belief(named, mass_error, sensors, lags)
    return cut, [_judged(name, named, belief, cut, compensation, sensors) for name in names or possible]


def _belief(named: NamedDrive, mass_error: float, sensors: Sensors, lags: bool) -> Any:
    if not 0.05 <= mass_error <= 20.0:
        raise InputError("mass-error", mass_error, "nominal over true mass, in 0.05..20")
    factors: dict[str, float] = {"stage_mass": mass_error}
    if sensors == "ideal":
        factors |= {"motor_resolution": 0.0, "stage_resolution": 0.0}
    if not lags:
        factors |= {"motor_delay": 0.0, "stage_delay": 0.0, "thrust_delay": 0.0}
    belief = named.nominal(**factors)
    return belief if lags else dataclasses.replace(belief, omega_current=math.inf)


def _judged(
    name: str, named: NamedDrive, belief: Any, cut: AxisCut, compensation: bool, sensors: Sensors
) -> Comparison:
    from chatter import BiquadFilter, butterworth
    from chatter.observers.linear import LinearObserver
    from chatter.observers.named import observer
    from chatter.observers.prediction import predicted_error, response_of

    scene = _scene(named, cut, sensors)
    cutoff = min(named.settings.force_cutoff_hz, CUTOFF_OVER_RATE * cut.rate_hz)
    known = belief
    if name == "kalman" and not compensation:
        known = dataclasses.replace(belief, thrust_delay=0.0, motor_delay=0.0, stage_delay=0.0)
    made = observer(
        name, known, cut.rate_hz, cutoff_hz=cutoff, compensation="full" if compensation else "none",
        control=scene.control, scene=scene, spindle_hz=cut.spindle_hz, tooth_pass_hz=cut.tooth_pass_hz,
        thrust_noise=max(cut.idle_thrust_n, LEAST_THRUST_NOISE_N),
    )  # fmt: skip
    stage = np.nan_to_num(cut.stage_m)
    estimate = made.update(cut.motor_m, stage, cut.thrust_n)
    low = butterworth(4, cutoff, cut.rate_hz)
    gain = predicted = weight = None
    late = made.latency
    if isinstance(made, LinearObserver):
        late = made.age
        real = dataclasses.replace(belief, stage_mass=named.drive.stage_mass)
        loop = {"control": scene.control, "sample_rate_hz": cut.rate_hz}
        gain = float(abs(response_of(made, real, [LINE_HZ], **loop)[0]))
        predicted = predicted_error(made, scene).total
        weight = made.weight
    if not isinstance(made, LinearObserver) or name == "damping":
        estimate = BiquadFilter(low).update(estimate)[:, 0]
        late = made.latency
    reference = BiquadFilter(low).update(cut.force_n)[:, 0]
    index = np.arange(len(reference), dtype=np.float64)
    reference = np.interp(index - late * cut.rate_hz, index, reference)
    rest = slice(math.ceil(cut.rate_hz / cut.spindle_hz), None)
    error = float(np.std(estimate[rest] - reference[rest]))
    return Comparison(
        name=name, estimate_n=estimate, reference_n=reference, error_std_n=error,
        error_ratio=error / float(np.std(reference[rest])), gain_335hz=gain, latency_ms=1e3 * made.latency,
        predicted_error_n=predicted, weight=weight,
    )  # fmt: skip


def _scene(named: NamedDrive, cut: AxisCut, sensors: Sensors) -> Any:
    from chatter.observers.prediction import Scene
    from chatter.observers.stage_model import NominalControl

    names = ("position_gain", "velocity_gain", "disturbance_bandwidth", "derivative_bandwidth")
    control = NominalControl(**{name: getattr(named.control, name) for name in names})
    rub = [
        f.coulomb if f and sensors == "real" else 0.0 for f in (named.drive.motor_friction, named.drive.stage_friction)
    ]
    return Scene(
        band_hz=(cut.spindle_hz, min(named.settings.force_cutoff_hz, CUTOFF_OVER_RATE * cut.rate_hz)),
        force=float(np.std(cut.force_n)),
        motor_friction=FRICTION_LEFT * rub[0],
        stage_friction=FRICTION_LEFT * rub[1],
        uncertainty=UNKNOWN,
        control=control,
    )
