import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.turning_sim.cases import drives, run, simulator, smooth_step
from turning_sim import slides_of_shift

QUIET = {"air_time": 1e3}


def apply(transition, state, thrust, load, load_end):
    return np.concatenate([state, thrust, load, load_end, np.zeros(2)]) @ transition


@given(st.lists(st.floats(-1.0, 1.0), min_size=14, max_size=14))
def test_two_half_steps_are_one_step(numbers):
    """Exactness: a linear load cut in the middle gives the same end."""
    v = np.array(numbers)
    state, thrust, load, end = v[:10] * 1e-6, v[10:12], v[12:14], v[13:11:-1]
    whole, half = drives().transition(1.0 / 54000.0), drives().transition(1.0 / 108000.0)
    middle = apply(half, state, thrust, load, 0.5 * (load + end))
    assert apply(half, middle, thrust, 0.5 * (load + end), end) == pytest.approx(
        apply(whole, state, thrust, load, end), rel=1e-9, abs=1e-18
    )


def test_steady_load_stretches_the_spring():
    """Motors held by the thrust they need: the stages give way by Q/K, independent of the coupling."""
    transition, load = drives().transition(2e-3), np.array([100.0, -40.0])
    state = np.zeros(10)
    for _ in range(3000):
        state = apply(transition, state, load, load, load)
    assert state[[0, 5]] - state[[2, 7]] == pytest.approx(load / 1.5e8, rel=1e-6)


def test_slides_are_coupled_by_the_upper_mass():
    """A short push on X1 moves Y1 as the mass matrix says: a_y = -m_c cos(psi)/M_y a_x."""
    step = 1e-6
    end = apply(drives().transition(step), np.zeros(10), np.zeros(2), np.array([100.0, 0.0]), np.array([100.0, 0.0]))
    assert end[8] / end[3] == pytest.approx(-150.0 * math.cos(math.pi / 4.0) / 150.0, rel=1e-3)


def test_undamped_frequencies_of_the_drives():
    free = drives(stage_damping=0.0, drive_damping=1e-9, motor_damping=0.0, current_bandwidth=1e-3)
    free = dataclasses.replace(free, upper_mass=0.0)
    step = 1e-4
    values = np.linalg.eigvals(free.transition(step)[:10])
    found = np.unique(np.round(np.abs(np.angle(values)) / step, 3))
    for axis in (free.x1, free.y1):
        alpha = axis.stage_mass / axis.motor_mass
        expected = math.sqrt((1.0 + alpha) * axis.drive_stiffness / axis.stage_mass)
        assert np.abs(found - expected).min() < 0.01


def test_standing_in_air_is_still():
    out = run(simulator(**QUIET), 0.5)
    for name in ("x1_thrust", "x1_stage_position", "y1_motor_position", "vibration", "force_x1"):
        assert np.abs(out[name]).max() == 0.0


def test_dry_friction_holds_the_encoder_count():
    """With 0.3 nm of scale noise a slide without dry friction hunts by a count; friction stops that."""
    hunting, held = (
        run(simulator(turret=drives(scale_noise=0.3e-9, motor_friction=n, presliding_stiffness=2e8), **QUIET), 1.5)
        for n in (0.0, 300.0)
    )
    toggles = [np.count_nonzero(np.diff(out["x1_motor_position"][4500:])) for out in (hunting, held)]
    assert toggles[0] > 50
    assert toggles[1] < 5
    assert held["x1_stage_position"][4500:].std() < 5e-9


@pytest.mark.parametrize("friction", [0.0, 300.0])
@pytest.mark.parametrize("duration", [0.15, 0.25])
def test_a_move_keeps_the_depth_of_cut(duration, friction):
    sim = simulator(turret=drives(motor_friction=friction, presliding_stiffness=2e8), **QUIET)
    target, length = math.radians(2.76), round(duration * 9000.0)
    path = smooth_step(9000, 900, length, target)
    out = run(sim, 1.0, shift=path)
    x, y = slides_of_shift(path, sim.diameter, math.pi / 4.0)
    assert np.abs(out["x1_stage_position"] - x).max() < 20e-6
    assert np.abs(out["y1_stage_position"] - y).max() < 30e-6
    # in air the bar is at rest: what is left of the vibration is the tool off its arc
    assert np.abs(out["vibration"]).max() < 3e-6
    assert np.abs(out["vibration"][900 + length + 450 :]).max() < 0.2e-6
    assert out["shift"][-1] == pytest.approx(target, abs=1e-5)


@given(st.floats(-18.0, 18.0))
def test_starting_shifted_is_standing_still(degrees):
    shift = math.radians(degrees)
    out = run(
        simulator(initial_shift=shift, turret=drives(motor_resolution=0.0, stage_resolution=0.0), **QUIET), 0.02, shift
    )
    assert out["shift"] == pytest.approx(np.full(180, shift), abs=1e-12)


def test_refusals():
    with pytest.raises(ValueError, match="lead must be positive, got -1"):
        drives(lead=-1.0)
    with pytest.raises(ValueError, match="upper_mass must be in"):
        dataclasses.replace(drives(), upper_mass=200.0)
    usual = drives()
    with pytest.raises(ValueError, match="y1.thrust_delay must be equal to x1.thrust_delay"):
        dataclasses.replace(usual, y1=dataclasses.replace(usual.y1, thrust_delay=0.0))
