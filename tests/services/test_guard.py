"""States of the guard, the loss ladder, and what it does when the machine or the path is not what it should be."""

import math

import numpy as np
import pytest

import pitch
from services.guard import Guard, Plan
from tests.services.guard_kit import BLOCK, DIAMETER, PSI, RATE, Rig, limits, on_arc

SHIFT = math.radians(2.8)


def rig_in(state, **changes):
    """A machine at a shift of 2.8 degrees, at rest, in a state."""
    changes = {"on_loss": "return"} | changes if state == "RETURNING" else changes
    rig = Rig(**changes)
    if state == "OFF":
        return rig.run(2)
    if state == "ARMED":
        assert rig.ask("dry_run") == ""
        return rig.run(2)
    rig.active().run(80, 2.8)
    assert rig.guard.shift == pytest.approx(SHIFT, abs=1e-12)
    if state == "HOLDING":
        rig.run(40)
    if state == "RETURNING":
        rig.run(115)
    if state == "FAULT":
        rig.conditions = {"homed": False}
        rig.run(1)
        rig.conditions = {}
    assert rig.guard.state == state
    return rig


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
        rig = Rig().run(1)
        rig.conditions = conditions
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


RNG = np.random.default_rng(6)
HOSTILE = {
    "nan": lambda points: points * np.nan,
    "one nan": lambda points: np.where(np.arange(points.shape[1]) == 50, np.nan, points),
    "50 mm": lambda points: points + 50e-3,
    "1e9": lambda points: points + 1e9,
    "x1000": lambda points: points * 1000,
    "sign": lambda points: -points - 1e-5,
    "noise": lambda points: points + RNG.normal(size=points.shape) * 1e-5,
    "walk": lambda points: points + np.cumsum(RNG.normal(size=points.shape), axis=1) * 1e-6,
    "jump": lambda points: points + 1e-6 * (np.arange(points.shape[1]) > 30),
    "step back": lambda points: np.roll(points, 7, axis=1) + 1e-6,
    "short": lambda points: points[:, 1:],
    "long": lambda points: np.repeat(points, 2, axis=1),
    "text": lambda points: ["x", "y", "z"],
    "nothing": lambda points: [None, None, None],
    "empty": lambda points: points[:, :0],
    "slides swapped": lambda points: points[[0, 2, 1]] + 1e-5,
}


@pytest.mark.parametrize("blocks", [0, 3, 14, 23])
@pytest.mark.parametrize("name", HOSTILE)
def test_a_hostile_path_is_a_fault_and_stops_within_all_limits(name, blocks):
    rig = Rig().active().run(blocks, 2.8)
    rig.mangle = HOSTILE[name]
    rig.run(25, 2.8)
    assert rig.guard.state == "FAULT"
    assert not rig.guard.moving
    rig.assert_within()


@pytest.mark.parametrize(
    ("fault", "text"),
    [
        ({"homed": False}, "not homed"),
        ({"diameter": math.inf}, "diameter is inf"),
        ({"diameter": -0.025}, "diameter is -0.025"),
        ({"measured": np.full((3, BLOCK), np.nan)}, "measured position"),
        ({"measured": np.zeros(3)}, "following error of shift"),
    ],
)
@pytest.mark.parametrize("state", ["ACTIVE", "HOLDING", "RETURNING"])
def test_a_machine_out_of_order_is_a_fault(state, fault, text):
    rig = rig_in(state)
    rig.conditions = fault
    rig.run(2)
    assert rig.guard.state == "FAULT"
    assert any(text in notice.text for notice in rig.notices)
    rig.assert_within()


def test_a_stuck_encoder_is_noticed_in_the_move():
    rig = Rig().active()
    rig.measure = lambda issued: np.zeros_like(issued)
    rig.run(20, 0.0)
    assert rig.guard.state == "ACTIVE"
    rig.run(40, 2.8)
    assert rig.guard.state == "FAULT"
    assert np.abs(rig.points()[0]).max() < 0.02


