"""States of the guard and the loss ladder."""

import math

import numpy as np
import pytest

from services.guard import Plan
from tests.services.guard_kit import BLOCK, RATE, SHIFT, Rig, on_arc, rig_in

STATES = ("OFF", "ARMED", "ACTIVE", "HOLDING", "RETURNING", "FAULT")
REQUESTS = {
    "arm": ("ACTIVE", "ACTIVE", "", "", "", ""),
    "dry_run": ("ARMED", "", "ARMED", "ARMED", "ARMED", ""),
    "disarm": ("OFF",) * 5 + ("FAULT",),
    "stop": ("OFF",) * 5 + ("FAULT",),
    "reset": ("", "", "", "", "", "OFF"),
}


@pytest.mark.parametrize(("row", "state"), list(enumerate(STATES)))
@pytest.mark.parametrize("request_", REQUESTS)
def test_every_request_in_every_state(request_, row, state):
    rig = rig_in(state)
    session, result = rig.guard.session, REQUESTS[request_][row]
    rig.notices.clear()
    why = rig.ask(request_)
    rig.block()
    assert bool(why) is (not result)
    assert rig.guard.state == (result or state)
    assert why.startswith("not in ") is (not result)
    kept = rig.guard.state == state and session
    assert rig.guard.session == (session if kept else "session-0" if rig.guard.state == "ACTIVE" else "")
    assert (rig.guard.session != "") is (rig.guard.state in ("ACTIVE", "HOLDING", "RETURNING"))
    rig.assert_within()


def test_it_boots_off_and_nothing_moves_until_armed():
    rig = Rig()
    assert (rig.guard.state, rig.guard.session) == ("OFF", "")
    assert not rig.guard.feed_inhibit_requested
    assert not rig.guard.feed_hold_requested
    rig.mangle = lambda points: points + 1e-4
    rig.run(20, 2.0)
    assert (rig.points() == 0.0).all()
    assert not any(rig.followed)


def test_arming_passes_through_armed_and_each_session_is_new():
    rig = Rig().active()
    assert [notice.text for notice in rig.notices] == ["OFF -> ARMED: operator: arm", "ARMED -> ACTIVE: operator: arm"]
    assert rig.guard.session == "session-0"
    rig.ask("stop")
    assert rig.guard.session == ""
    rig.active()
    assert rig.guard.session == "session-1"


@pytest.mark.parametrize(
    ("conditions", "arms", "dry"),
    [
        ({}, True, True),
        ({"in_cut": False}, True, True),
        ({"homed": False}, False, False),
        ({"feed_hold": True}, False, True),
        ({"blocked": "tool change"}, False, True),
        ({"spindle_hz": 4.999}, False, True),
        ({"spindle_hz": 5.0}, True, True),
        ({"spindle_hz": 60.0}, True, True),
        ({"spindle_hz": 60.001}, False, True),
        ({"spindle_hz": math.nan}, False, True),
        ({"diameter": 0.0}, False, False),
        ({"diameter": math.nan}, False, False),
        ({"diameter": 1e308}, False, False),
        ({"diameter": 10.0}, False, False),
        ({"measured": np.full(3, 0.1)}, False, False),
        ({"measured": np.full(3, np.nan)}, False, False),
    ],
)
def test_the_machine_must_be_ready(conditions, arms, dry):
    for request, ready, state in (("arm", arms, "ACTIVE"), ("dry_run", dry, "ARMED")):
        rig = Rig()
        rig.conditions = conditions
        rig.run(1)
        assert rig.ask(request) == ""
        rig.block()
        assert rig.guard.state == (state if ready else "OFF")
        assert ("request_rejected" in [notice.kind for notice in rig.notices]) is not ready
        if not ready:
            rig.conditions = {}
            rig.block()
            assert rig.guard.state == "OFF"


def test_arming_waits_for_rest_and_a_stop_takes_an_arm_back():
    rig = Rig().active().run(10, 2.8)
    assert rig.guard.moving
    rig.ask("stop")
    rig.ask("arm")
    rig.block()
    assert rig.guard.state == "OFF"
    assert rig.notices[-1].text == "'arm': still moving"
    rig.run(20)
    rig.ask("arm")
    rig.ask("stop")
    rig.block()
    assert rig.guard.state == "OFF"


