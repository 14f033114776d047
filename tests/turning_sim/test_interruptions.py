"""A cut that is interrupted, knocked or fed otherwise: what the plant does then, and that nothing else changes."""

import dataclasses

import numpy as np
import pytest

from tests.turning_sim.cases import cut, run, simulator

QUIET = {"force_noise": 0.0, "setting_difference": 0.0}
STEADY = cut().steady_forces[0]


def advanced(sim, samples, knock=None):
    still = np.zeros(samples)
    return sim.advance(still, still, None, knock)


def test_tools_that_pause_leave_the_cut_and_enter_where_they_were():
    sim = simulator(cut_changes=QUIET, air_time=0.02)
    before = run(sim, 0.3)
    sim.resume(air_time=0.1)
    after = run(sim, 0.3)
    assert not after["in_cut"][:900].any()
    assert after["in_cut"][900:].all()
    assert np.abs(after["force_x1"][1:900]).max() == 0.0
    step = np.diff(before["tool_position"])[-1]
    assert after["tool_position"][900] == pytest.approx(before["tool_position"][-1] + step, abs=1e-12)


def test_a_pass_begins_again_at_another_place():
    sim = simulator(air_time=0.0)
    run(sim, 0.2)
    sim.resume(air_time=0.01, position=2e-3)
    assert run(sim, 0.1)["tool_position"][90] == pytest.approx(2e-3, abs=1e-12)


def test_resuming_with_nothing_changed_changes_nothing():
    one, other = simulator(air_time=0.02), simulator(air_time=0.02)
    whole = run(one, 0.4)
    first = run(other, 0.2)
    other.resume()
    second = run(other, 0.2)
    vibration = np.concatenate([first["vibration"], second["vibration"]])
    assert vibration == pytest.approx(whole["vibration"], abs=1e-12)
    joined = np.concatenate([first["tool_position"], second["tool_position"]])
    assert whole["tool_position"] == pytest.approx(joined, abs=1e-15)


def test_half_the_feed_moves_the_tools_half_as_fast():
    sim = simulator(cut_changes=QUIET, air_time=0.0)
    before = run(sim, 0.2)
    sim.resume(cutting=dataclasses.replace(sim.cutting, feed_per_rev=0.5 * sim.cutting.feed_per_rev))
    after = run(sim, 0.2)
    paces = [np.diff(part["tool_position"]).mean() for part in (before, after)]
    assert paces[1] == pytest.approx(0.5 * paces[0], rel=1e-6)


def test_another_cutting_stiffness_changes_the_chatter():
    sim = simulator(air_time=0.0)
    assert np.abs(run(sim, 1.0)["vibration"][4500:]).max() > 10e-6
    sim.resume(air_time=0.2, cutting=cut(cutting_stiffness=1.06e5))
    assert np.abs(run(sim, 1.0)["vibration"][4500:]).max() < 5e-6


def test_the_snapshot_holds_the_condition():
    sim = simulator(air_time=0.0)
    run(sim, 0.1)
    kept = sim.snapshot()
    expected = run(sim, 0.1)
    sim.resume(air_time=0.05, cutting=cut(cutting_stiffness=2e5))
    run(sim, 0.1)
    sim.restore(kept)
    again = run(sim, 0.1)
    assert np.array_equal(again["vibration"], expected["vibration"])
    assert sim.cutting == cut()


def test_a_knock_is_felt_by_the_tool_it_hits_and_only_in_contact():
    calm, hit = simulator(cut_changes=QUIET, air_time=0.02), simulator(cut_changes=QUIET, air_time=0.02)
    knock = np.zeros((360, 2))
    knock[90:99, 0] = 20.0
    knock[270:279, 1] = 20.0
    one, other = advanced(calm, 360), advanced(hit, 360, knock)
    assert np.array_equal(one.force_x1[:181], other.force_x1[:181])  # in air there is nothing to hit
    change = other.force_x2 - one.force_x2
    assert change[271] == pytest.approx(20.0, abs=1.0)
    assert change[271:279].min() > 5.0  # the bar yields meanwhile
    assert np.abs(other.vibration[280:]).max() > np.abs(one.vibration[280:]).max()


def test_without_noise_the_steady_force_is_the_law():
    sim = simulator(cut_changes=QUIET | {"cutting_stiffness": 1.06e5}, air_time=0.0)
    assert run(sim, 0.5)["force_x1"][-900:].mean() == pytest.approx(STEADY, rel=0.01)


def test_bad_interruptions_are_named():
    sim = simulator(air_time=0.0)
    with pytest.raises(ValueError, match="air_time must be at least 0, got -1"):
        sim.resume(air_time=-1.0)
    with pytest.raises(ValueError, match="position must be in"):
        sim.resume(position=1.0)
    with pytest.raises(ValueError, match=r"knock must be finite, shape \(90, 2\)"):
        advanced(sim, 90, np.zeros(90))
