"""Every estimator on the two slides of a turret."""

from dataclasses import replace

import numpy as np
import pytest

from chatter import LoadSideObserver
from chatter.observers.named import NAMES
from chatter.observers.stage_model import NominalControl
from chatter.observers.turret import turret_observer
from tests.chatter.test_load_side import FINE, NTY3, RATE, phasor, signals

CONTROL = NominalControl(
    position_gain=40.0, velocity_gain=160.0, disturbance_bandwidth=300.0, derivative_bandwidth=6283.0
)
GIVEN = {"controls": (CONTROL, CONTROL), "spindle_hz": 20.0}


@pytest.mark.parametrize("name", NAMES)
def test_all_work_the_same_way(name):
    rng = np.random.default_rng(0)
    moved = [np.cumsum(1e-9 * rng.standard_normal((400, 2)), axis=0) for _ in range(2)]
    thrust = rng.standard_normal((400, 2))
    whole, parts = (turret_observer(name, NTY3, RATE, **GIVEN) for _ in range(2))
    parts.prepare()
    expected = whole.update(*moved, thrust)
    cuts = ((0, 90), (90, 91), (91, 400))
    got = [parts.update(*(m[a:b] for m in moved), thrust[a:b]) for a, b in cuts]
    np.testing.assert_allclose(np.concatenate(got), expected, rtol=0, atol=1e-12 * np.abs(expected).max())
    assert expected.shape == (400, 2)
    state = parts.snapshot()
    again = parts.update(*moved, thrust)
    parts.restore(state)
    np.testing.assert_array_equal(parts.update(*moved, thrust), again)
    assert 0.0 <= whole.latency < 0.02


def test_load_side_is_the_one_of_the_loop():
    motor, stage = signals(NTY3, (100.0, 50.0), samples=300)
    named = turret_observer("load_side", NTY3, RATE).update(motor, stage)
    np.testing.assert_array_equal(named, LoadSideObserver(NTY3, RATE).update(motor, stage))


def test_optimal_weight_leaves_the_motor_of_a_standing_turret_almost_out():
    observer = turret_observer("optimal", NTY3, RATE, band_hz=(500.0, 750.0))
    motor, stage = signals(FINE, (100.0, 50.0), samples=3000)
    got = phasor(observer.update(motor, stage, np.zeros_like(motor)), 612.0)
    np.testing.assert_allclose(np.abs(got), [100.0, 50.0], rtol=0.06)


def test_what_an_estimator_needs_is_asked_for():
    with pytest.raises(ValueError, match="spindle_hz must be given"):
        turret_observer("fitted", NTY3, RATE)
    with pytest.raises(ValueError, match="control must be given"):
        turret_observer("kalman", NTY3, RATE)
    with pytest.raises(ValueError, match="name must be one of"):
        turret_observer("all", NTY3, RATE)


def test_a_hunting_motor_count_makes_no_line_in_a_standing_turret():
    motor, stage = signals(NTY3, (100.0, 50.0), samples=3000)
    hunting = 66.7e-9 * (np.arange(3000) // 14 % 2)[:, None] * np.ones(2)  # one count to and fro, 321 Hz
    sound, still = (turret_observer(name, NTY3, RATE) for name in ("load_side", "standing"))
    calm = np.zeros_like(stage)
    made = []
    for observer in (sound, still):
        shaken = observer.update(motor + hunting, stage, calm)
        observer.reset()
        made.append(np.abs(phasor(shaken - observer.update(motor, stage, calm), 9000.0 / 28)))
    assert (made[1] < 0.015 * made[0]).all()
    still.reset()
    np.testing.assert_allclose(np.abs(phasor(still.update(motor, stage, calm), 612.0)), [100.0, 50.0], rtol=0.05)


def test_what_a_thrust_does_to_a_motor_is_no_force_of_the_cut():
    time, hz, thrust = np.arange(9000) / RATE, 325.0, 180.0
    swing = 2j * np.pi * hz
    pushed, away = [], []
    for drive in NTY3.drives:
        lag = drive.omega_current / (swing + drive.omega_current) * np.exp(-swing * (drive.thrust_delay + 0.5 / RATE))
        pushed.append(thrust * lag / (drive.rotor_mass * swing**2) * np.exp(-swing * drive.motor_delay))
        away.append(drive.screw_stiffness * abs(pushed[-1]))  # what a motor taken to stand would leave, some 2 N
    motor = (np.array(pushed) * np.exp(swing * time)[:, None]).real
    push = np.repeat(thrust * np.exp(swing * time).real[:, None], 2, axis=1)
    fine = replace(NTY3, **{a: replace(getattr(NTY3, a), motor_resolution=0.0) for a in ("x1", "y1")})
    given = motor, np.zeros_like(motor), push
    force, known = (turret_observer(name, fine, RATE).update(*given)[4500:] for name in ("standing", "load_side"))
    assert min(away) > 1.0
    assert (np.abs(phasor(force - known, hz)) < 0.1 * np.abs(phasor(known, hz))).all()
