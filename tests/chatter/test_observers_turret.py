"""Every estimator on the two slides of a turret."""

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
    loud, quiet = (abs(phasor(o.update(motor + hunting, stage), 9000.0 / 28)) for o in (sound, still))
    assert (quiet < 0.15 * loud).all()
    still.reset()
    np.testing.assert_allclose(np.abs(phasor(still.update(motor, stage), 612.0)), [100.0, 50.0], rtol=0.05)
