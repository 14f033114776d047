"""Which commands and requests count: each rule at its edge, in every state, each rejection with its reason."""

import math

import numpy as np
import pytest

from services.guard_commands import LONGEST_NONCE, MOST_NONCES, MOST_SAMPLES, Doorkeeper
from services.messages import OperatorRequest
from tests.services.guard_kit import BLOCK, LIMITS, RATE, Rig, limits

AGE, LEAD = round(LIMITS.command_age * RATE), round(LIMITS.command_lead * RATE)
TARGET = math.degrees(LIMITS.target)


def ready(**changes):
    """A machine that has followed the path at rest for 50 blocks; the last command had sequence 50."""
    rig = Rig(**changes).active().run(50, 0.0)
    assert rig.guard.accepted == 50
    assert not rig.guard.rejected
    return rig


def times(rig, issued, due, expires):
    return {
        "issued_sample": rig.now + issued,
        "apply_at_sample": rig.now + due,
        "expires_at_sample": rig.now + expires,
    }


FORMS = [
    ({"version": 2}, "version"),
    ({"version": 0}, "version"),
    ({"run": "yesterday"}, "run"),
    ({"source": "controller-2"}, "source"),
    ({"source": "operator"}, "source"),
    ({"session": "session-1"}, "session"),
    ({"session": ""}, "session"),
    ({"sequence": 50}, "duplicate"),
    ({"sequence": 49}, "out of order"),
    ({"sequence": 51}, ""),
    ({"sequence": 10**6}, ""),
    ({"sequence": -1}, "malformed"),
    ({"sequence": MOST_SAMPLES}, "malformed"),
    ({"sequence": 10**400}, "malformed"),
    ({"sequence": MOST_SAMPLES - 1}, ""),
    ({"shift_deg": math.nan}, "not finite"),
    ({"shift_deg": math.inf}, "not finite"),
    ({"shift_deg": -math.inf}, "not finite"),
    ({"shift_deg": 10**400}, "limit"),
    ({"shift_deg": 1e9}, "limit"),
    ({"shift_deg": -1e308}, "limit"),
    ({"shift_deg": 360.0}, "limit"),
    ({"shift_deg": 50.0}, "limit"),
    ({"shift_deg": TARGET}, ""),
    ({"shift_deg": -TARGET}, ""),
    ({"shift_deg": TARGET * (1 + 1e-12)}, "limit"),
    ({"shift_deg": -TARGET * (1 + 1e-12)}, "limit"),
    ({"shift_deg": np.float64(1.0)}, ""),
    ({"shift_deg": 1}, ""),
    ({"action": "move"}, ""),
]


@pytest.mark.parametrize(("changes", "reason"), FORMS)
def test_form_origin_order_and_size(changes, reason):
    rig = ready()
    verdict = rig.say(**{"shift_deg": 0.0} | changes)
    assert verdict == (not reason, reason, False)
    rig.block()
    kinds = [notice.kind for notice in rig.notices[2:]]
    assert kinds == (["command_rejected"] if reason else [])
    assert rig.guard.rejected == ({reason: 1} if reason else {})
    assert rig.guard.commands_rejected == bool(reason)
    assert rig.guard.accepted == 50 + (not reason)
    if reason:
        assert rig.guard.reason.endswith(f"of 'controller': {reason}") is (changes.get("source") is None)
        assert rig.guard.reason.endswith(f": {reason}")
        assert rig.guard.target == 0.0


TIMES = [
    ((0, 0, 0), "", False),
    ((-AGE, 0, 900), "", False),
    ((-AGE - 1, 0, 900), "old", False),
    ((1, 1, 900), "early", False),
    ((0, LEAD, 900), "", False),
    ((0, LEAD + 1, LEAD + 1), "early", False),
    ((-1, -1, 0), "", True),
    ((-2, -1, -1), "old", False),
    ((-270, -1, 0), "", True),
    ((-270, 0, 1), "", False),
    ((0, -1, 900), "malformed", False),
    ((-9, 5, 4), "malformed", False),
]


@pytest.mark.parametrize("shift_deg", [0.0, 1.0])
@pytest.mark.parametrize(("offsets", "reason", "late"), TIMES)
def test_times_at_their_edges(offsets, reason, late, shift_deg):
    rig = ready()
    rig.run(5)
    assert rig.say(shift_deg, **times(rig, *offsets)) == (not reason, reason, late)
    assert rig.guard.late == late
    rig.block()
    assert [notice.kind for notice in rig.notices[2:]] == ["command_rejected"] * bool(reason) + ["command_late"] * late


@pytest.mark.parametrize("name", ["issued_sample", "apply_at_sample", "expires_at_sample"])
@pytest.mark.parametrize("value", [-1, MOST_SAMPLES, math.nan, math.inf])
def test_a_sample_index_that_is_none_is_malformed(name, value):
    assert ready().say(0.0, **{name: value}).reason == "malformed"


