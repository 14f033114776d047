"""The envelope of motion: what keeps every limit passes, one step more does not, and nothing else ever leaves."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from services.guard_limits import MARGIN
from services.guard_motion import Envelope, Way, arc
from tests.services.guard_kit import DIAMETER, LIMITS, PSI, RATE, SoundPath, limits, on_arc, worst

WIDE = {
    **dict.fromkeys(("shift", "dx", "dy", "x1", "y1"), 0.78),
    **{f"{axis}_{what}": 1e3 for axis in ("shift", "slide") for what in ("speed", "step", "travel", "following")},
    **{f"{axis}_acceleration": 1e9 for axis in ("shift", "slide")},
    **{f"{axis}_jerk": 1e14 for axis in ("shift", "slide")},
    "path_shift": 1.0,
    "path_slide": 1.0,
}
ANYWHERE = Way(-0.78, 0.78, DIAMETER / 2)
INSIDE = 1.0 - MARGIN


def resting(lim, start=(0.0, 0.0, 0.0), samples=90):
    """An envelope that has stood for a block, with the path resting where it stands."""
    envelope = Envelope(lim, start)
    envelope.hold(tuple(np.full(samples, value) for value in start), samples)
    return envelope


def step(axis, size, samples=90):
    """A path that makes one step on one axis, with the next sample, and stays."""
    points = np.zeros((3, samples))
    points[axis, 1:] = size
    return points


ONE_LIMIT = [
    *[(axis, name, f"{name}", 1.0, "position") for axis, name in enumerate(("shift", "x1", "y1"))],
    (1, "dx", "dx", 1.0, "position"),
    (2, "dy", "dy", math.sin(PSI), "position"),
    *[
        (axis, f"{kind}_{what}", label, share, what)
        for axis, (kind, label) in enumerate((("shift", "shift"), ("slide", "x1"), ("slide", "y1")))
        for what, share in (
            ("speed", RATE),
            ("acceleration", RATE**2),
            ("jerk", 2.0 * RATE**3),
            ("step", 1.0),
            ("travel", 1.0),
        )
    ],
]


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(("axis", "name", "label", "share", "what"), ONE_LIMIT)
def test_each_limit_at_its_edge(axis, name, label, share, what, sign):
    value = {"jerk": 1e3, "acceleration": 1e2}.get(what, 1e-3)
    lim = limits(**WIDE | {name: value, "target": 1e-4, "return_speed": 1e-4})
    edge = INSIDE * value / share
    at_edge = [] if name == "dy" else [(edge, True)]
    for size, passes in ((edge * (1 - 1e-9), True), *at_edge, (edge * (1 + 1e-9), False), (value / share, False)):
        envelope = resting(lim)
        why = envelope.follow(step(axis, sign * size), 90, ANYWHERE)
        assert bool(why) is not passes, why
        if why:
            assert label in why
            assert what in why
            assert not envelope.moving
            assert (envelope.position == 0.0).all()
        else:
            assert envelope.position[axis] == sign * size


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_position_exactly_at_the_inner_edge_passes(sign):
    edge = INSIDE * 1e-3
    lim = limits(**WIDE | {"x1": 1e-3})
    assert resting(lim).follow(step(1, sign * edge), 90, ANYWHERE) == ""
    assert "x1" in resting(lim).follow(step(1, sign * np.nextafter(edge, 1.0)), 90, ANYWHERE)


def test_differences_are_carried_across_blocks_of_any_size():
    lim = limits(**WIDE | {"slide_jerk": 1e6})
    size = 0.9 * 1e6 / RATE**3
    whole = np.zeros((3, 12))
    whole[1, 3:] = np.cumsum(np.cumsum([size, 0, 0, -size, -size, 0, 0, size, 0.0]))
    for cut in range(1, 12):
        for bump in (0.0, 0.5 * size):
            envelope, points = resting(lim), whole.copy()
            points[1, 5:] += bump
            first = envelope.follow(points[:, :cut], cut, ANYWHERE)
            second = envelope.follow(points[:, cut:], 12 - cut, ANYWHERE)
            assert bool(first + second) is bool(bump)


def test_the_step_is_taken_over_exactly_the_interval():
    lim = limits(**WIDE | {"shift_step": 1e-3, "interval": 20 / RATE})
    ramp = np.zeros((3, 90))
    for slope, passes in ((INSIDE * 0.999999e-3 / 20, True), (1e-3 / 19.9, False)):
        ramp[0, :60] = np.arange(60) * slope
        ramp[0, 60:] = ramp[0, 59]
        assert bool(resting(lim).follow(ramp, 90, ANYWHERE)) is not passes


def test_travel_adds_up_over_blocks_and_both_directions():
    envelope = resting(limits(**WIDE | {"slide_travel": 3e-3}))
    there, back = step(2, 1e-3), 1e-3 - step(2, 1e-3)
    back[:2] = 0.0
    assert envelope.follow(there, 90, ANYWHERE) == envelope.follow(back, 90, ANYWHERE) == ""
    assert envelope.affords(np.full((3, 1), 0.99e-3))
    assert not envelope.affords(np.full((3, 1), 1.01e-3))
    assert envelope.follow(step(2, 1.01e-3), 90, ANYWHERE).startswith("total travel of y1")
    assert envelope.follow(step(2, 0.99e-3), 90, ANYWHERE) == ""


def test_a_block_without_room_to_stop_does_not_pass():
    envelope = resting(limits(**WIDE | {"slide_acceleration": 1.0, "x1": 1e-3}))
    ramp = np.zeros((3, 90))
    ramp[1] = np.cumsum(np.arange(90)) * 0.99 / RATE**2
    assert envelope.follow(ramp, 90, ANYWHERE) == ""
    while not (why := envelope.follow(ramp, 90, ANYWHERE)):
        ramp[1] = ramp[1, -1] + np.arange(1, 91) * (ramp[1, -1] - ramp[1, -2])
    assert why.startswith(("no room", "position", "acceleration"))
    while envelope.moving:
        envelope.hold(ramp, 90)
    assert envelope.position[1] <= 1e-3


def test_travel_must_leave_room_to_stop():
    ramp = np.zeros((3, 90))
    ramp[2] = np.arange(90) * 1e-6
    for most, why in ((0.5, ""), (91e-6, "no room to stop after this block"), (88e-6, "total travel of y1")):
        envelope = resting(limits(**WIDE | {"slide_travel": most, "slide_jerk": 2e6}))
        assert envelope.follow(ramp, 90, ANYWHERE).startswith(why)
        assert envelope.moving is not bool(why)


@pytest.mark.parametrize("tail", [(1, 2, 3), (0, 1, 1), (2, 1, 0), (1, 0, 0), (0, 0, 1)])
def test_neither_even_speed_nor_a_turning_point_is_rest(tail):
    """Exact in binary, so that the speed or its change is exactly zero at the end of the block."""
    lim = limits(**WIDE | {"slide_jerk": 1e6})
    ramp = np.zeros((3, 90))
    ramp[1, 87:] = np.array(tail) * 2.0**-22
    envelope = resting(lim)
    assert envelope.follow(ramp, 90, ANYWHERE) == ""
    assert envelope.moving
    seen = [np.zeros((3, 4)), envelope.issued(90)]
    while envelope.moving:
        envelope.hold(ramp, 90)
        seen.append(envelope.issued(90))
    assert worst(np.concatenate(seen, axis=1), lim) <= 1.0


@pytest.mark.parametrize(
    "request_",
    [
        np.zeros((3, 89)),
        np.zeros((2, 90)),
        np.zeros(90),
        (np.zeros(90), np.zeros(90), np.zeros(89)),
        ("a", "b", "c"),
        np.zeros((3, 90), dtype=complex),
        np.zeros((3, 90), dtype=bool),
        (None, None, None),
        [[10**400] * 90] * 3,
        None,
    ],
)
def test_what_is_no_path_of_this_length_is_refused(request_):
    envelope = resting(LIMITS)
    assert "not three series" in envelope.follow(request_, 90, ANYWHERE)
    envelope.hold(request_, 90)
    assert "does not begin" in envelope.follow(np.zeros((3, 90)), 90, ANYWHERE)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 0.5, 1e9, -1e9, 1e308])
@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("where", [0, 44, 89])
def test_wild_values_are_refused_wherever_they_are(value, axis, where):
    points = np.zeros((3, 90))
    points[axis, where] = value
    envelope = resting(LIMITS)
    assert envelope.follow(points, 90, ANYWHERE).startswith(f"position of {('shift', 'x1', 'y1')[axis]}")
    envelope.hold(points[:, ::-1], 90)
    assert (envelope.issued(180) == 0.0).all()


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_path_keeps_to_its_way_and_to_the_arc(sign):
    lim = limits(**WIDE | {"path_shift": 1e-4, "path_slide": 2e-6})
    low, high = sorted((0.0, sign * 1e-3))
    way = Way(low, high, DIAMETER / 2)
    for shift, off, passes in (
        (1.09e-3, 0.0, True),
        (1.11e-3, 0.0, False),
        (-0.9e-4, 0.0, True),
        (-1.1e-4, 0.0, False),
        (1e-3, 1.9e-6, True),
        (1e-3, 2.1e-6, False),
    ):
        for axis in (1, 2):
            points = on_arc(step(0, sign * shift)[0])
            points[axis, 1:] += sign * off
            assert bool(resting(lim).follow(points, 90, way)) is not passes
    assert "arc" in resting(lim).follow(on_arc(step(0, sign * 1e-3)[0]), 90, way._replace(radius=math.nan))


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_path_faster_than_asked_is_refused_also_in_blocks_of_one_sample(sign):
    lim = limits(**WIDE)
    way = ANYWHERE._replace(speed=0.25)
    for size, passes in ((0.2499 / RATE, True), (0.2501 / RATE, False)):
        envelope = resting(lim)
        whys = [envelope.follow(np.array([[sign * size], [0.0], [0.0]]), 1, way) for _ in range(2)]
        assert ("".join(whys) == "") is passes


def test_it_starts_only_within_the_limits():
    Envelope(LIMITS, on_arc(math.radians(5.9)))
    for start in (on_arc(math.radians(6.1)), (0.0, 1.9e-3, 0.0), (0.0, math.nan, 0.0)):
        with pytest.raises(ValueError, match="start must be within the limits, got position of"):
            Envelope(LIMITS, start)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_commanded_minus_measured_at_its_edge(axis, sign):
    envelope = resting(LIMITS)
    for share, passes in ((1 - 1e-9, True), (1 + 1e-9, False)):
        measured = np.zeros((3, 90))
        measured[axis, 40] = sign * share * LIMITS.each("following")[axis]
        assert (envelope.lags(measured) == "") is passes
    assert envelope.lags(np.zeros(3)) == envelope.lags(np.zeros((3, 500))) == ""


@pytest.mark.parametrize(
    "measured", [None, "no", np.zeros((3, 0)), np.zeros(2), np.full(3, np.nan), np.full(3, np.inf)]
)
def test_a_measurement_that_is_none_is_noticed(measured):
    assert "not three finite" in resting(LIMITS).lags(measured)


def test_measured_samples_are_compared_with_those_of_the_same_time():
    envelope, path = resting(LIMITS), SoundPath()
    path.goal = 0.05
    for _ in range(8):
        points = on_arc(path.advance(90))
        assert envelope.follow(points, 90, ANYWHERE) == ""
    assert envelope.lags(points) == envelope.lags(points[:, -1]) == envelope.lags(points[:, -7:]) == ""
    assert "following error of shift" in envelope.lags(points[:, ::-1])


@pytest.mark.parametrize("blocks", range(1, 26, 3))
def test_a_stop_in_mid_move_is_rejoined_without_a_jump(blocks):
    envelope, path = resting(LIMITS), SoundPath()
    path.goal = math.radians(4.0)
    seen = []
    for _ in range(blocks):
        assert envelope.follow(on_arc(path.advance(90)), 90, ANYWHERE) == ""
        seen.append(envelope.issued(90))
    while not envelope.settled or envelope.moving or len(seen) == blocks:
        path.rest(envelope.position[0])
        envelope.hold(on_arc(path.advance(90)), 90)
        seen.append(envelope.issued(90))
    left = np.abs(envelope.position - on_arc(envelope.position[0])).max()
    assert left < 1e-6
    path.goal = 0.0
    for _ in range(130):
        assert envelope.follow(on_arc(path.advance(90)), 90, ANYWHERE) == ""
        seen.append(envelope.issued(90))
    assert np.abs(envelope.position).max() < 1e-15
    assert worst(np.concatenate(seen, axis=1), LIMITS) < 1.0


def test_a_path_that_rests_elsewhere_is_not_joined():
    for axis, near in enumerate(LIMITS.each("path")):
        for share, passes in ((0.99, True), (1.01, False)):
            envelope = Envelope(LIMITS, (0.0, 0.0, 0.0))
            points = np.zeros((3, 90))
            points[axis] = share * near
            envelope.hold(points, 90)
            way = ANYWHERE if axis else ANYWHERE._replace(radius=1e-9)
            why = envelope.follow(points, 90, way)
            assert ("does not begin" in why or "arc" in why) is not passes


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_what_is_left_of_a_stop_counts_with_the_path(sign):
    """The path keeps the limit, but what leaves is the path and what the last stop left to be taken out."""
    lim = limits(**WIDE | {"x1": 1e-3})
    for size, passes in ((0.9989e-3, True), (0.9995e-3, False)):
        envelope = Envelope(lim, (0.0, sign * 0.9990e-3, 0.0))
        envelope.hold(step(1, 0.0) + np.array([[0.0], [sign * 0.9980e-3], [0.0]]), 90)
        points = np.zeros((3, 90))
        points[1] = sign * np.where(np.arange(90) < 1, 0.9980e-3, size - 0.001e-3 * (size < 0.9990e-3))
        why = envelope.follow(points, 90, ANYWHERE)
        assert why.startswith("" if passes else "position of x1")
        assert bool(why) is not passes


def test_what_is_handed_out_cannot_be_used_to_change_the_history():
    envelope = resting(LIMITS)
    for handed in (envelope.position, envelope.rest, envelope.issued(5)):
        handed += 1.0
    assert (envelope.position == 0.0).all()
    points = np.zeros((3, 90))
    assert envelope.follow(points, 90, ANYWHERE) == ""
    points += 1.0
    assert (envelope.issued(90) == 0.0).all()


def test_a_block_longer_than_the_history_stays_whole():
    envelope = resting(LIMITS)
    assert envelope.follow(np.zeros((3, 90)), 90, ANYWHERE) == ""
    for samples in (90, 1000, 7, 2000):
        assert envelope.follow(np.zeros((3, samples)), samples, ANYWHERE) == ""
        assert envelope.issued(samples).shape == (3, samples)
        assert envelope.settled


def test_the_arc_is_that_of_the_tool():
    shift = np.linspace(-0.1, 0.1, 21)
    np.testing.assert_allclose(arc(shift, DIAMETER / 2, PSI), on_arc(shift), atol=1e-18)


JERKS = st.lists(
    st.tuples(st.integers(1, 40), st.floats(-1, 1), st.floats(-1, 1), st.floats(-1, 1)), min_size=10, max_size=40
)


@settings(max_examples=150)
@given(jerks=JERKS, share=st.sampled_from([0.3, 0.99, 1.2]), samples=st.integers(1, 60))
def test_whatever_is_asked_no_set_point_is_beyond_a_limit(jerks, share, samples):
    """Paths by random jerks of the order of the limits: they are stopped somewhere, always within."""
    wide = {"path_shift": 1.0, "path_slide": 1.0}
    lim = limits(**wide)
    runs = [np.repeat([run[1:]], run[0], axis=0) for run in jerks] or [np.zeros((1, 3))]
    jerk = np.concatenate(runs).T * np.array([lim.each("jerk")]).T * share / RATE**3
    path = np.cumsum(np.cumsum(np.cumsum(jerk, axis=1), axis=1), axis=1)
    envelope, seen, follows = resting(lim), [np.zeros((3, 4))], True
    for start in range(0, path.shape[1] - samples + 1, samples):
        block = path[:, start : start + samples]
        follows = follows and not envelope.follow(block, samples, ANYWHERE)
        if not follows:
            envelope.hold(block, samples)
        seen.append(envelope.issued(samples))
    for _ in range(3):
        envelope.hold(path, 900)
        seen.append(envelope.issued(900))
    assert not envelope.moving
    assert worst(np.concatenate(seen, axis=1), lim) <= 1.0


@pytest.mark.parametrize("angle", [math.radians(30.0), PSI, math.radians(70.0)])
def test_any_angle_between_the_slides(angle):
    """The tool moves by the sum of the slides: X1 along X1, Y1 at the angle to it."""
    shift = np.linspace(-0.1, 0.1, 21)
    _, x1, y1 = arc(shift, DIAMETER / 2, angle)
    tool = x1 + y1 * np.exp(1j * angle)
    np.testing.assert_allclose(tool, DIAMETER / 2 * (1 - np.exp(-1j * shift)), atol=1e-17)
    envelope = Envelope(limits(axis_angle=angle, dx=1e-3, dy=1e-3, x1=0.1, y1=0.1), (0.0, 0.0, 0.0))
    for dx, dy in ((0.999e-3, 0.999e-3), (1.001e-3, 0.0), (0.0, -1.001e-3), (-1.001e-3, 0.0)):
        point = np.array([[0.0], [dx - dy / math.tan(angle)], [dy / math.sin(angle)]])
        assert bool(envelope.beyond(point)) is (max(abs(dx), abs(dy)) > 1e-3)
