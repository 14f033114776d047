import math

import numpy as np
import pytest

from tests.reference.plant_chip import dynamic_stiffness
from tests.turning_sim.cases import cut, immovable, roughness, run, simulator
from tests.turning_sim.eigen import grow, theory
from turning_sim import ForceLaw, ProcessModel, cut_derivatives

MAP = ProcessModel(cut="surface", directions=2)
STEADY = ProcessModel(cut="surface", directions=2, thrust_direction="steady")
RAKE = math.degrees(0.015)


def hz(root):
    return root.imag / (2.0 * math.pi)


def test_derivatives_of_the_steady_cut_are_those_of_the_model():
    found = cut_derivatives(cut(), MAP)
    assert found.stiffness == pytest.approx(1.06e6, rel=2e-3)
    assert found.overlap == pytest.approx(0.859, abs=1e-3)
    assert found.area_overlap == pytest.approx(0.805, abs=1e-3)


def test_set_with_a_steady_thrust_direction():
    found = cut_derivatives(cut(nose_radius=0.2e-3, force_law=ForceLaw(thrust_coefficient=6.08e9)), STEADY)
    assert found.stiffness == pytest.approx(0.925e6, rel=2e-3)
    assert found.overlap == pytest.approx(0.694, abs=2e-3)
    assert found.tangential_stiffness / found.stiffness == pytest.approx(0.837, abs=2e-3)


@pytest.mark.parametrize("model", [MAP, STEADY])
@pytest.mark.parametrize("depth", [0.1e-3, 0.2e-3, 0.3e-3])
def test_derivatives_against_brute_force(model, depth):
    condition = cut(depth_of_cut=depth)
    now, before = dynamic_stiffness(condition, model.thrust_direction == "steady")
    found = cut_derivatives(condition, model)
    assert found.stiffness == pytest.approx(now[0], rel=1e-3)
    assert found.tangential_stiffness == pytest.approx(now[1], rel=1e-3)
    assert found.overlap == pytest.approx(before[0] / now[0], abs=1e-3)
    assert found.tangential_overlap == pytest.approx(before[1] / now[1], abs=1e-3)


@pytest.mark.parametrize(
    ("model", "position", "degrees", "which"),
    [(MAP, 0.0, 0.0, 0), (MAP, 0.0, 0.0, 1), (MAP, 15e-3, 0.0, 0), (STEADY, 0.0, 0.0, 0), (MAP, 0.0, 1.38, 0)],
)
def test_small_waves_on_the_map_grow_as_in_the_linear_theory(model, position, degrees, which):
    """The theory takes its stiffness and overlap from brute force, not from the map."""
    linear = theory(
        position, shift=math.radians(degrees), mapped=True, steady=model is STEADY, rake_gain=RAKE if degrees else 0.0
    )
    changes = {"rake_gain": RAKE if degrees else 0.0}
    root, growth, frequency_hz = grow(model, linear, position, which, size=1e-8, cut_changes=changes)
    assert growth == pytest.approx(root.real, rel=5e-3 if degrees else 1e-3)
    assert frequency_hz == pytest.approx(hz(root), rel=1e-4 if degrees else 2e-5)


def test_growth_of_the_sheet():
    assert theory(0.0, mapped=True).roots()[0].real == pytest.approx(30.20, abs=0.01)


@pytest.mark.parametrize(
    ("degrees", "diameter", "quiet"), [(1.66, 23.7, False), (2.21, 24.5, True), (3.19, 22.5, False)]
)
def test_stable_and_unstable_phases_in_time(degrees, diameter, quiet):
    """0.6, 0.8 and 1.15 pi on the map, from noise."""
    shift, changes = math.radians(degrees), {"turned_diameter": 1e-3 * diameter}
    sim = simulator(model=MAP, bar_changes=changes, air_time=0.0, start_position=0.0, initial_shift=shift)
    late = run(sim, 1.6, shift, block=3600)["vibration"][-3600:]
    assert (late.std() < 1e-6) == quiet
    assert late.std() < 30e-6


def test_a_quiet_cut_keeps_its_force_at_any_speed():
    """The grid never slides under a tool: no ripple, though speed varies by a tenth and the tools feed on."""
    sim = simulator(
        model=MAP, air_time=0.0, turret=immovable(),
        cut_changes={"force_noise": 0.0, "setting_difference": 0.0, "rake_gain": 0.0},
    )  # fmt: skip
    out = sim.advance(np.zeros(2700), np.zeros(2700), 20.0 + 2.0 * np.sin(np.arange(2700) / 200.0))
    radial, tangential = sim.cutting.steady_forces
    assert out.force_x1[3:] == pytest.approx(np.full(2697, radial), rel=3e-4)
    assert out.force_y1p[3:] == pytest.approx(np.full(2697, tangential), rel=3e-4)
    assert np.ptp(out.force_x1[3:]) < 5e-5 * radial


def test_a_turn_with_another_shift_changes_the_quiet_cut_but_little():
    """A shift delays one wave and advances the other; the chips stay those of half the feed."""
    out = run(simulator(model=MAP, air_time=0.0, cut_changes={"force_noise": 0.0}, initial_shift=0.1), 0.3, 0.1)
    radial, _ = cut().steady_forces
    assert out["force_x1"][900:].mean() == pytest.approx(radial, rel=0.1)


def test_tools_enter_and_leave_the_map():
    sim = simulator(model=MAP, air_time=0.05, end_position=6.6e-3)
    out = run(sim, 0.4)
    entry, end = 450, 450 + 1800
    assert np.abs(out["force_x1"][: entry + 1]).max() == 0.0
    assert not out["in_cut"][end + 2 :].any()
    assert out["in_cut"][entry + 1 : end - 1].all()
    assert np.abs(out["force_x1"][end + 4 :]).max() == 0.0
    assert math.isnan(sim.finished.roughness(5e-3, 6e-3))


def test_snapshot_brings_the_map_back():
    sim = simulator(model=MAP, air_time=0.0)
    sim.prepare()
    run(sim, 0.1)
    kept = sim.snapshot()
    first, line = run(sim, 0.3), sim.finished.line()
    sim.restore(kept)
    again = run(sim, 0.3)
    assert all(np.array_equal(first[name], again[name]) for name in first)
    assert np.array_equal(line[1], sim.finished.line()[1])
    parts = simulator(model=MAP, air_time=0.0)
    whole = run(parts, 0.1, block=37)
    assert np.array_equal(whole["vibration"], run(simulator(model=MAP, air_time=0.0), 0.1, block=900)["vibration"])


def test_finished_surface_of_the_map_is_that_of_the_trace():
    sim = simulator(model=MAP, air_time=0.0, cut_changes={"force_noise": 0.3})
    out = run(sim, 1.0, block=900)
    assert sim.finished.roughness(7e-3, 8.4e-3) == pytest.approx(roughness(sim, out, 7e-3, 8.4e-3), rel=0.1)
