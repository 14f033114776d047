"""Jerk-limited path: bounded whatever the targets do, exact at rest, the same however the stream is cut."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pitch import ShiftTrajectory, TrajectoryLimits, arc_position, offset_from_slides, slide_set_points
from pitch.trajectory import GRID
from tests.reference.pitch_trajectory import fir_path

RATE = 9000.0
MODEST = TrajectoryLimits(max_speed=0.6, max_acceleration=20.0, max_jerk=1000.0)
LIMITS = st.builds(
    TrajectoryLimits,
    max_speed=st.floats(0.05, 5.0),
    max_acceleration=st.floats(10.0, 200.0),
    max_jerk=st.floats(900.0, 20000.0),
)
SHIFTS = st.floats(-0.35, 0.35)
ORDERS = st.lists(st.tuples(st.one_of(SHIFTS, st.none()), st.integers(1, 400)), min_size=1, max_size=12)


def drive(path, orders):
    """Set points of a list of (target or None for a stop, samples)."""
    pieces = []
    for target, samples in orders:
        if target is None:
            path.stop()
        else:
            path.retarget(target)
        pieces.append(path.advance(samples))
    return np.concatenate(pieces)


def assert_bounded(shift, limits, rate_hz):
    speed, acceleration, jerk = (np.diff(shift, k) * rate_hz**k for k in (1, 2, 3))
    assert np.abs(speed).max() <= limits.max_speed * (1 + 1e-9)
    assert np.abs(acceleration).max() <= limits.max_acceleration * (1 + 1e-9)
    assert np.abs(jerk).max() <= limits.max_jerk * (1 + 1e-6)


@given(LIMITS, SHIFTS, ORDERS)
def test_bounds_hold_under_any_targets(limits, start, orders):
    path = ShiftTrajectory(limits, RATE, start)
    moved = drive(path, orders)
    rest = path.advance(path.samples_to_rest + 5)
    assert_bounded(np.concatenate((np.full(4, start), moved, rest)), limits, RATE)


@given(LIMITS, st.integers(0, 2**32 - 1))
def test_bounds_hold_when_the_target_jitters_every_sample(limits, seed):
    rng = np.random.default_rng(seed)
    path = ShiftTrajectory(limits, RATE)
    targets = np.where(rng.random(600) < 0.02, rng.choice([-0.3, 0.3], 600), math.nan)
    shift = drive(path, [(path.target if math.isnan(target) else target, 1) for target in targets])
    assert_bounded(np.concatenate((np.zeros(4), shift)), limits, RATE)


@given(LIMITS, SHIFTS, ORDERS)
def test_it_arrives_exactly_and_then_rests_exactly(limits, start, orders):
    path = ShiftTrajectory(limits, RATE, start)
    drive(path, orders)
    remaining = path.samples_to_rest
    if remaining:
        path.advance(remaining - 1)
        assert path.moving
        assert path.advance(1)[-1] == path.target
    assert not path.moving
    assert set(path.advance(500).tolist()) == {path.target}


@given(LIMITS, SHIFTS, ORDERS)
def test_it_never_leaves_the_span_of_its_targets(limits, start, orders):
    path = ShiftTrajectory(limits, RATE, start)
    shift = drive(path, orders)
    span = [start, *(target for target, _ in orders if target is not None)]
    assert min(span) - GRID <= shift.min()
    assert shift.max() <= max(span) + GRID


@given(SHIFTS, SHIFTS)
def test_a_single_move_never_turns_back(start, target):
    path = ShiftTrajectory(MODEST, RATE, start)
    path.retarget(target)
    steps = np.diff(path.advance(path.samples_to_rest)) * (1 if target > start else -1)
    assert steps.min(initial=0.0) >= -GRID


@given(ORDERS, st.lists(st.integers(0, 97), min_size=1, max_size=6))
def test_any_cutting_into_blocks_is_the_same_to_the_bit(orders, cuts):
    whole, parts = ShiftTrajectory(MODEST, RATE), ShiftTrajectory(MODEST, RATE)
    for target, samples in orders:
        for path in (whole, parts):
            path.stop() if target is None else path.retarget(target)
        got, left = [], samples
        while left > 0:
            for cut in (min(c, left) for c in [*cuts, 1]):
                got.append(parts.advance(cut))
                left -= cut
        assert np.concatenate(got).tolist() == whole.advance(samples).tolist()


@given(ORDERS, ORDERS)
def test_restore_repeats_the_future(before, after):
    path = ShiftTrajectory(MODEST, RATE, 0.01)
    drive(path, before)
    state = path.snapshot()
    first = drive(path, after)
    path.restore(state)
    assert drive(path, after).tolist() == first.tolist()


@given(ORDERS)
def test_against_the_plain_twin(orders):
    coarse = TrajectoryLimits(max_speed=5.0, max_acceleration=4000.0, max_jerk=4e6)
    path = ShiftTrajectory(coarse, RATE)
    shift = drive(path, orders)
    # the same from the documented sizing: averages over 2 v/a and 2 a/j, speed in whole counts
    step, first, second = int((5.0 - GRID * RATE) / RATE / GRID), 23, 18
    goals, goal = [], 0
    levels = [0]
    for target, samples in orders:
        goal = levels[-1] if target is None else round(target / GRID)
        for _ in range(samples):
            goals.append(goal)
            levels.append(levels[-1] + max(-step, min(step, goal - levels[-1])))
    want = [float(value * GRID) for value in fir_path(0, goals, step, first, second)]
    np.testing.assert_allclose(shift, want, rtol=0, atol=GRID)


def test_no_drift_after_many_moves():
    path = ShiftTrajectory(MODEST, RATE)
    rng = np.random.default_rng(4)
    for target in rng.uniform(-0.1, 0.1, 2000):
        path.retarget(target)
        path.advance(int(rng.integers(1, 400)))
    path.retarget(0.0)
    assert path.advance(path.samples_to_rest)[-1] == 0.0


def test_stop_in_mid_move_comes_to_rest_in_the_length_of_the_averages():
    path = ShiftTrajectory(MODEST, RATE)
    path.retarget(0.2)
    here = path.advance(1800)[-1]
    path.stop()
    assert path.samples_to_rest <= 0.101 * RATE
    assert here < path.advance(1000)[-1] < 0.2
    assert not path.moving


def test_a_published_move_takes_a_fifth_of_a_second_and_shakes_little():
    path = ShiftTrajectory(MODEST, RATE)
    path.retarget(math.radians(2.76))
    assert 0.15 < path.samples_to_rest / RATE < 0.25
    acceleration = np.diff(np.concatenate((path.advance(2250), path.advance(6750))), 2) * RATE**2
    spectrum, hertz = np.abs(np.fft.rfft(acceleration)) ** 2, np.fft.rfftfreq(len(acceleration), 1 / RATE)
    assert spectrum[hertz > 150.0].sum() < 1e-5 * spectrum.sum()
    assert spectrum[hertz > 500.0].sum() < 1e-6 * spectrum.sum()


def test_the_depth_of_cut_stays_all_along_the_move():
    path = ShiftTrajectory(MODEST, RATE)
    path.retarget(0.05)
    shift = path.advance(2000)
    found = arc_position(offset_from_slides(*slide_set_points(shift, 0.025)), 0.025)
    np.testing.assert_allclose(found.shift, shift, atol=1e-15)
    assert np.abs(found.radial_deviation).max() < 1e-16


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: TrajectoryLimits(max_speed=0.0, max_acceleration=1.0, max_jerk=1.0), "max_speed must be > 0, got 0.0"),
        (lambda: ShiftTrajectory(MODEST, 0.0), "sample_rate_hz must be > 0"),
        (lambda: ShiftTrajectory(MODEST, 1e9), "limits must be above the rounding"),
        (lambda: ShiftTrajectory(MODEST, RATE, math.nan), "shift must be finite, got nan"),
        (lambda: ShiftTrajectory(MODEST, RATE).retarget(1.6), "shift must be in"),
        (lambda: ShiftTrajectory(MODEST, RATE).advance(-1), "n must be a whole number >= 0, got -1"),
        (
            lambda: ShiftTrajectory(TrajectoryLimits(max_speed=1.0, max_acceleration=1.0, max_jerk=3.0), RATE),
            "limits must let the shift settle",
        ),
    ],
)
def test_bad_arguments_name_value_and_rule(call, message):
    with pytest.raises(ValueError, match=message):
        call()


def test_a_state_of_another_path_is_refused():
    slow = TrajectoryLimits(max_speed=0.1, max_acceleration=20.0, max_jerk=1000.0)
    with pytest.raises(ValueError, match="state must hold"):
        ShiftTrajectory(MODEST, RATE).restore(ShiftTrajectory(slow, RATE).snapshot())
