"""The published laws without sampling, and the filters of the publications."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from chatter.filters import response
from chatter.observers.analytic import LAWS, analytic_response, law, mass_error_response, rigid_response
from chatter.observers.family import linear_observer
from chatter.observers.legacy import legacy_observer, smoothed_inertia
from chatter.observers.prediction import least_forces, quantisation_variance
from chatter.observers.stage_model import with_errors
from chatter.observers.triple_axis import TripleAxis
from tests.chatter.test_observers_family import RATE, A
from tests.chatter.test_observers_prediction import AT_ONCE, CONTROL_A, SCALES

HZ = np.geomspace(1.0, 1000.0, 60)


@pytest.mark.parametrize("control", [None, CONTROL_A])
@pytest.mark.parametrize(("name", "off"), [("medob", 1e-9), ("load_side", 1e-9), ("vibration", 2e-3)])
def test_exact_laws_give_the_force_at_every_frequency(name, off, control):
    # the modal damping of the vibration mode is exact only where damping is proportional to mass
    np.testing.assert_allclose(analytic_response(name, A, A, HZ, control), 1.0, atol=off)


@given(
    mass=st.floats(0.3, 3.0), inertia=st.floats(0.3, 3.0), stiffness=st.floats(0.3, 3.0), damping=st.floats(0.0, 3.0),
    q=st.floats(0.2, 3.0),
)  # fmt: skip
def test_printed_formulas_corrected_are_the_equations_of_motion(mass, inertia, stiffness, damping, q):
    errors = {"stage_mass": mass, "rotor_inertia": inertia, "screw_stiffness": stiffness, "screw_damping": damping}
    drive = with_errors(A, **{name: factor - 1.0 for name, factor in errors.items()})
    np.testing.assert_allclose(rigid_response(drive, HZ), analytic_response("dob", drive, drive, HZ), atol=1e-9)
    wrong = with_errors(drive, stage_mass=q - 1.0)
    np.testing.assert_allclose(
        mass_error_response(drive, HZ, q), analytic_response("medob", wrong, drive, HZ), atol=1e-9
    )


def test_as_printed_they_are_not():
    assert np.abs(rigid_response(A, HZ, as_printed=True) - rigid_response(A, HZ)).max() > 0.01
    assert np.abs(mass_error_response(A, HZ, 0.5, as_printed=True) - mass_error_response(A, HZ, 0.5)).max() > 0.01
    np.testing.assert_array_equal(mass_error_response(A, HZ, 1.0, as_printed=True), mass_error_response(A, HZ, 1.0))


@pytest.mark.parametrize("name", ["dob", "medob", "load_side"])
def test_sampled_weights_tend_to_the_laws(name):
    hz = np.array([20.0, 150.0, 335.0])
    fast = linear_observer(name, AT_ONCE, 1e6, cutoff_hz=4e5)
    back = np.exp(2j * np.pi * hz / 1e6) / response(fast.sections, hz, 1e6)
    np.testing.assert_allclose(fast.weights(hz)[:, 0, :2] * back[:, None], law(name, AT_ONCE, hz)[:, :2], rtol=1e-4)


def test_a_law_has_a_name():
    assert {"dob", "medob", "vibration", "load_side"} == set(LAWS)
    with pytest.raises(ValueError, match="name must be one of dob, medob"):
        law("thrust", A, HZ)


def test_filters_of_the_thesis_give_the_force_too_but_are_noisier():
    # at the same 1 kHz: bilinear differentiators of first order let more of the counts through
    plain, legacy = linear_observer("medob", SCALES, RATE), legacy_observer(SCALES, RATE, 1.0)
    noise = [np.sqrt(quantisation_variance(one)[0]) for one in (legacy, plain)]
    assert noise[0] / noise[1] == pytest.approx(3.7, abs=0.1)
    whole = legacy_observer(replace(AT_ONCE, motor_resolution=0.0), RATE, 1.0)
    hz = np.array([10.0, 50.0])
    assert abs(whole.weights([0.01])[0, 0, 2]) == pytest.approx(1.0, abs=1e-3)
    low = 5000.0 / (2j * np.pi * hz + 5000.0) / (1.0 + 1j * hz / 1000.0)
    expected = -(A.stage_mass * (2j * np.pi * hz) ** 2 + A.stage_damping * 2j * np.pi * hz) * low
    np.testing.assert_allclose(whole.weights(hz)[:, 0, 1], expected, rtol=2e-3)


def test_low_pass_of_the_fitting_paper_differentiates_below_its_edge():
    section = smoothed_inertia(150.0, 1000.0, 260.0, 1530.0)
    hz = np.array([1.0, 5.0])
    s = 2j * np.pi * hz
    np.testing.assert_allclose(np.abs(response(section, hz, 1000.0)), np.abs(260.0 * s**2 + 1530.0 * s), rtol=5e-3)
    with pytest.raises(ValueError, match="edge_hz must be in"):
        smoothed_inertia(500.0, 1000.0, 1.0, 1.0)


def test_least_forces_of_the_vibration_mode_are_modal_times_the_mass_ratio():
    forces = least_forces(SCALES, RATE)
    stretch = 1.0 + 1.0 / A.mass_ratio
    damping = A.rotor_viscosity + A.stage_damping / A.mass_ratio**2 + stretch**2 * A.screw_damping
    modal = {"inertia": stretch * A.rotor_mass * RATE**2, "damping": damping * RATE}
    modal["elastic"] = stretch**2 * A.screw_stiffness
    for term, factor in modal.items():
        expected = A.mass_ratio * factor * SCALES.stage_resolution / stretch
        assert forces[f"vibration_{term}"] == pytest.approx(expected, rel=1e-9)


def test_three_inertias_under_force_obey_newton_and_hooke():
    drive = TripleAxis(
        lead=5e-3, rotor_inertia=3.8e-5, rotor_damping=2e-3, nut_mass=20.0, nut_damping=100.0, stage_mass=6.6,
        stage_damping=400.0, torsion_stiffness=3e8, torsion_damping=1e3, screw_stiffness=3.5e7, screw_damping=2e3,
        stage_delay=1e-4,
    )  # fmt: skip
    high = drive.sensed([20_000.0])[0]
    late = np.exp(-2j * np.pi * 20_000.0 * 1e-4)
    assert high[2] / late == pytest.approx(1.0 / (6.6 * (2 * np.pi * 20_000.0) ** 2), rel=0.05)
    low = replace(drive, rotor_damping=1e6).sensed([0.5])[0]  # the motor stands still
    assert (low[2] - low[1]).real == pytest.approx(-1.0 / 3.5e7, rel=0.02)
