"""The envelope at its edges: exact sums over the ends of blocks, and the search for the shortest stop that fits."""

import itertools
import math

import numpy as np
import pytest

from services.guard_motion import LONGEST_STOP_S, RESUME_S, Envelope, Way
from tests.services.guard_kit import BLOCK, LIMITS, RATE, SoundPath, limits, on_arc
from tests.services.test_guard_motion import ANYWHERE, INSIDE, WIDE, resting, step

STOPS = {
    "jerk": {},
    "acceleration": {"shift_acceleration": 3.0, "slide_acceleration": 0.03, "shift_jerk": 2e5, "slide_jerk": 2e3},
    "longest": {"shift_jerk": 1.0, "slide_jerk": 0.01},
    "swinging": {"shift_speed": 0.05, "return_speed": 0.05, "slide_speed": 1e-3},
    "shortest": {"shift_jerk": 1e9, "slide_jerk": 1e8, "shift_acceleration": 1e5, "slide_acceleration": 1e4},
}


def longest_needed(lim):
    """Samples that a stop may take: from full speed and acceleration at once, by the jerk and by the acceleration."""
    most = 0.0
    for v, a, j in zip(lim.each("speed"), lim.each("acceleration"), lim.each("jerk"), strict=True):
        by_jerk = (4.0 * a + math.sqrt(16.0 * a * a + 24.0 * v * j)) / (2.0 * j)
        most = max(most, RATE * by_jerk, RATE * 3.0 * v / a)
    return min(1.5 * most, LONGEST_STOP_S * RATE)


