"""What the guard does when the machine or the path is not what it should be, and with every path that is."""

import math

import numpy as np
import pytest

import pitch
from services.guard import Guard, Plan
from tests.services.guard_kit import BLOCK, DIAMETER, PSI, RATE, SHIFT, Rig, limits, on_arc, rig_in

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


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_change_of_the_spindle_speed_freezes_until_it_has_settled(sign):
    for share, freezes in ((0.03 * (1 - 1e-9), False), (0.03 * (1 + 1e-9), True)):
        rig = Rig().active().run(14, 2.8)
        rig.conditions = {"spindle_hz": 20.0 * (1.0 + sign * share)}
        rig.run(10, 2.8)
        assert rig.plans[-1].target == (None if freezes else SHIFT)
        assert rig.guard.state == "ACTIVE"
        assert rig.guard.rejected == ({"frozen": 9} if freezes else {})
        assert [notice.text for notice in rig.notices if notice.kind == "frozen"] == freezes * ["spindle speed changes"]
        rig.conditions = {"spindle_hz": 25.0} if freezes else {}
        rig.run(11 * freezes, 2.8)
        assert rig.guard.rejected == ({"frozen": 20} if freezes else {})
        rig.run(60, 2.8)
        assert rig.guard.shift == pytest.approx(SHIFT, abs=1e-12)
        rig.assert_within()


def test_it_is_not_armed_while_the_spindle_runs_up():
    rig, speed = Rig(), 10.0
    for _ in range(15):
        speed += 0.7
        rig.conditions = {"spindle_hz": speed}
        rig.ask("arm")
        rig.block()
        assert rig.guard.state == ("OFF" if speed > 11.0 else "ACTIVE")
        rig.ask("disarm")
    rig.run(8)
    rig.ask("arm")
    assert rig.run(1).guard.state == "OFF"
    rig.ask("arm")
    assert rig.run(1).guard.state == "ACTIVE"


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
