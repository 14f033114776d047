"""What only a close look tells apart: exact edges, exact words, exact sums, and the search for the shortest stop."""

import itertools
import math

import numpy as np
import pytest

from services.guard_commands import Doorkeeper
from services.guard_conditions import Conditions, Spindle
from services.guard_limits import MARGIN
from services.guard_motion import LONGEST_STOP_S, RESUME_S, Envelope, Way
from services.messages import OperatorRequest
from tests.services.guard_kit import BLOCK, LIMITS, RATE, SHIFT, Rig, SoundPath, limits, on_arc, rig_in
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


def test_words():
    rig = Rig()
    with pytest.raises(RuntimeError) as caught:
        rig.guard.check(0, 0, 0)
    assert str(caught.value) == "check must follow begin_block, once"
    envelope = resting(LIMITS)
    assert envelope.follow(None, 90, ANYWHERE) == "path is not three series of numbers of the block's length"
    envelope.hold(None, 90)
    assert envelope.follow(np.zeros((3, 90)), 90, ANYWHERE) == "path does not begin where the last stop ended"
    assert envelope.lags(None) == "measured position is not three finite values"
    ramp = np.zeros((3, 90))
    ramp[2] = np.arange(90) * 1e-6
    tight = resting(limits(**WIDE | {"slide_travel": 91e-6, "slide_jerk": 2e6}))
    assert tight.follow(ramp, 90, ANYWHERE) == "no room to stop after this block"
    rig = rig_in("ACTIVE")
    rig.now += 1
    rig.block()
    assert rig.guard.reason == "ACTIVE -> FAULT: samples are not contiguous"


RULES = {
    "axis_angle": (math.pi / 2, "below pi/2"),
    "shift": (math.pi / 4, "below pi/4"),
    "return_speed": (1.5, "at most 1.0"),
    "interval": (1e-6, "at least one sample"),
    "moves_per_minute": (2.5, "a whole number"),
    "spindle_hz_max": (4.0, "above 5.0"),
    "loss_return": (0.2, "above loss_hold (0.3)"),
    "loss_fault": (0.9, "above loss_return (1.0)"),
    "on_loss": ("guess", "'hold' or 'return'"),
    "freeze_out_of_cut": ("maybe", "true or false"),
    "dwell": (60.0, "below 60 s"),
}


@pytest.mark.parametrize("name", RULES)
def test_a_limit_that_makes_no_sense_is_told_with_its_rule(name):
    value, rule = RULES[name]
    with pytest.raises(ValueError, match="must be") as caught:
        limits(**{name: value})
    assert str(caught.value) == f"{name} must be {rule}, got {value}"


def test_every_limit_has_its_unit():
    units = {
        "sample_rate_hz": "Hz", "axis_angle": "rad", "shift": "rad", "dx": "m", "dy": "m", "x1": "m", "y1": "m",
        "shift_speed": "rad/s", "slide_speed": "m/s", "shift_acceleration": "rad/s^2", "slide_acceleration": "m/s^2",
        "shift_jerk": "rad/s^3", "slide_jerk": "m/s^3", "interval": "s", "shift_step": "rad", "slide_step": "m",
        "shift_travel": "rad", "slide_travel": "m", "shift_following": "rad", "slide_following": "m",
        "path_shift": "rad", "path_slide": "m", "target": "rad", "target_step": "rad", "moves_per_minute": "1/min",
        "dwell": "s", "command_age": "s", "command_lead": "s", "return_speed": "rad/s", "spindle_hz_min": "Hz",
        "spindle_hz_max": "Hz", "spindle_change": "Hz/Hz", "spindle_settle": "s", "loss_hold": "s", "loss_return": "s",
        "loss_fault": "s", "on_loss": "", "freeze_out_of_cut": "",
    }  # fmt: skip
    wanted = []
    for name, unit in units.items():
        value = getattr(LIMITS, name)
        degrees = f" ({math.degrees(value):.6g} {unit.replace('rad', 'deg')})" if unit.startswith("rad") else ""
        wanted.append(f"{name} = {value} {unit}".rstrip() + degrees)
    assert list(LIMITS.describe()) == wanted


