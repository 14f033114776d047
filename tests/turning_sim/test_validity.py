import math

import numpy as np
import pytest

from tests.turning_sim.cases import bar, cut, run, simulator
from turning_sim import Chuck, ProcessModel, SimulationDiverged, validity

MAP = ProcessModel(cut="surface", directions=2)


def test_the_usual_cut_is_beyond_doubt():
    assert validity(bar(), cut(), shift=math.radians(8.28)) == ()
    assert validity(bar(), cut(), model=MAP) == ()
    # beyond the nose the flank cuts too: the map knows it, the linear cut is told nothing of it
    deep = cut(depth_of_cut=0.3e-3, nose_radius=0.2e-3, feed_per_rev=0.12e-3)
    assert validity(bar(), deep, model=MAP) == ()


@pytest.mark.parametrize(
    ("changes", "given", "name"),
    [
        ({"depth_of_cut": 0.6e-3}, {}, "depth_of_cut"),
        ({"depth_of_cut": 0.3e-3, "nose_radius": 0.2e-3}, {}, "depth_of_cut"),
        ({"feed_per_rev": 0.3e-3}, {}, "feed_per_tool"),
        ({"spindle_hz": 8.0}, {}, "spindle_hz"),
        ({}, {"shift": math.radians(21.0)}, "shift"),
    ],
)
def test_cuts_outside_the_range_are_flagged(changes, given, name):
    doubts = validity(bar(), cut(**changes), **given)
    assert name in [d.name for d in doubts]
    assert str(doubts[0]).startswith(f"{doubts[0].name} should be ")


def test_bars_outside_the_range_are_flagged():
    long = validity(bar(length=0.5), cut())
    assert "natural_frequency_hz" in [d.name for d in long]
    thin = bar(diameter=2e-3, length=0.3, chuck=Chuck(lateral_stiffness=1e9, tilt_stiffness=1e6))
    assert "feed_force" in [d.name for d in validity(thin, cut())]


def test_a_bar_without_length_is_refused():
    with pytest.raises(ValueError, match="length must be more than two diameters"):
        bar(length=0.0)


def test_models_that_are_none_are_refused():
    with pytest.raises(ValueError, match="cut must be linear or surface, got map"):
        ProcessModel(cut="map")
    with pytest.raises(ValueError, match="directions must be 2 with the surface map, got 1"):
        ProcessModel(cut="surface")
    with pytest.raises(ValueError, match="directions must be 1 or 2, got 3"):
        ProcessModel(directions=3)


def test_a_tool_beyond_the_map_stops_the_simulation():
    sim = simulator(model=MAP, air_time=0.0)
    sim._state["bar"][0, 1] = -2.0
    with pytest.raises(SimulationDiverged, match="beyond the surface map"):
        run(sim, 0.1)


def test_a_spindle_too_slow_for_the_map_is_said():
    sim = simulator(model=MAP, air_time=0.0)
    with pytest.raises(SimulationDiverged, match="too slow"):
        sim.advance(np.zeros(9000), np.zeros(9000), 6.0)
