import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import eigh
from scipy.optimize import minimize_scalar

from tests.turning_sim.axes import machine_a, machine_b, three_inertias
from tests.turning_sim.cases import drives
from turning_sim import AxisDrive, Friction, Wave


def relative_motion(drive, frequency_hz):
    """Gain from a force on the motor to motor minus stage."""
    mass, damping, stiffness = drive.matrices()
    s = 2j * math.pi * frequency_hz
    x = np.linalg.solve(mass * s**2 + damping * s + stiffness, np.eye(len(mass))[0])
    return abs(x[0] - x[-1])


@pytest.mark.parametrize(
    ("drive", "alpha", "natural_hz", "zeta", "peak_hz"),
    [(machine_a(), 0.10332, 340.36, 0.1180, 335.6), (machine_b(), 0.08038, 409.79, 0.0814, 407.1)],
)
def test_resonances_of_the_thesis(drive, alpha, natural_hz, zeta, peak_hz):
    """Table 3-3: its "resonance" of 335 and 408 Hz is the peak of motor minus stage, not the undamped frequency."""
    assert drive.mass_ratio == pytest.approx(alpha, abs=6e-6)
    mass, damping, stiffness = drive.matrices()
    squared, shapes = eigh(stiffness, mass)
    assert squared[0] == pytest.approx(0.0, abs=1e-6 * squared[1])
    omega = math.sqrt(squared[1])
    assert omega / (2.0 * math.pi) == pytest.approx(natural_hz, abs=5e-3)
    vibration = shapes[:, 1]
    assert vibration @ damping @ vibration / (2.0 * omega) == pytest.approx(zeta, abs=6e-5)
    peak = minimize_scalar(lambda f: -relative_motion(drive, f), bounds=(250.0, 500.0), method="bounded")
    assert peak.x == pytest.approx(peak_hz, abs=0.06)


def test_three_inertias_resonate_at_366_and_770_hz():
    mass, _, stiffness = three_inertias().matrices()
    squared = eigh(stiffness, mass, eigvals_only=True)
    assert np.sqrt(squared[1:]) / (2.0 * math.pi) == pytest.approx([366.0, 770.0], abs=0.5)


def stepped(transition, state, thrust=0.0, motor=0.0, stage=0.0):
    return np.concatenate([state, [thrust, motor, stage]]) @ transition


@given(st.lists(st.floats(-1.0, 1.0), min_size=10, max_size=10))
@pytest.mark.parametrize("drive", [machine_a(), three_inertias(), machine_b(current_bandwidth=math.inf)])
def test_two_half_steps_are_one_step(drive, numbers):
    v = np.array(numbers)
    state, inputs = v[:7] * [1e-6, 1e-3, 1e-6, 1e-3, 1e-6, 1e-3, 10.0], 100.0 * v[7:]
    if drive.screw_inertia is None:
        state[2:4] = 0.0
    whole, half = drive.transition(1e-5), drive.transition(0.5e-5)
    once, twice = stepped(whole, state, *inputs), stepped(half, stepped(half, state, *inputs), *inputs)
    if drive.current_bandwidth == math.inf:
        assert once[6] == inputs[0]
    assert twice == pytest.approx(once, rel=1e-10, abs=1e-14)


def test_a_steady_load_stretches_the_springs():
    drive = three_inertias()
    transition, state = drive.transition(1e-3), np.zeros(7)
    for _ in range(3000):
        state = stepped(transition, state, 100.0, 0.0, 100.0)
    assert state[0] - state[2] == pytest.approx(100.0 / 3.2520e8, rel=1e-6)
    assert state[2] - state[4] == pytest.approx(100.0 / 3.4811e7, rel=1e-6)


