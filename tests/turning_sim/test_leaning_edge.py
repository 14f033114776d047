"""A flank that cuts and leans over the cut, on the surface map, against slices across the chip."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.reference.plant_chip import forces_of_chip
from tests.reference.plant_lean import front, leaning_chip, leaning_stiffness
from tests.turning_sim.cases import cut
from tests.turning_sim.eigen import grow, theory
from turning_sim import ForceLaw, ProcessModel, cut_derivatives, steady_chip
from turning_sim import _surface_kernels as kernels
from turning_sim.process import _answer, grid_of

LIVE = ProcessModel(cut="surface", directions=2)
STEADY = ProcessModel(cut="surface", directions=2, thrust_direction="steady")
FINE = 1e-6  # where the edge of the map leaves the chip on a steep part, cells of 5 um are 0.002 off in the overlap
SMALL_NOSE = {"nose_radius": 0.2e-3, "force_law": ForceLaw(thrust_coefficient=6.08e9)}
EDGES = st.tuples(st.floats(0.2e-3, 0.4e-3), st.floats(75.0, 110.0), st.floats(0.15e-3, 0.4e-3))


def edge(radius, degrees, depth):
    return cut(nose_radius=radius, approach_angle=math.radians(degrees), depth_of_cut=depth)


@settings(max_examples=15)
@given(EDGES, st.booleans())
def test_derivatives_against_slices(shape, steady):
    condition = edge(*shape)
    now, before = leaning_stiffness(condition, steady)
    found = cut_derivatives(condition, replace(STEADY if steady else LIVE, cell=FINE))
    assert found.stiffness == pytest.approx(now[0], rel=5e-4)
    assert found.tangential_stiffness == pytest.approx(now[1], rel=5e-4)
    assert found.overlap == pytest.approx(before[0] / now[0], abs=5e-4)
    assert found.tangential_overlap == pytest.approx(before[1] / now[1], abs=5e-4)


@settings(max_examples=25)
@given(EDGES, st.floats(-15e-6, 30e-6), st.floats(-15e-6, 15e-6))
def test_forces_of_a_chip_between_two_depths(shape, now, before):
    """As far as both tools are in the cut all along the edge."""
    condition = edge(*shape)
    depths = [now, before, 0.0, 0.0, 0.0, 0.0]
    chip = leaning_chip(condition.depth_of_cut, 75e-6, condition.nose_radius, condition.approach_angle, depths)
    found = _answer(grid_of(condition, LIVE), now, before)
    assert found[2] == pytest.approx(chip[0], rel=1e-3)
    assert found[:2] == pytest.approx(forces_of_chip(condition, *chip), rel=2e-3)


@given(EDGES)
def test_the_steady_chip_is_that_of_slices(shape):
    condition = edge(*shape)
    chip = steady_chip(condition.depth_of_cut, 75e-6, condition.nose_radius, condition.approach_angle)
    sliced = leaning_chip(condition.depth_of_cut, 75e-6, condition.nose_radius, condition.approach_angle, [0.0] * 6)
    assert (chip.area, chip.edge_length, chip.thrust_direction) == pytest.approx(sliced, rel=1e-5)


@given(EDGES, st.floats(0.0, 1.0))
def test_what_the_edge_has_beyond_the_map(shape, share):
    grid = grid_of(edge(*shape), LIVE)
    height, low = share * (grid.depth + 0.1e-3), grid.radius * (1.0 - math.cos(grid.turn_over))
    place, area, length = kernels.beyond(grid, height)
    if height <= low or grid.approach <= grid.turn_over:
        assert (place, area, length) == pytest.approx((0.0, 0.0, 0.0), abs=1e-18)
        return
    heights = np.linspace(low, height, 40001)
    mapped = grid.radius * math.sin(grid.turn_over) + (heights - low) / math.tan(grid.turn_over)
    true = front(heights, grid.radius, grid.approach)
    assert place == pytest.approx(true[-1] - mapped[-1], abs=1e-12)
    assert area == pytest.approx(np.trapezoid(true - mapped, heights), abs=1e-15)
    lengths = [np.hypot(np.diff(line), np.diff(heights)).sum() for line in (true, mapped)]
    assert length == pytest.approx(lengths[0] - lengths[1], abs=1e-9)


def test_an_edge_that_is_not_reached_changes_nothing():
    usual, upright = (grid_of(cut(approach_angle=math.radians(d)), LIVE) for d in (95.0, 80.0))
    for now, before in ((0.0, 0.0), (20e-6, -10e-6), (-15e-6, 5e-6)):
        assert _answer(usual, now, before) == _answer(upright, now, before)


def test_a_deeper_cut_with_a_small_nose_is_softer():
    """From 0.2 to 0.3 mm the radial stiffness falls to 0.7665 of its value, since the flank pushes along the bar."""
    shallow, deep = (cut_derivatives(cut(depth_of_cut=depth, **SMALL_NOSE), STEADY) for depth in (0.2e-3, 0.3e-3))
    assert shallow.stiffness == pytest.approx(0.925e6, rel=1e-3)
    assert deep.stiffness / shallow.stiffness == pytest.approx(0.7665, abs=5e-4)
    assert deep.overlap == pytest.approx(0.687, abs=1e-3)


@pytest.mark.parametrize("degrees", [0.0, 1.38])
def test_small_waves_grow_as_in_the_linear_theory(degrees):
    changes = {"depth_of_cut": 0.3e-3, **SMALL_NOSE}
    now, before = leaning_stiffness(cut(**changes), steady=True)
    linear = theory(
        0.0, shift=math.radians(degrees), stiffness=now[0], tangential=now[1], overlap=before[0] / now[0],
        tangential_overlap=before[1] / now[1],
    )  # fmt: skip
    root, growth, frequency_hz = grow(STEADY, linear, 0.0, 0, size=1e-8, cut_changes=changes)
    assert growth == pytest.approx(root.real, abs=0.02)
    assert frequency_hz == pytest.approx(root.imag / (2.0 * math.pi), rel=1e-4 if degrees else 2e-5)