def test_a_wish_is_not_granted_in_a_fault_that_came_between():
    rig = rig_in("ARMED")
    rig.ask("arm")
    rig.conditions = {"homed": False}
    rig.block()
    assert rig.guard.state == "FAULT"
    assert rig.notices[-1].text == "'arm': not homed"
    rig = rig_in("ACTIVE")
    rig.guard.begin_block(rig.now, BLOCK, rig.state_of_machine())
    rig.ask("dry_run")
    rig.guard.check(*np.full((3, BLOCK), np.nan))
    rig.now += BLOCK
    rig.block()
    assert rig.guard.state == "FAULT"
    assert rig.notices[-1].text == "'dry_run': not in FAULT"


def test_dry_run_judges_and_counts_but_nothing_moves():
    rig = rig_in("ARMED", moves_per_minute=1)
    assert rig.say(2.8).accepted
    assert rig.say(1.0).reason == "moves"
    assert rig.say(9.0).reason == "limit"
    rig.run(300, 2.8)
    assert rig.guard.state == "ARMED"
    assert (rig.guard.target, rig.guard.shift) == (SHIFT, 0.0)
    assert (rig.points() == 0.0).all()
    rig.run(1000)
    assert rig.guard.state == "ARMED"
    rig.ask("arm")
    rig.block()
    assert (rig.guard.state, rig.guard.target) == ("ACTIVE", 0.0)


def test_a_command_moves_the_turret_and_the_path_is_followed_to_the_bit():
    rig = rig_in("ACTIVE")
    assert rig.guard.position == pytest.approx(on_arc(SHIFT), abs=1e-15)
    assert all(rig.followed[1:])
    assert rig.plans[0] == Plan(None, None)
    assert rig.plans[1] == Plan(0.0, None)
    rig.assert_within()


def test_stop_decelerates_at_once_and_holds():
    rig = Rig().active().run(14, 2.8)
    speed = np.abs(np.diff(rig.points()[0])).max()
    begin = rig.guard.shift
    assert rig.ask("stop") == ""
    rig.run(20, 2.8)
    assert not rig.guard.moving
    after = np.concatenate(rig.issued[-20:], axis=1)[0]
    assert np.abs(np.diff(after)).max() <= speed
    assert 0 < after[-1] - begin < 0.02
    assert np.ptp(after[-1000:]) == 0.0
    rig.assert_within()
    rig.active().run(120, 0.0)
    assert rig.guard.position == pytest.approx(np.zeros(3), abs=1e-12)
    rig.assert_within()


@pytest.mark.parametrize("request_", ["stop", "disarm", "dry_run"])
def test_a_request_between_plan_and_check_counts_for_this_block(request_):
    rig = Rig().active().run(14, 2.8)
    plan = rig.guard.begin_block(rig.now, BLOCK, rig.state_of_machine())
    assert plan.target == SHIFT
    rig.ask(request_)
    checked = rig.guard.check(*on_arc(rig.path.advance(BLOCK)))
    assert checked.followed is (request_ == "dry_run")


def test_loss_ladder_that_holds():
    rig = rig_in("ACTIVE")
    seen = {}
    rig.say(2.8)
    start = rig.now
    while rig.guard.state != "FAULT":
        rig.block()
        seen.setdefault(rig.guard.state, rig.now - BLOCK - start)
        assert rig.guard.feed_hold_requested is (rig.guard.state == "HOLDING")
    assert seen == {"ACTIVE": 0, "HOLDING": 2700, "FAULT": 18_000}
    assert rig.guard.feed_inhibit_requested
    assert rig.guard.session == ""
    assert rig.guard.shift == pytest.approx(SHIFT)
    rig.assert_within()


def test_loss_ladder_that_returns_at_limited_speed():
    rig = rig_in("ACTIVE", on_loss="return")
    seen = {}
    rig.say(2.8)
    start, blocks = rig.now, len(rig.issued)
    while rig.guard.state != "FAULT":
        rig.block()
        seen.setdefault(rig.guard.state, rig.now - BLOCK - start)
        assert not rig.guard.feed_hold_requested
    assert seen == {"ACTIVE": 0, "HOLDING": 2700, "RETURNING": 9000, "FAULT": 18_000}
    assert rig.guard.shift == pytest.approx(0.0, abs=1e-12)
    moved = np.concatenate(rig.issued[blocks:], axis=1)
    assert np.abs(np.diff(moved[0])).max() * RATE <= 0.25
    assert Plan(0.0, 0.99 * 0.25) in rig.plans
    rig.assert_within()


