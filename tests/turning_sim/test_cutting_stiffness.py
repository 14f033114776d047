"""What the cutting stiffness does: only its ratio to bar and damping counts, and more of it is not always worse."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pitch import OneModeProcess, rightmost_root
from tests.reference.plant import characteristic_roots
from tests.turning_sim.cases import bar, cut, immovable, run, simulator
from turning_sim import Chuck, ForceLaw, ProcessModel, linear_parameters

LUMPED, MAP = ProcessModel(), ProcessModel(cut="surface", directions=2)
FULL = 1.06e6


def root_of(tools_at, shift, factor=1.0, scale=1.0):
    """Rightmost root with so much of the cutting stiffness, and everything times `scale`."""
    linear = linear_parameters(bar(), cut(), tools_at)
    process = OneModeProcess(
        scale * linear.mass_at_tools, linear.natural_frequency_hz, linear.damping_ratio, linear.overlap,
        scale * linear.process_damping,
    )  # fmt: skip
    return rightmost_root(process, scale * factor * FULL, 20.0, 2.0 * shift)


@settings(max_examples=20)
@given(st.floats(0.01, 100.0), st.floats(0.0, 0.1), st.floats(0.2, 2.0))
def test_equal_scaling_leaves_the_root(scale, shift, factor):
    root = root_of(6e-3, shift, factor)
    assert root_of(6e-3, shift, factor, scale) == pytest.approx(root, rel=1e-9)


def scaled(model, scale):
    """What the bar does when mass, stiffness, damping, cutting coefficients and noise are multiplied."""
    law = ForceLaw(thrust_coefficient=scale * 3.19e9, tangential_coefficient=scale * 3.8e9)
    chuck = Chuck(lateral_stiffness=scale * 1.43e8, tilt_stiffness=scale * 6.36e4, tilt_damping=scale * 2.0)
    sim = simulator(
        model=model, turret=immovable(), air_time=0.02,
        bar_changes={"young_modulus": scale * 195e9, "density": scale * 7930.0, "chuck": chuck},
        cut_changes={
            "cutting_stiffness": scale * FULL, "process_damping": scale * 33.0, "force_noise": scale * 0.02,
            "force_law": law,
        },
    )  # fmt: skip
    return run(sim, 0.15)


@pytest.mark.parametrize("model", [LUMPED, MAP], ids=["lumped", "map"])
@settings(max_examples=5)
@given(scale=st.floats(0.2, 5.0))
def test_equal_scaling_leaves_the_motion(model, scale):
    """So the frequency, the growth and the surface stay too; forces are multiplied."""
    one, many = scaled(model, 1.0), scaled(model, scale)
    for name in ("bar_displacement", "left1"):
        assert many[name] == pytest.approx(one[name], abs=1e-9)
    assert many["force_x1"] == pytest.approx(scale * one["force_x1"], abs=scale * 1e-3)


ISLAND = math.radians(8.5)
ISLANDS = [(0.4, False), (0.8, True), (1.4, False), (1.8, True)]


@pytest.mark.parametrize(("factor", "unstable"), ISLANDS)
def test_more_stiffness_may_calm_a_shifted_cut(factor, unstable):
    """Tools at 30 mm, shift 8.5 deg: stable, unstable, stable, unstable; 0.6 um is what the noise shakes."""
    root = root_of(30e-3, ISLAND, factor)
    assert (root.real > 2.0) if unstable else (root.real < -2.0)
    twin = characteristic_roots(linear_parameters(bar(), cut(cutting_stiffness=factor * FULL), 30e-3), 20.0, ISLAND)
    assert root == pytest.approx(twin[0], rel=1e-6)
    sim = simulator(
        turret=immovable(), air_time=0.0, start_position=30e-3, initial_shift=ISLAND,
        cut_changes={"cutting_stiffness": factor * FULL, "rake_gain": 0.0, "setting_difference": 0.0},
    )  # fmt: skip
    sim._plant = sim._plant._replace(feed=0.0)
    late = run(sim, 3.0, ISLAND, block=9000)["vibration"][-9000:]
    assert (np.std(late) > 10e-6) if unstable else (np.std(late) < 1.5e-6)


def test_the_first_loss_of_stability_cannot_be_bisected():
    """A search that halves from one unstable stiffness may land beyond an island: 1.8 is unstable, so is 0.8."""
    signs = [root_of(30e-3, ISLAND, factor).real > 0.0 for factor in np.linspace(0.4, 1.8, 15)]
    assert np.count_nonzero(np.diff(signs)) == 3
