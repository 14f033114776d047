"""Fitted positions and the damping force: the published numbers, and what they are for."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from chatter.observers.damping import damping_observer, resonance
from chatter.observers.family import linear_observer
from chatter.observers.fitted import fitted_observer, fitted_taps
from chatter.observers.nominal import NominalFeedDrive
from chatter.observers.prediction import filtered_variance, quantisation_variance, response_of
from tests.chatter.test_observers_family import RATE, A, error_ratio

STAGE = NominalFeedDrive(
    lead=5e-3, rotor_inertia=36.8 * (5e-3 / (2 * np.pi)) ** 2, rotor_damping=4400.0 * (5e-3 / (2 * np.pi)) ** 2,
    stage_mass=6.7, stage_damping=802.0, screw_stiffness=3.59e7, screw_damping=3590.0, motor_resolution=38.15e-9,
    stage_resolution=20e-9, motor_delay=0.0, stage_delay=0.0, thrust_delay=0.0, omega_current=np.inf,
)  # fmt: skip


def test_taps_of_the_fit_are_those_of_the_paper():
    taps = fitted_taps(10, 4, 1300.0 / 60.0, 1000.0)
    assert taps.shape == (21,)
    assert (taps**2).sum() == pytest.approx(0.3187, abs=2e-4)
    assert taps.sum() == pytest.approx(1.0, abs=1e-9)


def lowpass_of_second_order(edge_hz, rate, mass, damping):
    """Q (M s^2 + C s) with a Butterworth Q of second order, bilinear with prewarping, as one section and its input."""
    w = 2 * rate * np.tan(np.pi * edge_hz / rate)
    k = 2 * rate
    den = np.array([k * k + np.sqrt(2) * w * k + w * w, 2 * (w * w - k * k), k * k - np.sqrt(2) * w * k + w * w])
    num = w * w * (mass * k * k * np.array([1.0, -2.0, 1.0]) + damping * k * np.array([1.0, 0.0, -1.0]))
    return np.array([np.concatenate([num, den[1:]]) / den[0]])


@pytest.mark.parametrize(("edge", "ratio"), [(150.0, 0.279), (300.0, 0.121), (450.0, 0.090)])
def test_the_fit_takes_as_much_noise_as_published(edge, ratio):
    taps = fitted_taps(10, 4, 1300.0 / 60.0, 1000.0)
    section = lowpass_of_second_order(edge, 1000.0, 260.0, 1530.0)
    found = filtered_variance(taps, section) / filtered_variance(np.ones(1), section)
    assert np.sqrt(found) == pytest.approx(ratio, abs=0.0015)


def test_noise_without_the_fit_is_that_of_the_paper():
    travel = 1.91e-3
    motor = lowpass_of_second_order(150.0, 1000.0, 4.06e-3 / travel, 7.61e-3 / travel)
    stage = lowpass_of_second_order(150.0, 1000.0, 260.0, 1530.0)
    assert filtered_variance(np.ones(1), motor) == pytest.approx(3.347e12, rel=1e-3)
    assert filtered_variance(np.ones(1), stage) == pytest.approx(5.008e16, rel=1e-3)


@given(
    half=st.integers(1, 30), harmonics=st.integers(1, 6), speed=st.floats(0.5, 60.0), phase=st.floats(0.0, 6.0),
    slope=st.floats(-1.0, 1.0),
)  # fmt: skip
def test_a_signal_of_the_basis_is_kept(half, harmonics, speed, phase, slope):
    taps = fitted_taps(half, harmonics, speed, 1000.0)
    time = np.arange(-half, half + 1) / 1000.0
    signal = 0.5 + slope * time + np.sin(2 * np.pi * harmonics * speed * time + phase)
    np.testing.assert_array_equal(taps, taps[::-1])
    assert np.abs(taps).sum() < 1e3
    assert taps @ signal == pytest.approx(0.5 + np.sin(phase), abs=1e-5)


def test_fitted_force_is_right_below_the_last_harmonic_and_late_by_half_the_stretch():
    fitted = fitted_observer(A, RATE, spindle_hz=60.0, half=40, harmonics=6)
    plain = linear_observer("medob", A, RATE)
    assert fitted.latency - plain.latency == pytest.approx(40 / RATE)
    gain = response_of(fitted, A, [60.0, 120.0, 205.0, 335.0])
    np.testing.assert_allclose(gain[:3], 1.0, atol=0.01)
    assert error_ratio(fitted, A) < 0.05


def test_fitting_lowers_what_counts_leave():
    fitted = fitted_observer(STAGE, 1000.0, spindle_hz=1300.0 / 60.0, cutoff_hz=300.0)
    plain = linear_observer("medob", STAGE, 1000.0, cutoff_hz=300.0)
    assert quantisation_variance(fitted)[0] < 0.1 * quantisation_variance(plain)[0]


def test_resonance_of_the_paper():
    mode = resonance(STAGE)
    assert mode.share == pytest.approx(0.7364, abs=2e-4)
    assert mode.frequency_hz == pytest.approx(400.5, abs=0.3)


def test_damping_force_is_right_at_resonance_and_needs_its_correction_elsewhere():
    hz = np.array([400.5, 367.0])
    plain = response_of(damping_observer(STAGE, RATE, corrected=False), STAGE, hz)
    exact = response_of(damping_observer(STAGE, RATE), STAGE, hz)
    assert abs(plain[0]) == pytest.approx(1.0, abs=0.02)
    assert abs(plain[1]) == pytest.approx(0.837, abs=0.005)
    assert np.degrees(np.angle(plain[1])) == pytest.approx(26.7, abs=0.5)
    assert abs(exact[1]) == pytest.approx(0.970, abs=0.01)
    assert np.degrees(np.angle(exact[1])) == pytest.approx(-4.0, abs=1.0)


def test_fits_that_cannot_be_are_refused():
    with pytest.raises(ValueError, match="harmonics must stay below half the sampling rate"):
        fitted_taps(10, 30, 20.0, 1000.0)
    with pytest.raises(ValueError, match="spindle_hz must be positive"):
        fitted_taps(10, 3, 0.0, 1000.0)
    with pytest.raises(ValueError, match="half must be an integer"):
        fitted_taps(0, 3, 20.0, 1000.0)
