"""What only a close look tells apart: exact words, exact edges of commands and conditions."""

import math

import numpy as np
import pytest

from services.guard_commands import Doorkeeper
from services.guard_conditions import Conditions, Spindle
from services.guard_limits import MARGIN
from services.messages import OperatorRequest
from tests.services.guard_kit import BLOCK, LIMITS, RATE, SHIFT, Rig, limits, on_arc, rig_in
from tests.services.test_guard_motion import ANYWHERE, WIDE, resting


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


def test_the_dwell_counts_from_the_last_move():
    door = Doorkeeper(limits(moves_per_minute=3, dwell=1.0), "run", "controller", "operator")
    door.moved(0)
    door.moved(20_000)
    assert (door.hurried(28_999), door.hurried(29_000)) == ("dwell", "")


def test_a_diameter_that_no_lathe_turns_has_no_radius():
    plain = {"in_cut": True, "homed": True, "feed_hold": False, "spindle_hz": 20.0, "measured": np.zeros(3)}
    assert math.isnan(Conditions(diameter=10.0, **plain).radius)
    assert Conditions(diameter=9.0, **plain).radius == 4.5