def test_a_return_faster_than_asked_is_a_fault():
    rig = rig_in("ACTIVE", on_loss="return", return_speed=0.1)
    rig.run(130)
    assert rig.guard.state == "FAULT"
    assert "faster than asked" in rig.guard.reason
    rig.assert_within()


@pytest.mark.parametrize("interlock", [{"feed_hold": True}, {"spindle_hz": 0.0}, {"blocked": "tool change"}])
def test_it_returns_only_if_the_cutting_permits(interlock):
    rig = rig_in("ACTIVE", on_loss="return")
    rig.conditions = interlock
    rig.run(90)
    assert not rig.guard.feed_hold_requested
    rig.run(20)
    assert rig.guard.state == "HOLDING"
    assert rig.guard.feed_hold_requested
    rig.conditions = {}
    rig.run(20)
    assert rig.guard.state == "RETURNING"
    rig.conditions = interlock
    rig.block()
    assert rig.guard.state == "HOLDING"
    assert rig.guard.feed_hold_requested
    rig.conditions = interlock | {"in_cut": False}
    rig.block()
    assert not rig.guard.feed_hold_requested
    rig.run(100)
    assert rig.guard.state == "FAULT"
    assert not rig.guard.feed_hold_requested
    rig.assert_within()


def test_feed_hold_is_asked_for_at_t2_if_it_cannot_return():
    rig = rig_in("ACTIVE", on_loss="return")
    rig.say(2.8)
    start = rig.now
    rig.conditions = {"feed_hold": True}
    while not rig.guard.feed_hold_requested:
        rig.block()
    assert rig.now - BLOCK - start == 9000


def test_no_feed_hold_is_asked_for_in_air():
    rig = rig_in("ACTIVE")
    rig.conditions = {"in_cut": False}
    rig.run(60)
    assert rig.guard.state == "HOLDING"
    assert not rig.guard.feed_hold_requested


def test_holding_in_mid_move_stops_there_and_recovers_by_a_valid_command():
    rig = Rig(loss_hold=0.15).active()
    rig.say(-4.5)
    rig.run(40)
    assert rig.guard.state == "HOLDING"
    stopped = rig.guard.shift
    assert -math.radians(4.5) < stopped < -0.01
    assert rig.guard.target == rig.guard.requested == pytest.approx(stopped, abs=1e-15)
    assert rig.say(math.nan).reason == "not finite"
    assert rig.guard.state == "HOLDING"
    assert rig.say(math.degrees(stopped)).accepted
    assert rig.guard.state == "ACTIVE"
    assert rig.notices[-1].text.startswith("ACTIVE -> HOLDING")
    rig.run(5, math.degrees(stopped))
    assert any(notice.text == "HOLDING -> ACTIVE: valid commands again" for notice in rig.notices)
    rig.run(60, 1.0)
    assert rig.guard.shift == pytest.approx(math.radians(1.0), abs=1e-12)
    rig.assert_within()


def test_a_valid_command_ends_the_return_where_it_says():
    rig = rig_in("RETURNING")
    assert rig.say(0.0).accepted
    assert rig.guard.state == "ACTIVE"
    rig.run(60, 0.0)
    assert rig.guard.shift == pytest.approx(0.0, abs=1e-12)
    rig.assert_within()


def test_a_refused_command_is_a_sign_of_life_but_a_rejected_one_is_not():
    rig = rig_in("ACTIVE", moves_per_minute=1)
    rig.run(300, 1.0)
    assert rig.guard.state == "ACTIVE"
    assert rig.guard.rejected == {"moves": 300}
    rig.run(40, 50.0)
    assert rig.guard.state == "HOLDING"


def test_fault_is_left_only_by_reset_at_rest_and_then_off():
    rig = Rig().active().run(14, 2.8)
    rig.mangle = lambda points: np.full_like(points, 1e9)
    rig.block()
    assert rig.guard.state == "FAULT"
    rig.mangle = lambda points: points
    assert rig.ask("reset") == "still stopping"
    for request in ("arm", "dry_run"):
        assert rig.ask(request) == "not in FAULT"
    rig.run(20, 2.8)
    assert rig.guard.state == "FAULT"
    assert rig.ask("reset") == ""
    assert rig.guard.state == "OFF"
    rig.active().run(60, 0.0)
    assert rig.guard.state == "ACTIVE"
    assert rig.guard.shift == pytest.approx(0.0, abs=1e-12)
    rig.assert_within()
