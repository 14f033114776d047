"""Which estimator to take: all of them in six situations with what goes wrong in practice, and the weight that trades.

No source has these; they are for the user. Every drive is as its file describes it, with its dead times, counts and
friction; the observers believe 3 % too much mass, 2 % too much inertia and 7 % too little stiffness.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from chatter import BiquadFilter, butterworth
from chatter.observers.choice import optimal_weight
from chatter.observers.family import two_encoder
from chatter.observers.linear import LinearObserver
from chatter.observers.named import observer
from chatter.observers.prediction import PredictedError, Scene, predicted_error
from services.drives import NamedDrive
from services.messages import Floats
from services.reproduce.estimators.guide import CHATTER_HZ, GROWN_S, turret_block
from services.reproduce.estimators.kit import believed, drive_of, loop_of
from turning_sim import AxisBlock, Milling, ServoAxis, thesis_condition

NAMES = ("load_side", "standing", "blended", "optimal", "vibration", "medob", "kalman", "dob", "thrust")
WRONG = {"stage_mass": 1.03, "rotor_inertia": 1.02, "screw_stiffness": 0.93}
UNKNOWN = {"stage_mass": 0.03, "rotor_inertia": 0.02, "screw_stiffness": 0.07, "thrust": 0.02}
FRICTION_LEFT = 0.1
"""Part of the dry friction of a standing motor that may act at any moment."""
_IDLE_S, _CUT_S, _FEED_S = 0.3, 0.5, 1.0
_THRUST_NOISE_N = 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Situation:
    """One situation and how wrong every estimator is in it.

    Attributes
    ----------
    title, note
        What happens; which drive, and what makes it hard.
    error
        Estimator -> root mean square of the error over the standard deviation of the force.
    """

    title: str
    note: str
    error: dict[str, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Trade:
    """Predicted errors of the two-encoder family over its weight in one scene.

    Attributes
    ----------
    title, note
        The scene.
    weight
        lambda, shape (k,).
    parts_n
        quantisation, friction, parameters, structure, total -> standard deviation (N), shape (k,).
    best, fixed
        Optimal lambda; fixed choice -> lambda.
    best_n, fixed_n
        Total error there (N).
    """

    title: str
    note: str
    weight: Floats
    parts_n: dict[str, Floats]
    best: float
    best_n: float
    fixed: dict[str, float]
    fixed_n: dict[str, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Cut:
    """Signals to be judged: `idle` is the same motion without a cut; `skipped` samples settle."""

    named: NamedDrive
    block: AxisBlock
    idle: AxisBlock | None
    skipped: int
    band_hz: tuple[float, float]
    teeth_hz: float
    spindle_hz: float


def study_situations() -> tuple[Situation, ...]:
    """Simulate and judge all situations."""
    plans: tuple[tuple[str, str, Callable[[], _Cut]], ...] = (
        ("feeds, 17 Hz slot", "machine B, idling run taken off", lambda: _feeding(500.0)),
        ("feeds, 200 Hz slot", "machine B, idling run taken off", lambda: _feeding(6000.0)),
        ("stands, 67 Hz slot", "machine B, motor sticks", lambda: _standing("machine-b", 3)),
        ("coarse encoder, 200 Hz cut", "machine A, 1 mm deep", lambda: _standing("machine-a", 2)),
        (f"rolling guide, {CHATTER_HZ:.0f} Hz chatter", "turret axis X1, stands", lambda: _chatter("nty3-x1")),
        (f"sliding guide, {CHATTER_HZ:.0f} Hz chatter", "turret axis Y1, stands", lambda: _chatter("nty3-y1")),
    )
    return tuple(Situation(title=title, note=note, error=_judged(cut())) for title, note, cut in plans)


def _standing(name: str, condition: int) -> _Cut:
    named, milling = drive_of(name), thesis_condition(condition)
    rate = named.settings.sample_rate_hz
    axis = ServoAxis(named.drive, named.control, rate, seed=1)
    idle, count = round(_IDLE_S * rate), round(_CUT_S * rate)
    axis.advance(np.zeros(idle), np.zeros(idle * axis.substeps))
    block = axis.advance(np.zeros(count), milling.force(axis.force_times(count) - idle / rate))
    return _Cut(
        named=named, block=block, idle=None, skipped=count // 4, teeth_hz=milling.tooth_pass_hz,
        spindle_hz=milling.spindle_hz, band_hz=(milling.spindle_hz, named.settings.force_cutoff_hz),
    )  # fmt: skip


def _feeding(speed_rpm: float) -> _Cut:
    named = drive_of("machine-b")
    rate = named.settings.sample_rate_hz
    slot = thesis_condition(3)
    milling = Milling(
        spindle_hz=speed_rpm / 60.0, teeth=slot.teeth, feed_per_tooth=slot.feed_per_tooth,
        tool_diameter=slot.tool_diameter, axial_depth=slot.axial_depth, radial_depth=slot.radial_depth,
        tangential_coefficient=slot.tangential_coefficient, radial_coefficient=slot.radial_coefficient,
    )  # fmt: skip
    count = round(_FEED_S * rate)
    time = np.arange(count) / rate
    way = milling.feed_rate * np.where(time < 0.05, 10.0 * time**2, time - 0.025)
    blocks: list[AxisBlock] = []
    for cuts in (False, True):
        axis = ServoAxis(named.drive, named.control, rate, seed=1)
        at = axis.force_times(count)
        blocks.append(axis.advance(way, np.where(at > _IDLE_S, cuts * milling.force(at), 0.0)))
    return _Cut(
        named=named, block=blocks[1], idle=blocks[0], skipped=count // 2, teeth_hz=milling.tooth_pass_hz,
        spindle_hz=milling.spindle_hz, band_hz=(0.5 * milling.spindle_hz, named.settings.force_cutoff_hz),
    )  # fmt: skip


def _chatter(name: str) -> _Cut:
    named, block = turret_block(name, "creeps")
    return _Cut(
        named=named, block=block, idle=None, skipped=round(GROWN_S * block.sample_rate_hz), teeth_hz=40.0,
        spindle_hz=20.0, band_hz=(20.0, 750.0),
    )  # fmt: skip


def _judged(cut: _Cut) -> dict[str, float]:
    named, block, rate = cut.named, cut.block, cut.block.sample_rate_hz
    cutoff = named.settings.force_cutoff_hz
    rub = named.drive.motor_friction
    scene = Scene(
        band_hz=cut.band_hz, force=float(np.std(block.true_force[cut.skipped :])), uncertainty=UNKNOWN,
        control=loop_of(named), motor_friction=FRICTION_LEFT * rub.coulomb if rub and cut.idle is None else 0.0,
    )  # fmt: skip
    wrongly = believed(named, factors=WRONG)
    low = butterworth(4, cutoff, rate)
    true = BiquadFilter(low).update(block.true_force)[:, 0]
    index, errors = np.arange(true.size, dtype=np.float64), dict[str, float]()
    for name in NAMES:
        estimates: list[Floats] = []
        late = 0.0
        for seen in (block, cut.idle):
            if seen is None:
                continue
            made = observer(
                name, wrongly, rate, cutoff_hz=cutoff, control=loop_of(named), scene=scene,
                spindle_hz=cut.spindle_hz, tooth_pass_hz=cut.teeth_hz, thrust_noise=_THRUST_NOISE_N,
            )  # fmt: skip
            found = made.update(seen.motor_position, seen.stage_position, seen.thrust)
            late = made.age if isinstance(made, LinearObserver) else made.latency
            smooth = isinstance(made, LinearObserver)
            estimates.append(found if smooth else BiquadFilter(low).update(found)[:, 0])
        estimate = estimates[0] - estimates[1] if len(estimates) > 1 else estimates[0]
        reference = np.interp(index - late * rate, index, true)[cut.skipped :]
        error = estimate[cut.skipped :] - reference
        errors[name] = float(np.sqrt(np.mean(error**2)) / np.std(reference))
    return errors


def study_trades() -> tuple[Trade, ...]:
    """Predict the error of every member of the family in three scenes."""
    stiff = {"screw_stiffness": 0.07, "stage_mass": 0.03}
    return (
        _trade(
            "machine-a", "Feeding, 5 to 100 Hz", "machine A, 100 N, stiffness known to 7 %, idling table",
            Scene(band_hz=(5.0, 100.0), force=100.0, motor_friction=0.5, uncertainty=stiff), (-0.55, 1.25),
        ),
        _trade(
            "machine-b", "Standing, 30 to 400 Hz", "machine B, 30 N, motor sticks at 130 N",
            Scene(band_hz=(30.0, 400.0), force=30.0, motor_friction=13.0, uncertainty=UNKNOWN), (-0.55, 1.25),
        ),
        _trade(
            "nty3-x1", "Chatter, 500 to 750 Hz", "turret axis X1, 70 N, coarse rotary encoder",
            Scene(band_hz=(500.0, 750.0), force=70.0, motor_friction=30.0, uncertainty=UNKNOWN), (-0.55, 1.25),
        ),
    )  # fmt: skip


def _trade(name: str, title: str, note: str, scene: Scene, span: tuple[float, float]) -> Trade:
    named = drive_of(name)
    drive, rate, cutoff = believed(named), named.settings.sample_rate_hz, named.settings.force_cutoff_hz
    looped = Scene(
        band_hz=scene.band_hz, force=scene.force, motor_friction=scene.motor_friction, uncertainty=scene.uncertainty,
        control=loop_of(named),
    )  # fmt: skip

    def error(weight: float) -> PredictedError:
        return predicted_error(two_encoder(drive, rate, weight, cutoff_hz=cutoff), looped)

    best = optimal_weight(drive, rate, looped, cutoff_hz=cutoff)
    weights = np.unique(np.concatenate([np.linspace(*span, 91), [best]]))
    found = [error(float(weight)) for weight in weights]
    fixed = {"MEDOB": 1.0, "load side": 0.0, "vibration": -drive.mass_ratio}
    return Trade(
        title=title, note=note, weight=weights, best=best, best_n=error(best).total, fixed=fixed,
        parts_n={
            part: np.array([getattr(one, part) for one in found])
            for part in ("quantisation", "friction", "parameters", "structure", "total")
        },
        fixed_n={word: error(weight).total for word, weight in fixed.items()},
    )  # fmt: skip
