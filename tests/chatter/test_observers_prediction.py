"""What an estimate will be wrong by: published responses of machines A and B, counts, and the best weight."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from chatter.filters import butterworth, response
from chatter.observers.balance import held
from chatter.observers.choice import optimal_observer, optimal_weight
from chatter.observers.family import linear_observer, two_encoder
from chatter.observers.prediction import (
    Scene,
    filtered_variance,
    least_forces,
    predicted_error,
    quantisation_variance,
    response_of,
)
from chatter.observers.stage_model import NominalControl, sensed, with_errors
from tests.chatter.test_observers_family import RATE, A

CONTROL_A = NominalControl(
    position_gain=50.0, velocity_gain=200.0, disturbance_bandwidth=1000.0, derivative_bandwidth=5000.0
)
B = replace(
    A, rotor_inertia=5.2e-5, rotor_damping=6.5e-3, stage_mass=6.6, stage_damping=820.0, screw_stiffness=40.5e6,
    screw_damping=1800.0, motor_delay=0.2e-3, stage_delay=0.2e-3, thrust_delay=0.2e-3, omega_current=5000.0,
)  # fmt: skip
AT_ONCE = replace(A, motor_delay=0.0, stage_delay=0.0, thrust_delay=0.0, omega_current=np.inf)
SCALES = replace(A, motor_resolution=38.15e-9, stage_resolution=20e-9)
HZ = np.linspace(20.0, 1000.0, 1961)


def gain(name, nominal, drive, hz, compensation="full", **loop):
    observer = linear_observer(name, nominal, RATE, compensation=compensation)
    return response_of(observer, drive, hz, **loop)


def good_up_to(gain):
    """Highest frequency up to which the gain is within 10 % (Hz)."""
    bad = np.flatnonzero(np.abs(np.abs(gain) - 1.0) > 0.1)
    return HZ[bad[0]] if bad.size else HZ[-1]


@pytest.mark.parametrize(("drive", "peak", "at", "ten_percent"), [(A, 4.36, 335.8, 103.0), (B, 6.21, 407.1, 123.0)])
def test_a_rigid_drive_peaks_where_published_in_open_loop(drive, peak, at, ten_percent):
    fine = np.linspace(20.0, 600.0, 11601)
    size = np.abs(gain("dob", drive, drive, fine))
    assert size.max() == pytest.approx(peak, rel=0.01)
    assert fine[size.argmax()] == pytest.approx(at, abs=0.5)
    assert fine[np.flatnonzero(size > 1.1)[0]] == pytest.approx(ten_percent, abs=2.0)


@pytest.mark.parametrize(("factor", "size", "angle"), [(0.5, 2.12, -60.0), (1.5, 2.06, 63.0)])
def test_wrong_mass_in_closed_loop_is_as_published(factor, size, angle):
    wrong = with_errors(AT_ONCE, stage_mass=factor - 1.0)
    both = [gain(n, wrong, AT_ONCE, [335.0], control=CONTROL_A, sample_rate_hz=1e6)[0] for n in ("vibration", "medob")]
    assert abs(both[0]) == pytest.approx(size, rel=0.01)
    assert np.degrees(np.angle(both[0])) == pytest.approx(angle, abs=1.0)
    loop = {"control": CONTROL_A, "sample_rate_hz": RATE}
    vibration, medob = (gain(n, wrong, AT_ONCE, [335.0], **loop)[0] for n in ("vibration", "medob"))
    assert abs(vibration / medob) == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize(("factor", "size"), [(0.5, 0.448), (1.5, 1.552)])
def test_wrong_stiffness_acts_on_the_vibration_mode_as_published(factor, size):
    wrong = with_errors(A, screw_stiffness=factor - 1.0)
    assert abs(gain("vibration", wrong, A, [1.0], control=CONTROL_A)[0]) == pytest.approx(size, abs=0.002)
    assert abs(gain("medob", wrong, A, [1.0], control=CONTROL_A)[0]) == pytest.approx(1.0, abs=0.002)


@pytest.mark.parametrize(
    ("name", "compensation", "up_to"),
    [("medob", "full", 1000.0), ("medob", "thrust", 152.0), ("medob", "none", 62.0), ("thrust", "full", 27.0)],
)
def test_dead_times_limit_the_band_as_published(name, compensation, up_to):
    found = good_up_to(gain(name, A, A, HZ, compensation, control=CONTROL_A, sample_rate_hz=RATE))
    assert found == pytest.approx(up_to, rel=0.015)


@pytest.mark.parametrize("name", ["medob", "vibration", "load_side"])
def test_exact_parameters_leave_three_percent_to_500_hz(name):
    size = np.abs(gain(name, A, A, HZ[HZ <= 500.0], control=CONTROL_A, sample_rate_hz=RATE))
    np.testing.assert_allclose(size, 1.0, atol=0.003)  # also where the loop is lightly damped, at 174 Hz


def test_thrust_is_weighed_by_its_mean_under_the_hat():
    x, steps = 0.15, 40_000
    rng = np.random.default_rng(0)
    u, y = rng.standard_normal(2), [0.3]
    t = (np.arange(steps) + 0.5) / steps
    segments = []
    for command in u:
        segments.append(command + (y[-1] - command) * np.exp(-x * t))
        y.append(command + (y[-1] - command) * np.exp(-x))
    mean = np.mean(segments[0] * t) + np.mean(segments[1] * (1.0 - t))
    level, slope, curve = held(x * RATE, RATE)
    assert level * y[1] + slope * (y[2] - y[0]) + curve * (y[2] - 2 * y[1] + y[0]) == pytest.approx(mean, rel=1e-8)
    np.testing.assert_allclose(held(1e-9, RATE), [1.0, 0.0, 1 / 6], atol=1e-12)
    np.testing.assert_allclose(held(2e-3 * RATE, RATE), [1.0, 0.0, 1 / 6], atol=1e-3)
    np.testing.assert_allclose(held(np.inf, RATE), [1.0, 0.25, 0.25])


def test_least_forces_are_those_of_the_table():
    sizes = least_forces(SCALES, RATE)
    names = ("rotor_inertia", "stage_inertia", "rotor_damping", "stage_damping")
    np.testing.assert_allclose([sizes[n] for n in names], [915.6, 49.6, 2.77, 0.148], rtol=1e-3)
    of_b = least_forces(replace(B, motor_resolution=0.596e-9, stage_resolution=0.244e-9), 10_000.0)
    np.testing.assert_allclose([of_b[n] for n in names], [4.89, 0.161, 0.061, 0.0020], rtol=0.01)


def test_counts_of_the_motor_weigh_53_to_4_9_to_1():
    noise = [np.sqrt(quantisation_variance(linear_observer(n, SCALES, RATE))[0]) for n in NAMES]
    np.testing.assert_allclose(np.array(noise) / noise[2], [53.0, 4.9, 1.0], rtol=0.003)


NAMES = ("medob", "vibration", "load_side")


@given(
    taps=st.lists(st.floats(-5.0, 5.0), min_size=1, max_size=7).filter(lambda t: max(map(abs, t)) > 1e-3),
    edge=st.floats(0.02, 0.4),
)
def test_variance_by_lyapunov_is_that_of_the_spectrum(taps, edge):
    sections = butterworth(4, edge, 1.0)
    hz = (np.arange(20_000) + 0.5) / 40_000
    turn = np.exp(-2j * np.pi * hz[:, None] * np.arange(len(taps)))
    expected = np.mean(np.abs((turn @ taps) * response(sections, hz, 1.0)) ** 2)
    assert filtered_variance(np.array(taps), sections) == pytest.approx(expected, rel=1e-6, abs=1e-14)


def test_counts_simulated_scatter_as_predicted():
    rng = np.random.default_rng(3)
    wander = np.cumsum(rng.standard_normal(40_000)) * 1e-6  # crosses many counts, so that their errors are independent
    observer = linear_observer("medob", SCALES, RATE)
    exact = linear_observer("medob", A, RATE)
    motor = np.rint(wander / 38.15e-9) * 38.15e-9
    error = observer.update(motor, wander, wander * 0.0) - exact.update(wander, wander, wander * 0.0)
    assert np.std(error[200:]) == pytest.approx(np.sqrt(quantisation_variance(observer)[0]), rel=0.1)


SCENES = [
    Scene(band_hz=(50.0, 500.0), force=100.0, control=CONTROL_A),
    Scene(band_hz=(5.0, 100.0), force=100.0, motor_friction=0.5, control=CONTROL_A,
          uncertainty={"screw_stiffness": 0.05, "stage_mass": 0.02}),
    Scene(band_hz=(50.0, 500.0), force=100.0, motor_friction=5.0, control=CONTROL_A,
          uncertainty={"screw_stiffness": 0.05, "stage_mass": 0.02, "rotor_inertia": 0.02, "thrust": 0.03}),
    Scene(band_hz=(500.0, 750.0), force=30.0, motor_friction=20.0, uncertainty={"screw_stiffness": 0.1}),
]  # fmt: skip


@pytest.mark.parametrize("scene", SCENES)
@pytest.mark.parametrize("drive", [SCALES, replace(B, motor_resolution=0.596e-9, stage_resolution=0.244e-9)])
def test_the_best_weight_is_never_worse_than_a_fixed_one(scene, drive):
    best = predicted_error(optimal_observer(drive, RATE, scene), scene).total
    for name in NAMES:
        assert best <= predicted_error(linear_observer(name, drive, RATE), scene).total * (1.0 + 1e-9)


def test_the_best_weight_is_better_where_errors_trade():
    best = predicted_error(optimal_observer(SCALES, RATE, SCENES[1]), SCENES[1]).total
    fixed = min(predicted_error(linear_observer(n, SCALES, RATE), SCENES[1]).total for n in NAMES)
    assert best < 0.8 * fixed


@pytest.mark.parametrize("scene", SCENES[1:])
def test_the_best_weight_is_the_bottom_of_the_error(scene):
    at = optimal_weight(SCALES, RATE, scene)
    around = [predicted_error(two_encoder(SCALES, RATE, at + d), scene).total for d in (-0.05, 0.0, 0.05)]
    assert around[1] <= min(around[0], around[2])


def test_stage_model_obeys_newton_and_hooke():
    slow = sensed(replace(A, rotor_damping=1e9, motor_delay=0.0, stage_delay=0.0), [1e-3])[0]  # the motor stands still
    assert slow[1].real == pytest.approx(-1.0 / A.screw_stiffness, rel=1e-3)
    high = sensed(replace(A, stage_delay=0.0), [20_000.0])[0, 1]
    assert high.real == pytest.approx(1.0 / (A.stage_mass * (2 * np.pi * 20_000.0) ** 2), rel=0.01)


def test_scenes_that_cannot_be_are_refused():
    with pytest.raises(ValueError, match="band_hz must be"):
        Scene(band_hz=(500.0, 100.0))
    with pytest.raises(ValueError, match="force must be at least 0"):
        Scene(band_hz=(1.0, 2.0), force=-1.0)
    with pytest.raises(ValueError, match="uncertainty must name parameters"):
        Scene(band_hz=(1.0, 2.0), uncertainty={"mass": 0.1})
    with pytest.raises(ValueError, match="uncertainty of lead must be in"):
        Scene(band_hz=(1.0, 2.0), uncertainty={"lead": 1.0})
    with pytest.raises(ValueError, match="position_gain must be positive"):
        replace(CONTROL_A, position_gain=0.0)