@pytest.mark.parametrize("name", STOPS)
def test_the_stops_that_are_considered(name):
    lim = limits(**STOPS[name])
    envelope, lengths, length = Envelope(lim, (0.0, 0.0, 0.0)), [], 8.0
    while length < 1.25 * longest_needed(lim) or not lengths:
        lengths.append(round(length))
        length *= 1.25
    assert [len(of_speed) - 3 for of_speed, _ in envelope._stops] == lengths
    assert envelope._lengths.tolist() == [lengths]
    for n, (of_speed, of_change) in zip(lengths, envelope._stops, strict=True):
        u = [k / n for k in range(1, n + 1)]
        way = list(itertools.accumulate(1.0 - 3.0 * x * x + 2.0 * x**3 for x in u))
        change = list(itertools.accumulate(n * (x - 2.0 * x * x + x**3) for x in u))
        np.testing.assert_allclose(of_speed, way + way[-1:] * 3, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(of_change, change + change[-1:] * 3, rtol=1e-9, atol=1e-9)


def test_the_stops_that_are_considered_for_many_machines():
    rng = np.random.default_rng(3)
    for _ in range(150):
        v, a, j = 10.0 ** rng.uniform((-2.0, 0.5, 2.0), (0.0, 2.0, 4.0))
        lim = limits(
            shift_speed=v, return_speed=v, shift_acceleration=a, shift_jerk=j,
            slide_speed=0.01 * v, slide_acceleration=0.01 * a, slide_jerk=0.01 * j,
        )  # fmt: skip
        lengths, length = [], 8.0
        while length < 1.25 * longest_needed(lim) or not lengths:
            lengths.append(round(length))
            length *= 1.25
        assert Envelope(lim, (0.0, 0.0, 0.0))._lengths.tolist() == [lengths]


@pytest.mark.parametrize("name", ["jerk", "acceleration"])
def test_the_shortest_stop_that_fits_is_the_one_that_is_kept(name):
    """Tried are those whose jerk at the ends and acceleration in the middle cannot be beyond their limits."""
    lim = limits(**STOPS[name] | {"path_shift": 1.0, "path_slide": 1.0})
    envelope, path, lengths = resting(lim), SoundPath(speed=0.12), set()
    path.goal = math.radians(4.0)
    for _ in range(45):
        block = on_arc(path.advance(45))
        history, before = envelope._history.copy(), envelope.travel.copy()
        if envelope.follow(block, 45, ANYWHERE):
            break
        joined = np.concatenate((history, block), axis=1)[:, -history.shape[1] :]
        travel = before + np.abs(np.diff(block, prepend=history[:, -1:])).sum(axis=1, keepdims=True)
        last, speed = block[:, -1:], block[:, -1:] - block[:, -2:-1]
        change = speed - (block[:, -2:-1] - block[:, -3:-2])
        if not envelope.moving:
            assert not speed.any()
            continue
        for of_speed, of_change in envelope._stops:
            n = len(of_speed) - 3
            jerk = 6.0 * np.abs(speed[:, 0]) / n**2 + 4.0 * np.abs(change[:, 0]) / n
            least = 1.5 * np.abs(speed[:, 0]) / n
            hardest, fastest = (np.array(lim.each(what)) for what in ("jerk", "acceleration"))
            if (jerk > INSIDE * hardest / RATE**3).any() or (least > INSIDE * fastest / RATE**2).any():
                continue
            points = last + speed * of_speed + change * of_change
            if not envelope._violation(joined, points, travel):
                break
        np.testing.assert_array_equal(envelope._stop, points)
        lengths.add(points.shape[1])
    assert len(lengths) > 3, "several lengths were needed"


def test_an_envelope_begins_at_rest_with_nothing_behind_it():
    for interval, kept in ((1 / RATE, 3), (2 / RATE, 3), (5 / RATE, 5), (0.01, 90)):
        start = on_arc(0.01)
        envelope = Envelope(limits(interval=interval), start)
        assert envelope._history.shape == (3, kept)
        assert (envelope._history == start[:, None]).all()
        assert envelope._still == kept
        assert not envelope.moving
        assert not envelope.settled
        assert envelope._held
        assert envelope._eased == 0
        for column in (envelope._bias, envelope.travel):
            assert column.tolist() == [[0.0]] * 3
        assert envelope._reference.shape == (3, 1)
        assert np.isnan(envelope._reference).all()


def test_what_a_stop_left_is_taken_out_over_a_second_without_a_kink():
    envelope = resting(LIMITS)
    ease, n = envelope._ease, round(RESUME_S * RATE)
    k = np.arange(1, n + 1) / n
    np.testing.assert_allclose(ease, 1.0 - (10.0 * k**3 - 15.0 * k**4 + 6.0 * k**5), atol=1e-12)
    assert ease[-1] == 0.0
    left = np.array([[0.0], [1.5e-6], [-1.5e-6]])
    envelope = Envelope(LIMITS, (0.0, 0.0, 0.0))
    envelope.hold(np.zeros((3, BLOCK)) - left, BLOCK)
    seen = []
    for _ in range(120):
        assert envelope.follow(np.zeros((3, BLOCK)) - left, BLOCK, ANYWHERE) == ""
        seen.append(envelope.issued(BLOCK))
    issued = np.concatenate(seen, axis=1)
    np.testing.assert_allclose(issued[:, :n], -left + left * ease, rtol=0.0, atol=1e-20)
    assert (issued[:, n:] == -left).all()


def test_what_was_travelled_is_the_sum_of_all_steps_also_at_the_ends_of_blocks():
    envelope, path, seen = resting(LIMITS), SoundPath(), [np.zeros((3, 1))]
    path.goal = 0.05
    for count in range(60):
        block = on_arc(path.advance(37))
        assert envelope.follow(block, 37, ANYWHERE) == ""
        seen.append(block)
        steps = np.abs(np.diff(np.concatenate(seen, axis=1), axis=1)).sum(axis=1)
        np.testing.assert_allclose(envelope.travel[:, 0], steps, rtol=1e-12, atol=1e-18)
        np.testing.assert_array_equal(envelope.position, block[:, -1])
        moved = np.diff(np.concatenate(seen[-2:], axis=1)[:, -38:]).any()
        assert envelope._still == (0 if moved else 90 + 90 + 37 * (count + 1))
    envelope.hold(block, 37)
    np.testing.assert_array_equal(envelope.position, envelope.issued(1)[:, 0])


@pytest.mark.parametrize("share", [1 - 1e-9, 1 + 1e-9])
def test_total_travel_is_exact_over_the_edge_of_a_block(share):
    slope, most = 1e-6, 2.0**-12
    lim = limits(**WIDE | {"slide_travel": most, "slide_jerk": 1e9})
    count = INSIDE * most / slope * share
    first = np.zeros((3, 90))
    first[2] = np.arange(1, 91) * slope
    envelope = resting(lim)
    assert envelope.follow(first, 90, ANYWHERE) == ""
    second = np.zeros((3, 400))
    second[2] = np.minimum(np.arange(91, 491) * slope, count * slope)
    assert envelope.follow(second, 400, ANYWHERE).startswith("" if share < 1 else "total travel of y1")
    assert (envelope.position[2] > first[2, -1]) is np.bool_(share < 1)


def test_the_step_per_interval_is_taken_over_the_edge_of_a_block():
    lim = limits(**WIDE | {"shift_step": 1e-3, "interval": 20 / RATE, "shift_jerk": 1e14})
    for slope, why in ((0.99e-3 / 20, ""), (1.01e-3 / 20, "step per interval of shift beyond its limit: 0.00101")):
        envelope = resting(lim)
        ramp = np.zeros((3, 12))
        ramp[0] = np.arange(1, 13) * slope
        assert envelope.follow(ramp, 12, ANYWHERE) == ""
        ramp[0] += 12 * slope
        assert envelope.follow(ramp, 12, ANYWHERE) == why


@pytest.mark.parametrize(("order", "what"), list(enumerate(("speed", "acceleration", "jerk"), start=1)))
@pytest.mark.parametrize(("axis", "kind"), list(enumerate(("shift", "slide", "slide"))))
def test_a_limit_that_is_passed_is_told_in_its_own_unit(axis, kind, order, what):
    lim = limits(**WIDE | {f"{kind}_{what}": 1e-6, "return_speed": 1e-7})
    points = step(axis, 2.0**-20)
    why = resting(lim).follow(points, 90, ANYWHERE)
    name = ("shift", "x1", "y1")[axis]
    assert why == f"{what} of {name} beyond its limit: {2.0**-20 * RATE**order:.6g}"


def test_edges_that_binary_numbers_hit_exactly():
    near = 2.0**-13
    lim = limits(**WIDE | {"path_shift": near, "path_slide": near, "sample_rate_hz": 8192.0})
    for low, high, shift in ((0.0, 0.0, near), (0.0, 0.0, -near), (-near, near, 2 * near), (-near, near, -2 * near)):
        way = Way(low, high, 1e-9)
        assert resting(lim).follow(step(0, shift), 90, way) == ""
        why = resting(lim).follow(step(0, shift * (1 + 2.0**-40)), 90, way)
        assert why.startswith("path leaves the way to its target: shift ")
    assert resting(lim).follow(step(1, near), 90, Way(0.0, 0.0, 1e-9)) == ""
    assert "arc" in resting(lim).follow(step(1, near * (1 + 2.0**-40)), 90, Way(0.0, 0.0, 1e-9))
    assert resting(lim).follow(step(0, 2.0**-14), 90, ANYWHERE._replace(speed=0.5)) == ""
    slow = ANYWHERE._replace(speed=0.5 - 2.0**-40)
    assert resting(lim).follow(step(0, 2.0**-14), 90, slow) == "path is faster than asked: shift 0.5"


def test_a_path_at_rest_costs_no_check(monkeypatch):
    envelope, calls = resting(LIMITS), []
    check = Envelope._violation
    monkeypatch.setattr(Envelope, "_violation", lambda *given: calls.append(1) or check(*given))
    for count in range(103):
        assert envelope.follow(np.zeros((3, 90)), 90, ANYWHERE) == ""
        assert bool(calls) is (count < 1), "after the first block nothing is left to take out"
        calls.clear()
    left = np.array([[0.0], [1e-6], [0.0]])
    envelope.hold(np.zeros((3, 90)) - left, 90)
    for count in range(103):
        assert envelope.follow(np.zeros((3, 90)) - left, 90, ANYWHERE) == ""
        assert bool(calls) is (count < 101), count
        calls.clear()
    assert envelope.follow(np.zeros((3, 91)) - left, 91, ANYWHERE) == ""
    assert calls, "longer than what is known"


def test_with_the_shortest_memory_the_differences_still_reach_back():
    lim = limits(**WIDE | {"slide_jerk": 1e6, "interval": 1 / RATE})
    size = 0.9 * INSIDE * 1e6 / RATE**3
    for jerk, passes in ((size, True), (2.5 * size, False)):
        envelope = resting(lim)
        slow = np.cumsum(np.cumsum([jerk, 0.0, -jerk, 0.0]))
        said = []
        for value in slow:
            points = np.zeros((3, 1))
            points[1] = value
            said.append(envelope.follow(points, 1, ANYWHERE))
        assert (said[0] == "") is passes, said
        assert any(why.startswith("jerk of x1") for why in said) is not passes


def test_one_sample_before_rest_it_still_moves():
    envelope, path = resting(LIMITS), SoundPath()
    path.goal = 0.05
    for _ in range(8):
        assert envelope.follow(on_arc(path.advance(90)), 90, ANYWHERE) == ""
    left = envelope._stop.shape[1]
    envelope.hold(None, left - 1)
    assert envelope.moving
    rest = envelope.rest
    envelope.hold(None, 1)
    assert not envelope.moving
    assert (envelope.position == rest).all()


def test_a_following_error_of_exactly_the_limit_passes():
    envelope = Envelope(limits(shift_following=2.0**-9), (0.0, 0.0, 0.0))
    assert envelope.lags(np.array([2.0**-9, 0.0, 0.0])) == ""
    assert "shift" in envelope.lags(np.array([2.0**-9 * (1 + 2.0**-40), 0.0, 0.0]))
