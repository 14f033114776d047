"""One interface for all estimators, and the model of the loop that the Kalman filter takes."""

from dataclasses import replace

import numpy as np
import pytest

from chatter.observers.loop_model import loop_model
from chatter.observers.named import NAMES, observer
from chatter.observers.prediction import Scene
from chatter.observers.stage_model import sensed
from tests.chatter.test_observers_family import RATE, A
from tests.chatter.test_observers_prediction import AT_ONCE, CONTROL_A

GIVEN = {
    "control": CONTROL_A, "scene": Scene(band_hz=(20.0, 200.0)), "spindle_hz": 60.0, "tooth_pass_hz": 120.0,
}  # fmt: skip


@pytest.mark.parametrize("name", NAMES)
def test_all_work_the_same_way(name):
    rng = np.random.default_rng(0)
    signals = [np.cumsum(1e-9 * rng.standard_normal(600)) for _ in range(2)] + [rng.standard_normal(600)]
    whole, parts = (observer(name, A, RATE, **GIVEN) for _ in range(2))
    parts.prepare()
    expected = whole.update(*signals)
    got = [parts.update(*(s[a:b] for s in signals)) for a, b in ((0, 1), (1, 250), (250, 600))]
    np.testing.assert_allclose(np.concatenate(got), expected, rtol=0, atol=1e-12 * np.abs(expected).max())
    assert whole.name == name
    assert 0.0 <= whole.latency < 0.01
    assert whole.bandwidth_hz > 0.0
    state = parts.snapshot()
    again = parts.update(*signals)
    parts.restore(state)
    np.testing.assert_array_equal(parts.update(*signals), again)
    parts.reset()
    np.testing.assert_allclose(parts.update(*signals), expected, rtol=0, atol=1e-12 * np.abs(expected).max())


def test_model_of_the_loop_is_that_of_the_sensors():
    hz = np.array([0.5, 10.0, 40.0, 100.0, 335.0])
    np.testing.assert_allclose(
        loop_model(AT_ONCE, CONTROL_A).response(hz), sensed(AT_ONCE, hz, control=CONTROL_A)[:, 2], rtol=1e-6
    )
    lag = replace(AT_ONCE, omega_current=3000.0)
    np.testing.assert_allclose(
        loop_model(lag, CONTROL_A).response(hz), sensed(lag, hz, control=CONTROL_A)[:, 2], rtol=1e-6
    )
    got, expected = loop_model(A, CONTROL_A).response(hz), sensed(A, hz, control=CONTROL_A)[:, 2]
    np.testing.assert_allclose(got, expected, rtol=2e-3)


def test_a_loop_without_cancellation_is_modelled_too():
    plain, hz = replace(CONTROL_A, disturbance_bandwidth=0.0), np.array([1.0, 30.0, 200.0])
    np.testing.assert_allclose(
        loop_model(AT_ONCE, plain).response(hz), sensed(AT_ONCE, hz, control=plain)[:, 2], rtol=1e-6
    )


def test_what_an_estimator_needs_is_asked_for():
    for name, field in (("optimal", "scene"), ("fitted", "spindle_hz"), ("kalman", "control")):
        with pytest.raises(ValueError, match=f"{field} must be given for the estimator {name}"):
            observer(name, A, RATE)
    with pytest.raises(ValueError, match="name must be one of thrust, dob"):
        observer("mystery", A, RATE)
