"""Swept sines, state space and cutting coefficients against what was put in."""

import numpy as np
import pytest

from chatter.identification import (
    cutting_coefficient,
    drive_of_sweep,
    model_of_response,
    slotting_coefficient,
    sweep_frf,
)
from chatter.identification.sweep import drive_response
from chatter.observers.kalman import ForceModel, KalmanObserver
from chatter.observers.loop_model import loop_model
from chatter.observers.stage_model import NominalControl
from services.drives import load_drive
from tests.chatter.sweep_runs import swept


def truth_of(drive):
    return {
        "rotor_mass": drive.motor_mass, "stage_mass": drive.stage_mass, "rotor_viscosity": drive.motor_viscosity,
        "stage_damping": drive.stage_damping, "screw_damping": drive.drive_damping,
        "screw_stiffness": drive.drive_stiffness, "motor_dead_time": drive.thrust_delay + drive.motor_delay,
        "stage_dead_time": drive.thrust_delay + drive.stage_delay,
    }  # fmt: skip


@pytest.mark.parametrize("name", ["machine-a", "machine-b"])
def test_a_drive_is_found_within_a_percent(name):
    """Friction, ripple and the encoders of machine B, with their errors, as they are (estimators, section 4 item 8)."""
    thrust, motor, stage, rate, period, drive = swept(name)
    frf = sweep_frf(thrust, motor, stage, rate, period, (5.0, 1000.0))
    fit = drive_of_sweep(frf, drive.current_bandwidth)
    for key, value in truth_of(drive).items():
        assert fit.value[key] == pytest.approx(value, rel=0.01), key
    alpha = drive.stage_mass / drive.motor_mass
    resonance = np.sqrt((1 + alpha) * drive.drive_stiffness / drive.stage_mass) / (2 * np.pi)
    assert fit.resonance_hz == pytest.approx(resonance, rel=1e-3)
    assert fit.flags == ()


def test_the_model_of_a_sweep_has_the_poles_of_the_drive():
    drive = load_drive("machine-b").drive
    hz = np.array([0.5, 2000.0])
    slow, fast = drive_response(truth_of(drive), hz, 10000.0, drive.current_bandwidth).T
    mass = drive.motor_mass + drive.stage_mass
    drag = drive.motor_viscosity + drive.stage_damping
    assert abs(slow[0]) == pytest.approx(1 / (2 * np.pi * 0.5 * drag), rel=0.01)
    assert abs(fast[0]) < 1 / (mass * (2 * np.pi * 2000.0) ** 2)


def test_too_little_of_a_sweep_is_refused():
    with pytest.raises(ValueError, match="2 periods"):
        sweep_frf(np.zeros(100), np.zeros(100), np.zeros(100), 1000.0, 80, (1.0, 100.0))


def pole_set(model):
    return np.sort_complex(np.linalg.eigvals(model.a))