def test_apply_at_never_runs_backwards():
    rig = ready()
    assert rig.say(1.0, **times(rig, 0, 270, 900)).accepted
    assert rig.say(2.0, **times(rig, 0, 269, 900)).reason == "out of order"
    assert rig.say(2.0, **times(rig, 0, 270, 900)).accepted


def test_sequence_and_samples_may_be_zero():
    rig = Rig()
    rig.ask("arm")
    rig.block()
    zero = {"issued_sample": 0, "apply_at_sample": 0, "sequence": 0}
    assert rig.say(0.0, **zero) == (True, "", True)
    assert rig.say(0.0, **zero).reason == "duplicate"
    rig.ask("dry_run")
    rig.block()
    rig.ask("arm")
    rig.block()
    assert rig.say(0.0, **zero | {"expires_at_sample": rig.now}).accepted


def test_a_rejected_command_does_not_use_up_its_sequence():
    rig = ready()
    assert rig.say(1.0, session="old", sequence=60).reason == "session"
    assert rig.say(1.0, sequence=60).accepted
    assert rig.say(1.0, sequence=60).reason == "duplicate"


def test_a_command_applies_at_its_time_and_a_late_one_at_once():
    rig = ready()
    rig.say(1.0, **times(rig, 0, 3 * BLOCK, 900))
    assert rig.guard.requested == math.radians(1.0)
    for passed in range(5):
        assert rig.block() is not None
        assert rig.plans[-1].target == (0.0 if passed < 3 else math.radians(1.0))
        assert rig.guard.target == rig.plans[-1].target
    rig.say(2.0, **times(rig, -90, -1, 900))
    rig.block()
    assert rig.plans[-1].target == math.radians(2.0)
    assert rig.guard.late == 1


def test_of_two_commands_due_at_once_the_newer_counts():
    rig = ready()
    rig.say(1.0, **times(rig, 0, 10, 900))
    rig.say(-1.0, **times(rig, 0, 90, 900))
    rig.run(2)
    assert rig.plans[-1].target == math.radians(-1.0)


def test_a_repeated_hold_is_no_move_and_conversions_do_not_make_it_one():
    rig = ready(moves_per_minute=1)
    assert rig.say(2.8).accepted
    for _ in range(50):
        assert rig.say(math.degrees(rig.guard.requested)).accepted
        assert rig.say(2.8).accepted
    assert rig.say(2.8 + 1e-9).reason == "moves"


def test_moves_per_minute_at_the_edge_of_the_minute():
    rig = ready(moves_per_minute=2)
    first = rig.now
    assert rig.say(1.0).accepted
    rig.run(1)
    assert rig.say(2.0).accepted
    while rig.now < first + 60 * RATE - BLOCK:
        rig.say(2.0)
        rig.run(1)
    assert rig.say(1.0).reason == "moves"
    assert rig.guard.command(rig.make(1.0), first + 540_000 - 1).reason == "moves"
    rig.now = first + 540_000
    assert rig.guard.command(rig.make(1.0), rig.now).accepted
    assert rig.say(2.0).reason == "moves"


def test_a_move_counts_for_a_minute_and_the_last_one_for_the_dwell():
    door = Doorkeeper(limits(moves_per_minute=2, dwell=1.0), "run", "controller", "operator")
    assert door.hurried(0) == ""
    door.moved(0)
    assert (door.hurried(8999), door.hurried(9000)) == ("dwell", "")
    door.moved(20_000)
    assert (door.hurried(29_000), door.hurried(539_999)) == ("moves", "moves")
    assert door.hurried(540_000) == ""
    door.moved(540_000)
    assert (door.hurried(559_999), door.hurried(560_000)) == ("moves", "")


def test_moves_of_an_earlier_session_count_too():
    rig = ready(moves_per_minute=1)
    assert rig.say(1.0).accepted
    rig.run(60, 1.0)
    assert rig.ask("disarm") == ""
    rig.active()
    assert rig.say(2.0).reason == "moves"


def test_dwell_at_its_edge():
    rig = ready(dwell=1.0)
    assert rig.say(1.0).accepted
    start = rig.now
    rig.run(99, 1.0)
    assert rig.say(2.0).reason == "dwell"
    rig.run(1, 1.0)
    assert rig.now == start + 9000
    early = rig.make(2.0, issued_sample=rig.now - 90)
    assert rig.guard.command(early, rig.now - 1).reason == "dwell"
    assert rig.say(2.0).accepted


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_change_of_the_target_is_limited(sign):
    rig = ready(target_step=math.radians(3.0))
    assert rig.say(sign * 3.0001).reason == "limit"
    assert rig.say(sign * 3.0).accepted
    assert rig.say(sign * -0.001).reason == "limit"
    assert rig.say(0.0).accepted


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(("name", "limit"), [("dy", 0.0125), ("y1", 0.0125 * math.sqrt(2)), ("x1", 0.0125)])
def test_a_target_beyond_a_limit_of_the_slides_is_rejected_before_it_moves(name, limit, sign):
    rig = ready(**{name: limit * math.sin(math.radians(2.0))})
    assert rig.say(sign * 2.1).reason == "limit"
    assert rig.say(sign * 1.9).accepted