def test_a_stiff_coupling_makes_two_inertias_of_three():
    """The screw joins the motor: error in proportion to the compliance of the coupling."""
    dual = machine_a(motor_inertia=5e-5)
    errors = []
    for stiffness in (1e10, 1e11):
        triple = machine_a(
            motor_inertia=3e-5, screw_inertia=2e-5, screw_damping=0.0, coupling_stiffness=stiffness,
            coupling_damping=1e-5 * stiffness, screw_resolution=0.0, screw_delay=0.0,
        )  # fmt: skip
        frequencies = np.linspace(10.0, 800.0, 80)
        a, b = (np.array([relative_motion(d, f) for f in frequencies]) for d in (triple, dual))
        errors.append(np.abs(a / b - 1.0).max())
    assert errors[0] < 0.1
    assert errors[1] == pytest.approx(errors[0] / 10.0, rel=0.2)


def test_viscous_friction_is_damping():
    plain = machine_a(stage_damping=470.0)
    rubbed = machine_a(stage_friction=Friction(coulomb=0.0, viscous=100.0))
    assert rubbed.transition(1e-5) == pytest.approx(plain.transition(1e-5), rel=1e-14)


def test_an_axis_of_the_turret_becomes_a_drive_of_its_own():
    feed = drives(motor_friction=300.0, presliding_stiffness=2e8, scale_noise=0.3e-9).x1
    own = AxisDrive.of(feed, load=50.0)
    assert own.motor_friction == Friction(coulomb=300.0, bristle_stiffness=2e8)
    assert (own.stage_noise, own.load, own.lead, own.motor_delay) == (0.3e-9, 50.0, 8e-3, 1.0 / 9000.0)
    assert AxisDrive.of(drives().x1).motor_friction is None


def test_ideal_drives():
    rough = machine_a(
        motor_friction=Friction(coulomb=1.0), stage_friction=Friction(coulomb=1.0), load=3.0, stage_resolution=1e-9,
        ripple=(Wave(amplitude=1.0, wavelength=1e-3),), motor_error=(Wave(amplitude=1e-9, wavelength=1e-5),),
        stage_noise=1e-9,
    )  # fmt: skip
    assert rough.ideal() == machine_a()
    three = three_inertias(screw_resolution=1e-9)
    assert three.ideal().without_lags() == three_inertias(screw_delay=0.0).without_lags()
    assert rough.ideal().without_lags() == machine_a(
        current_bandwidth=math.inf, thrust_delay=0.0, motor_delay=0.0, stage_delay=0.0
    )


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"lead": -1.0}, "lead must be positive, got -1.0"),
        ({"stage_mass": math.nan}, "stage_mass must be finite, got nan"),
        ({"drive_stiffness": math.inf}, "drive_stiffness must be finite, got inf"),
        ({"current_bandwidth": 0.0}, "current_bandwidth must be positive"),
        ({"motor_delay": -1e-4}, r"motor_delay must be in \[0, 50 ms\], got -0.0001"),
        ({"thrust_delay": 0.06}, r"thrust_delay must be in \[0, 50 ms\], got 0.06"),
        ({"stage_noise": -1.0}, "stage_noise must be finite and at least 0"),
        ({"load": math.inf}, "load must be finite"),
        ({"screw_inertia": 0.0}, "screw_inertia must be finite and positive"),
        ({"screw_inertia": 1e-5}, "coupling_stiffness must be finite and positive with screw_inertia, got None"),
        ({"screw_inertia": 1e-5, "coupling_stiffness": 1e8, "screw_damping": 0.0}, "coupling_damping must be finite"),
        ({"screw_delay": 0.0}, "screw_delay must be absent without screw_inertia, got 0.0"),
        ({"coupling_stiffness": 1e8}, "coupling_stiffness must be absent without screw_inertia"),
    ],
)
def test_refusals(changes, said):
    with pytest.raises(ValueError, match=said):
        machine_a(**changes)


@pytest.mark.parametrize("changes", [{"amplitude": math.nan}, {"wavelength": 0.0}, {"phase": math.inf}])
def test_refusals_of_a_wave(changes):
    with pytest.raises(ValueError, match=next(iter(changes))):
        dataclasses.replace(Wave(amplitude=1.0, wavelength=1e-3), **changes)