@pytest.mark.parametrize("noise", [0.0, 0.01])
def test_a_response_becomes_the_model_it_came_from(noise):
    blocks = [(30.0, 0.05, 4.0), (88.0, 0.03, -2.0), (240.0, 0.02, 1.0)]
    a, b, c = np.zeros((6, 6)), np.zeros(6), np.zeros(6)
    for k, (f, zeta, gain) in enumerate(blocks):
        w = 2 * np.pi * f
        a[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = [[0.0, 1.0], [-(w**2), -2 * zeta * w]]
        b[2 * k + 1], c[2 * k] = 1.0, gain * w**2
    true = ForceModel(a=a, b=b, c=c, d=0.3)
    hz = np.linspace(2.0, 400.0, 400)
    rng = np.random.default_rng(1)
    h = true.response(hz)
    h = h * (1 + noise * (rng.standard_normal(400) + 1j * rng.standard_normal(400)))
    fit = model_of_response(hz, h)
    assert len(fit.poles) == 6
    np.testing.assert_allclose(pole_set(fit.model), pole_set(true), rtol=1e-6 + 0.5 * noise)
    np.testing.assert_allclose(np.abs(fit.model.response(hz) / true.response(hz)), 1.0, atol=1e-6 + 5 * noise)
    assert fit.flags == ()


def test_a_fitted_response_serves_the_kalman_filter():
    """A force that steps is found with the fitted model as with the one that the response came from."""
    named = load_drive("machine-b")
    names = ("position_gain", "velocity_gain", "disturbance_bandwidth", "derivative_bandwidth")
    control = NominalControl(**{name: getattr(named.control, name) for name in names})
    loop = loop_model(named.nominal(), control)
    hz = np.linspace(1.0, 600.0, 600)
    fit = model_of_response(hz, loop.response(hz), order=8)
    assert fit.relative_error < 1e-3
    rate, force = 2000.0, np.where(np.arange(4000) < 1000, 0.0, 50.0)
    gain = loop.response([1e-3])[0].real
    thrust = gain * force + 0.01 * np.random.default_rng(1).standard_normal(force.size)
    one, other = (KalmanObserver(m, rate, noise=0.5).update(None, None, thrust) for m in (loop, fit.model))
    assert one[-500:].mean() == pytest.approx(50.0, rel=0.02)
    assert other[-500:].mean() == pytest.approx(50.0, rel=0.02)


def test_what_is_no_response_is_refused():
    with pytest.raises(ValueError, match="shape of frequency_hz"):
        model_of_response([1.0, 2.0], [1.0])
    with pytest.raises(ValueError, match="order must be"):
        model_of_response(np.arange(1.0, 50.0), np.ones(49), order=40)


FEEDS = np.array([0.05, 0.08, 0.1, 0.15, 0.2]) * 1e-3


def test_cutting_coefficients_of_turning_and_slotting():
    one = cutting_coefficient(FEEDS, 2e-3 * (1.8e9 * FEEDS + 3e4), 2e-3)
    assert (one.cutting, one.edge) == pytest.approx((1.8e9, 3e4))
    assert one.flags == ()
    assert one.r_squared == pytest.approx(1.0)
    depth, teeth = 1e-3, 4
    across = teeth * depth * (0.25 * 7e8 * FEEDS + 2e4 / np.pi)
    tangential = slotting_coefficient(FEEDS, across, depth, teeth)
    assert (tangential.cutting, tangential.edge) == pytest.approx((7e8, 2e4))
    radial = slotting_coefficient(FEEDS, -across, depth, teeth, "radial")
    assert (radial.cutting, radial.edge) == pytest.approx((7e8, 2e4))
    axial = slotting_coefficient(FEEDS, teeth * depth * (1e8 * FEEDS / np.pi + 0.5e4), depth, teeth, "axial")
    assert (axial.cutting, axial.edge) == pytest.approx((1e8, 1e4))


@pytest.mark.parametrize(
    ("feeds", "forces", "flag"),
    [
        (FEEDS, 100.0 + 50.0 * np.array([1.0, -1.0, 1.0, -1.0, 1.0]), "poor fit"),
        (FEEDS[:2], FEEDS[:2] * 1e6, "2 feeds"),
        (FEEDS, FEEDS * 1e6 - 40.0, "negative"),
        (FEEDS, 3e3 * FEEDS**0.35, "bends"),
        ([1e-4, 1.1e-4, 1.2e-4], [100.0, 110.0, 120.0], "close together"),
    ],
)
def test_poor_fits_are_flagged(feeds, forces, flag):
    assert any(flag in said for said in cutting_coefficient(feeds, forces, 1e-3).flags)


def test_coefficients_need_two_feeds():
    with pytest.raises(ValueError, match="two values"):
        cutting_coefficient([1e-4, 1e-4], [1.0, 2.0], 1e-3)
    with pytest.raises(ValueError, match="depth must be positive"):
        cutting_coefficient(FEEDS, FEEDS, 0.0)