@pytest.mark.parametrize("jump", [-90, 1, 90, 45_000])
def test_samples_must_be_contiguous(jump):
    rig = rig_in("ACTIVE")
    rig.now += jump
    rig.block()
    assert rig.guard.state == "FAULT"
    assert "not contiguous" in rig.guard.reason
    off = Rig().run(2)
    off.now += jump
    off.block()
    assert off.guard.state == "OFF"


def test_begin_and_check_go_in_pairs():
    rig = Rig()
    zeros = np.zeros(BLOCK)
    with pytest.raises(RuntimeError, match="must follow begin_block"):
        rig.guard.check(zeros, zeros, zeros)
    rig.block()
    with pytest.raises(RuntimeError, match="once"):
        rig.guard.check(zeros, zeros, zeros)
    with pytest.raises(ValueError, match="samples must be at least 1, got 0"):
        rig.guard.begin_block(rig.now, 0, rig.state_of_machine())


@pytest.mark.parametrize("freeze", [{"feed_hold": True}, {"spindle_hz": 80.0}, {"blocked": "override"}])
def test_it_freezes_in_mid_move_and_stays_until_commanded(freeze):
    rig = Rig().active().run(14, 2.8)
    rig.conditions = freeze
    rig.run(60, 2.8)
    stopped = rig.guard.shift
    assert rig.guard.state == "ACTIVE"
    assert 0 < stopped < SHIFT
    assert rig.plans[-1] == Plan(None, None)
    assert rig.guard.rejected == {"frozen": 59}
    assert sum(notice.kind == "frozen" for notice in rig.notices) == 1
    rig.conditions = {}
    rig.run(20, math.degrees(stopped))
    assert rig.guard.shift == stopped
    rig.run(60, 2.8)
    assert rig.guard.shift == pytest.approx(SHIFT, abs=1e-12)
    rig.assert_within()


@pytest.mark.parametrize("freezes", [True, False])
def test_out_of_cut_freezes_if_the_job_says_so(freezes):
    rig = Rig(freeze_out_of_cut=freezes).active()
    rig.conditions = {"in_cut": False}
    rig.run(1)
    rig.run(60, 2.8)
    assert (rig.guard.shift == 0.0) is freezes
    assert rig.guard.rejected == ({"frozen": 60} if freezes else {})


def test_a_wandering_path_is_noticed_within_all_limits():
    rig = rig_in("ACTIVE")
    drift = [0.0]

    def wander(points):
        drift[0] += 2e-5
        return on_arc(points[0] + drift[0] - 2e-5 + 2e-5 * np.linspace(0, 1, points.shape[1]))

    rig.mangle = wander
    rig.run(30, 2.8)
    assert rig.guard.state == "FAULT"
    assert abs(rig.guard.shift - SHIFT) < 2e-4


def test_retargeting_in_mid_move_keeps_to_the_way():
    rig = Rig(moves_per_minute=60).active()
    for shift_deg in (2.8, -2.0, 0.5, 0.49, -0.2, 4.9, -4.9 + 2.0):
        rig.run(9, shift_deg)
    rig.run(60, 0.0)
    assert rig.guard.state == "ACTIVE", rig.guard.reason
    assert rig.guard.shift == pytest.approx(0.0, abs=1e-12)
    rig.assert_within()


def test_it_starts_where_the_machine_stands():
    start = on_arc(SHIFT)
    rig = Rig(start=tuple(start)).active()
    assert rig.guard.target == SHIFT
    rig.run(60, 0.0)
    assert rig.guard.shift == pytest.approx(0.0, abs=1e-12)
    rig.assert_within()


@pytest.mark.parametrize("samples", [1, 7, 90, 500])
def test_any_length_of_block(samples):
    rig = Rig(samples=samples).active()
    rig.run(round(5000 / samples), 2.0)
    assert rig.guard.state == "ACTIVE", rig.guard.reason
    assert rig.guard.shift == pytest.approx(math.radians(2.0), abs=1e-12)
    rig.assert_within()