def test_a_target_beyond_the_limit_of_dx_is_rejected():
    rig = ready(dx=0.0125 * (1 - math.cos(math.radians(2.0))))
    assert rig.say(2.01).reason == "limit"
    assert rig.say(1.99).accepted


def test_travel_is_kept_for_the_way_home():
    rig = ready(shift_travel=math.radians(20.0))
    assert rig.say(4.0).accepted
    rig.run(60, 4.0)
    assert rig.say(-2.1).accepted
    rig.run(60, -2.1)
    assert rig.say(4.0).reason == "travel"
    assert rig.say(1.0).accepted
    rig.run(60, 1.0)
    assert rig.say(0.0).accepted
    rig.run(60, 0.0)
    assert rig.guard.state == "ACTIVE"
    assert rig.guard.shift == pytest.approx(0.0, abs=1e-12)


def test_travel_counts_anew_in_each_session():
    rig = ready(shift_travel=math.radians(9.0))
    assert rig.say(4.0).accepted
    rig.run(60, 4.0)
    assert rig.say(-1.0).reason == "travel"
    assert rig.ask("disarm") == ""
    rig.active()
    assert rig.say(1.5).accepted


@pytest.mark.parametrize("state", ["OFF", "FAULT"])
def test_no_command_counts_when_off_or_in_fault(state):
    rig = Rig()
    if state == "FAULT":
        rig.active()
        rig.conditions = {"homed": False}
        rig.block()
    assert rig.guard.state == state
    for shift_deg in (0.0, 1.0, math.nan):
        assert rig.say(shift_deg).reason == "state"
    assert rig.guard.rejected == {"state": 3}
    assert rig.guard.target == 0.0


def ask(rig, **changes):
    fields = {"run": "run", "source": "operator", "sequence": 1, "nonce": "a", "request": "arm"} | changes
    return rig.guard.request(OperatorRequest(**fields))


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        ({}, ""),
        ({"run": "yesterday"}, "run"),
        ({"source": "controller"}, "source"),
        ({"version": 2}, "version"),
        ({"nonce": ""}, "nonce must have 1 to 64 characters"),
        ({"nonce": "x" * LONGEST_NONCE}, ""),
        ({"nonce": "x" * (LONGEST_NONCE + 1)}, "nonce must have 1 to 64 characters"),
        ({"request": "jump"}, "unknown request"),
    ],
)
def test_requests_count_only_from_the_operator_of_this_run(changes, why):
    rig = Rig()
    assert ask(rig, **changes) == why
    rig.block()
    assert rig.guard.state == ("OFF" if why else "ACTIVE")
    assert bool(why) == (rig.notices[0].kind == "request_rejected")


def test_a_nonce_counts_once_and_only_when_the_request_was_genuine():
    rig = Rig()
    assert ask(rig, run="yesterday") == "run"
    assert ask(rig) == ""
    assert ask(rig) == ask(rig, request="stop") == ask(rig, request="disarm") == "nonce used before"
    assert ask(rig, nonce="b", request="stop") == ""
    assert ask(rig, nonce="b", request="stop") == "nonce used before"


@pytest.mark.parametrize("changes", [{"run": "x"}, {"source": "x"}, {"version": 9}, {"nonce": ""}, {"nonce": "y" * 99}])
def test_stop_is_heard_whatever_it_carries(changes):
    rig = Rig().active()
    for _ in range(2):
        assert ask(rig, request="stop", **changes) == ""
        assert rig.guard.state == "OFF"


def test_after_too_many_requests_only_stop_and_disarm_are_heard():
    rig = Rig().active()
    for i in range(MOST_NONCES - 1):
        ask(rig, request="reset", nonce=f"flood{i}")
    for request in ("arm", "dry_run", "reset"):
        assert ask(rig, request=request, nonce="new") == "too many requests in this run"
    assert rig.guard.state == "ACTIVE"
    assert ask(rig, request="disarm", nonce="new") == ""
    assert rig.guard.state == "OFF"
    assert ask(rig, request="stop", nonce="newer") == ""


def test_a_flood_is_counted_but_not_kept():
    rig = ready()
    for _ in range(1500):
        rig.say(0.0, source="x" * 10_000)
    notices = rig.guard.notices()
    assert len(notices) == 1001
    assert notices[-1][1:] == ("flood", "500 more not listed")
    assert max(len(notice.text) for notice in notices) < 100
    assert rig.guard.rejected == {"source": 1500}
    assert rig.guard.notices() == []