def test_the_constants_are_what_the_text_says():
    from services import guard, guard_commands, guard_conditions, guard_motion

    assert (guard.RETURN_SHARE, guard.MOST_NOTICES, guard.SAME) == (0.99, 1000, 1e-12)
    assert (guard_commands.MOST_NONCES, guard_commands.LONGEST_NONCE) == (10_000, 64)
    assert guard_commands.MOST_SAMPLES == 9_007_199_254_740_992
    assert guard_commands.USED == "nonce used before"
    assert guard_conditions.LARGEST == 10.0
    assert (MARGIN, guard_motion.RESUME_S, guard_motion.LONGEST_STOP_S) == (1e-6, 1.0, 2.0)
    assert guard_motion.AXES == ("shift", "x1", "y1", "dx", "dy")
    assert guard_motion.ORDERS == ("speed", "acceleration", "jerk")


def test_a_guard_begins_with_nothing_said():
    guard = Rig().guard
    assert guard.reason == ""
    assert (guard.accepted, guard.late, guard.commands_rejected) == (0, 0, 0)
    assert guard.notices() == []
    assert (guard.target, guard.requested, guard.shift, guard.session) == (0.0, 0.0, 0.0, "")
    assert guard.feed_hold_requested is False


def test_a_notice_tells_its_sample():
    rig = rig_in("ACTIVE")
    rig.say(50.0)
    assert rig.guard.notices()[-1].sample == rig.now
    rig.guard.command(rig.make(1.0, source="x"), rig.now + 7)
    assert rig.guard.notices()[-1].sample == rig.now + 7
    first = rig.now
    rig.conditions = {"feed_hold": True}
    rig.block()
    assert [notice.sample for notice in rig.notices if notice.kind == "frozen"] == [first]


def test_a_block_of_one_sample():
    rig = Rig(samples=1)
    rig.ask("dry_run")
    rig.block()
    assert rig.guard.state == "ARMED"


def test_in_the_cut_it_moves_also_where_it_freezes_out_of_it():
    rig = Rig(freeze_out_of_cut=True).active().run(60, 2.8)
    assert rig.guard.shift == pytest.approx(SHIFT, abs=1e-12)
    assert not rig.guard.rejected


def test_a_fault_is_told_once_and_so_is_arming():
    rig = rig_in("ACTIVE")
    rig.conditions = {"homed": False}
    rig.notices.clear()
    rig.run(5)
    assert [notice.text for notice in rig.notices if notice.kind == "guard_state"] == ["ACTIVE -> FAULT: not homed"]
    rig = rig_in("ARMED")
    rig.notices.clear()
    rig.active()
    assert [notice.text for notice in rig.notices] == ["ARMED -> ACTIVE: operator: arm"]
    rig = rig_in("OFF")
    rig.notices.clear()
    rig.conditions = {"homed": False}
    rig.run(3)
    assert rig.notices == []


def test_travel_is_that_of_the_session_alone():
    rig = Rig(shift_travel=math.radians(9.0)).active()
    assert rig.say(4.0).accepted
    rig.run(60, 4.0)
    assert rig.say(-1.0).reason == "travel"
    rig.ask("disarm")
    rig.active()
    assert rig.say(-1.0).accepted
    rig.run(60, -1.0)
    assert rig.guard.state == "ACTIVE"


def test_of_two_things_that_are_wrong_with_a_request_the_origin_is_told():
    door = Doorkeeper(LIMITS, "run", "controller", "operator")
    short = "nonce must have 1 to 64 characters"
    for changes, why in (({"run": "x"}, "run"), ({"source": "x"}, "source"), ({}, short)):
        fields = {"run": "run", "source": "operator", "sequence": 1, "nonce": "", "request": "arm"} | changes
        assert door.unheard(OperatorRequest(**fields)) == why
    for nonce in ("a", "a" * 64):
        fields = {"run": "run", "source": "operator", "sequence": 1, "nonce": nonce, "request": "arm"}
        assert door.unheard(OperatorRequest(**fields)) == ""


def test_a_spindle_that_keeps_its_speed_and_one_that_does_not():
    spindle = Spindle(limits(spindle_change=0.25, spindle_settle=270 / RATE))
    told = "spindle speed changes"
    said = [spindle.unsettled(speed, 90) for speed in (16.0, 20.0, 12.0, 20.001, 20.0, 20.0, 20.0, 20.0, 16.0, 15.001)]
    assert said == ["", "", "", told, told, told, "", "", "", ""]
    assert spindle.unsettled(math.nan, 90) == told
    assert [spindle.unsettled(20.0, 90) for _ in range(4)] == [told, told, told, ""]


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