def test_the_path_and_the_geometry_of_the_planner_pass():
    """Two derivations of the geometry meet here: that of `pitch` and that of the guard."""
    rig = Rig()
    bounds = pitch.TrajectoryLimits(max_speed=0.5, max_acceleration=10.0, max_jerk=1000.0)
    path = pitch.ShiftTrajectory(bounds, RATE)
    rig.ask("arm")
    for block in range(300):
        plan = rig.guard.begin_block(rig.now, BLOCK, rig.state_of_machine())
        if plan.target is None:
            path = pitch.ShiftTrajectory(bounds, RATE, rig.guard.shift)
        elif plan.target != path.target:
            path.retarget(plan.target)
        shift = path.advance(BLOCK)
        checked = rig.guard.check(shift, *pitch.slide_set_points(shift, DIAMETER, PSI))
        rig.issued.append(np.array(checked[:3]))
        rig.now += BLOCK
        if block == 115:
            rig.ask("stop")
        if block == 140:
            rig.ask("arm")
        rig.say((2.8, -3.1, 1.0)[block // 100])
    assert rig.guard.state == "ACTIVE", rig.guard.reason
    assert rig.guard.shift == pytest.approx(math.radians(1.0), abs=1e-12)
    rig.assert_within()


@pytest.mark.parametrize("seed", range(3))
def test_a_path_within_four_fifths_of_all_limits_is_never_a_fault(seed):
    """Random targets and stops in mid-move: the stop finds room from wherever a sound path is."""
    rig, share, rng = Rig(moves_per_minute=600, shift_travel=1e3, slide_travel=1e3), 0.8, np.random.default_rng(seed)
    lim, reach = rig.limits, 1.06 * DIAMETER / 2 / math.sin(PSI)
    bounds = pitch.TrajectoryLimits(
        max_speed=share * min(lim.shift_speed, lim.slide_speed / reach, lim.slide_step / lim.interval / reach),
        max_acceleration=share * min(lim.shift_acceleration, lim.slide_acceleration / reach),
        max_jerk=share * min(lim.shift_jerk, lim.slide_jerk / reach),
    )
    path, target = pitch.ShiftTrajectory(bounds, RATE), 0.0
    for _ in range(600):
        plan = rig.guard.begin_block(rig.now, BLOCK, rig.state_of_machine())
        if plan.target is None:
            path = pitch.ShiftTrajectory(bounds, RATE, rig.guard.shift)
        elif plan.target != path.target:
            path.retarget(plan.target)
        shift = path.advance(BLOCK)
        checked = rig.guard.check(shift, *pitch.slide_set_points(shift, DIAMETER, PSI))
        rig.issued.append(np.array(checked[:3]))
        rig.now += BLOCK
        target = float(rng.choice([5.0, -5.0, rng.uniform(-5, 5)])) if rng.random() < 0.08 else target
        if seed and rng.random() < 0.02:
            rig.ask("stop")
        if rig.guard.state == "OFF" and not rig.guard.moving:
            rig.ask("arm")
        rig.say(target)
        assert rig.guard.state != "FAULT", rig.guard.reason
    rig.assert_within()


def test_two_runs_of_the_same_story_are_the_same_to_the_bit():
    def story():
        rig = Rig().active().run(14, 2.8)
        rig.mangle = lambda points: points * 1.01
        return rig.run(30, 2.8)

    one, two = story(), story()
    assert (one.points() == two.points()).all()
    assert one.notices == two.notices


def test_without_a_start_the_machine_stands_at_zero():
    guard = Guard(limits(), run="run", controller="controller", operator="operator", token=str)
    assert (guard.position == 0.0).all()


def test_the_limits_are_there_to_be_printed():
    assert Rig().guard.limits.describe() == limits().describe()
