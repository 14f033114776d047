import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.turning_sim.axes import machine_a, pushed
from turning_sim import Friction, ServoAxis
from turning_sim._axis_kernels import bristles
from turning_sim.servo_axis import _rub

LUGRE = Friction(coulomb=100.0, static=140.0, stribeck_velocity=1e-3, bristle_stiffness=2e7)
STEP = 5e-6
SPEEDS = st.lists(st.floats(-0.02, 0.02), min_size=1, max_size=60)


def bend(friction, velocities, state=None):
    """Forces of the bristles along a course of velocities, one for each sub-step, and their last state."""
    state = np.zeros(3) if state is None else state
    rub = _rub(friction, 60.0, STEP, -1.0, "motor")
    return np.array([bristles(rub, state, float(v), STEP) for v in velocities]), state


def test_stribeck_curve():
    curve = dataclasses.replace(LUGRE, viscous=50.0)
    assert curve.steady(0.0) == 0.0
    assert curve.steady(1e-9) == pytest.approx(140.0)
    assert curve.steady(1e-3) == pytest.approx(100.0 + 40.0 / math.e + 0.05)
    assert curve.steady(0.1) == pytest.approx(105.0)
    v = np.linspace(-0.1, 0.1, 41)
    assert curve.steady(v) == pytest.approx(-curve.steady(-v))
    exponential = dataclasses.replace(curve, stribeck_exponent=1.0)
    assert exponential.steady(2e-3) == pytest.approx(100.1 + 40.0 * math.exp(-2.0))


@pytest.mark.parametrize("exponent", [1.0, 2.0, 0.7])
@pytest.mark.parametrize("speed", [3e-4, 1e-3, 5e-3, -2e-3])
def test_bristles_slide_on_the_stribeck_curve(speed, exponent):
    friction = dataclasses.replace(LUGRE, stribeck_exponent=exponent, bristle_damping=500.0)
    forces, _ = bend(friction, np.full(round(2.5e-4 / abs(speed * STEP)), speed))
    assert forces[-1] == pytest.approx(float(friction.steady(speed)), rel=1e-9)


@given(st.floats(1e-9, 2e-8))
def test_presliding_is_a_spring(way):
    """Well below breakaway: stiffness sigma_0, and back at the start no force is left but the hysteresis."""
    there = np.full(20, way / (20 * STEP))
    forces, state = bend(LUGRE, there)
    assert forces[-1] == pytest.approx(2e7 * way, rel=0.5 * 2e7 * way / 100.0 + 1e-9)
    back, _ = bend(LUGRE, -there, state)
    assert abs(back[-1]) < (2e7 * way) ** 2 / 100.0


@given(SPEEDS)
def test_bristles_never_give_more_than_they_got(velocities):
    """Work along the exact path is at least what the bent bristles store."""
    state, work = np.zeros(3), 0.0
    for v in velocities:
        before = state[0]
        bend(LUGRE, [v], state)
        # exact path of z at constant velocity: the mean of z is (v - dz/dt) g / (sigma_0 |v|)
        g, change = abs(float(LUGRE.steady(v))), state[0] - before
        mean = (v * STEP - change) * g / (2e7 * abs(v) * STEP) if abs(v) > 1e-6 else 0.5 * (before + state[0])
        work += 2e7 * mean * v * STEP
        stored = 0.5 * 2e7 * state[0] ** 2
        assert work >= stored - 1e-12 * (1.0 + stored)
        assert abs(state[0]) <= 140.0 / 2e7 * (1.0 + 1e-12)


@given(SPEEDS)
def test_bristles_do_not_care_for_the_cut_of_a_step(velocities):
    """Exact at constant velocity: two half steps are one."""
    rub = _rub(LUGRE, 60.0, STEP, -1.0, "motor")
    whole, half = np.zeros(3), np.zeros(3)
    for v in velocities:
        bristles(rub, whole, v, STEP)
        bristles(rub, half, v, 0.5 * STEP)
        bristles(rub, half, v, 0.5 * STEP)
        assert half[0] == pytest.approx(whole[0], rel=1e-11, abs=1e-20)


def test_motion_is_symmetric_in_its_direction():
    """Without the absolute value in dz/dt the bristles run away for v < 0."""
    forth, _ = bend(LUGRE, np.full(5000, 4e-3))
    back, _ = bend(LUGRE, np.full(5000, -4e-3))
    assert back == pytest.approx(-forth, rel=1e-14)