def test_stop_says_nothing_where_nothing_runs():
    rig = rig_in("OFF")
    for request in ("stop", "disarm"):
        rig.notices.clear()
        assert rig.ask(request) == ""
        rig.block()
        assert rig.notices == []
    rig = rig_in("FAULT")
    rig.notices.clear()
    rig.ask("stop")
    rig.block()
    assert rig.notices == []


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_at_rest_the_way_is_where_it_rests(sign):
    """It came from zero, but a path that goes back there unasked is noticed at once."""
    rig = Rig().active().run(80, sign * 2.8)
    rig.mangle = lambda points: on_arc(points[0] - sign * 1e-3 * np.linspace(0, 1, points.shape[1]) ** 3)
    rig.block()
    assert rig.guard.state == "FAULT"
    assert "way to its target" in rig.guard.reason


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


def test_a_session_begins_with_no_travel():
    rig = Rig().active().run(60, 2.8)
    assert (rig.guard._envelope.travel > 0.0).all()
    rig.ask("disarm")
    assert (rig.guard._envelope.travel == 0.0).all()


def test_of_two_commands_to_come_each_applies_at_its_own_time():
    rig = rig_in("ACTIVE")
    now = rig.now
    for shift_deg, due in ((2.0, 2 * BLOCK), (1.0, 6 * BLOCK)):
        assert rig.say(shift_deg, apply_at_sample=now + due).accepted
    targets = []
    for _ in range(8):
        rig.block()
        targets.append(round(math.degrees(rig.guard.target), 9))
    assert targets == [2.8, 2.8, 2.0, 2.0, 2.0, 2.0, 1.0, 1.0]


def test_a_machine_that_was_moved_is_told_only_while_off_and_at_rest():
    rig = rig_in("ACTIVE")
    with pytest.raises(RuntimeError, match="stand must be said while OFF and at rest, not in ACTIVE"):
        rig.guard.stand((0.0, 0.0, 0.0))
    rig.run(14, -2.0)
    rig.ask("stop")
    assert rig.guard.moving
    with pytest.raises(RuntimeError, match="not in OFF"):
        rig.guard.stand((0.0, 0.0, 0.0))
    rig.run(20)
    place = on_arc(0.03)
    rig.guard.stand(place)
    np.testing.assert_array_equal(rig.guard.position, place)
    assert rig.guard.target == rig.guard.requested == 0.03
    for state in ("ARMED", "FAULT"):
        with pytest.raises(RuntimeError, match=f"not in {state}"):
            rig_in(state).guard.stand((0.0, 0.0, 0.0))
    with pytest.raises(ValueError, match="within the limits"):
        rig.guard.stand((1.0, 0.0, 0.0))


def test_a_control_that_failed_is_a_fault_with_its_reason():
    rig = rig_in("ACTIVE")
    rig.conditions = {"failed": "the control does not answer"}
    rig.block()
    assert rig.guard.reason == "ACTIVE -> FAULT: the control does not answer"


def test_before_the_first_block_it_is_sample_zero():
    guard = Rig().guard
    guard.request(OperatorRequest(run="run", source="operator", sequence=1, nonce="a", request="jump"))
    assert [notice.sample for notice in guard.notices()] == [0]


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


def test_words_of_freezing_and_of_the_operator():
    rig = Rig(freeze_out_of_cut=True).active()
    rig.conditions = {"in_cut": False}
    rig.run(2, 0.0)
    assert [notice.text for notice in rig.notices if notice.kind == "frozen"] == ["out of cut"]
    rig = rig_in("FAULT")
    rig.notices.clear()
    rig.ask("reset")
    rig.block()
    assert [notice.text for notice in rig.notices] == ["FAULT -> OFF: operator: reset"]
    assert Doorkeeper(LIMITS, "run", "controller", "operator").session == ""


def test_a_following_error_of_exactly_the_limit_passes():
    envelope = Envelope(limits(shift_following=2.0**-9), (0.0, 0.0, 0.0))
    assert envelope.lags(np.array([2.0**-9, 0.0, 0.0])) == ""
    assert "shift" in envelope.lags(np.array([2.0**-9 * (1 + 2.0**-40), 0.0, 0.0]))


def test_the_dwell_counts_from_the_last_move():
    door = Doorkeeper(limits(moves_per_minute=3, dwell=1.0), "run", "controller", "operator")
    door.moved(0)
    door.moved(20_000)
    assert (door.hurried(28_999), door.hurried(29_000)) == ("dwell", "")


def test_a_diameter_that_no_lathe_turns_has_no_radius():
    plain = {"in_cut": True, "homed": True, "feed_hold": False, "spindle_hz": 20.0, "measured": np.zeros(3)}
    assert math.isnan(Conditions(diameter=10.0, **plain).radius)
    assert Conditions(diameter=9.0, **plain).radius == 4.5