@pytest.mark.parametrize("bristle", [None, 5e7])
def test_a_load_below_breakaway_does_not_make_it_drift(bristle):
    """60 N at 200 Hz, 2000 periods, 130 N to hold it: the motor ends where it was; bristles bend, and hold too."""
    friction = Friction(coulomb=130.0, bristle_stiffness=bristle)
    drive = machine_a(motor_friction=friction)
    rate, periods = 20e3, 2000
    count = round(periods * rate / 200.0)
    out = pushed(drive, np.zeros(count), lambda t: 60.0 * np.sin(2.0 * np.pi * 200.0 * t))
    period = round(rate / 200.0)
    first, last = (out.true_motor_position[i : i + period].mean() for i in (20 * period, count - period))
    assert abs(last - first) < (1e-15 if bristle is None else 2e-8)
    assert np.abs(out.motor_friction).max() < 130.0
    reach = np.abs(out.true_motor_position).max()
    # held at rest at the ends of each sub-step only, dry friction gives way like a spring of 12 M/h^2
    assert reach < 130.0 * STEP**2 / (12.0 * drive.motor_mass) if bristle is None else 1e-7 < reach < 2e-6


def test_dry_friction_holds_and_breaks_away():
    """Motor held: the stage gives way by F/K alone. Past breakaway the friction falls to Coulomb's."""
    drive = machine_a(motor_friction=Friction(coulomb=100.0, static=130.0))
    out = pushed(drive, np.zeros(4000), lambda t: 120.0 * np.minimum(t / 0.1, 1.0))
    assert out.true_stage_position[-1] == pytest.approx(-120.0 / 25.7e6, rel=1e-6)
    assert np.abs(out.true_motor_position).max() < 1e-11
    assert out.motor_friction[-1] == pytest.approx(-120.0, rel=1e-6)
    moving = pushed(drive, np.full(4000, 200.0), np.zeros_like)
    assert moving.motor_friction[-1] == pytest.approx(100.0)
    assert moving.true_motor_position[-1] > 1e-3


@pytest.mark.parametrize("side", ["motor_friction", "stage_friction"])
@pytest.mark.parametrize("bristle", [None, 2e7])
def test_free_motion_only_loses_energy(side, bristle):
    """Pushed for 10 ms, then left alone: it comes to rest, and no energy ever comes from nowhere."""
    drive = machine_a(stage_damping=0.0, motor_damping=0.0, drive_damping=0.0, **{
        side: Friction(coulomb=40.0, static=60.0, bristle_stiffness=bristle)
    })  # fmt: skip
    axis = ServoAxis(drive, None, 20e3)
    axis.advance(np.full(200, 150.0), np.zeros(2000))
    energies = []
    for _ in range(400):
        axis.advance(np.zeros(10), np.zeros(100))
        z, rub = axis._state["z"], axis._state["rub"]
        kinetic = 0.5 * drive.motor_mass * z[1] ** 2 + 0.5 * drive.stage_mass * z[5] ** 2
        spring = 0.5 * 25.7e6 * (z[0] - z[4]) ** 2 + 0.5 * (bristle or 0.0) * float(np.sum(rub[:, 0] ** 2))
        energies.append(kinetic + spring)
    settled = np.array(energies[20:])  # the thrust dies out
    assert np.diff(settled).max() < 2e-4 * settled[0]
    assert settled[-1] < 0.02 * settled[0]


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"coulomb": -1.0}, "coulomb must be finite and at least 0, got -1.0"),
        ({"static": 90.0}, "static must be finite and at least coulomb, got 90.0"),
        ({"stribeck_velocity": 0.0}, "stribeck_velocity must be finite and positive"),
        ({"stribeck_exponent": math.nan}, "stribeck_exponent must be finite and positive"),
        ({"bristle_stiffness": 0.0}, "bristle_stiffness must be finite and positive"),
        ({"bristle_stiffness": None, "bristle_damping": 1.0}, "bristle_damping must be 0 without bristle_stiffness"),
    ],
)
def test_refusals(changes, said):
    with pytest.raises(ValueError, match=said):
        dataclasses.replace(LUGRE, **changes)


def test_a_presliding_spring_too_stiff_for_the_step_is_refused():
    stiff = Friction(coulomb=100.0, bristle_stiffness=1e13)
    with pytest.raises(ValueError, match=r"motor_friction.bristle_stiffness must be at most .* with this sub-step"):
        ServoAxis(machine_a(motor_friction=stiff), None, 20e3)
    lossy = Friction(coulomb=100.0, bristle_stiffness=1e7, bristle_damping=1e9)
    with pytest.raises(ValueError, match=r"stage_friction.bristle_damping must be at most .* with this sub-step"):
        ServoAxis(machine_a(stage_friction=lossy), None, 20e3)
