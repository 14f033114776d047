"""Chatter appears, is found, the pitch moves, the chatter goes: everything in one process, nothing timed."""

import dataclasses
import functools
import gc
import math
import weakref

import msgspec
import numpy as np
import pytest

from pitch import OneModeProcess, roots
from services.clock import WallClock
from services.closed_loop import Loop, blocks_of, judge, run_case
from services.config import load_case
from services.messages import ChatterReport, Event, SampleBlock, TurretCommand
from services.nodes.controller import ControllerNode
from services.nodes.machine import make_plant
from services.nodes.monitor import MonitorNode


class CountingClock:
    """Time that passes by itself, the same in every run."""

    def __init__(self):
        self.ticks = 0

    def now(self):
        self.ticks += 1
        return 1e-3 * self.ticks

    def sleep_until(self, moment):
        raise AssertionError("lockstep never waits")


@functools.cache
def outcome(name, seed, arm_after_s=0.0):
    return run_case(load_case(name), seed, CountingClock(), arm_after_s=arm_after_s)


def leading_lines_hz(name):
    """Frequencies of the roots whose growth is within 4 1/s of the largest, with the tools where they enter."""
    case = load_case(name)
    linear = make_plant(case, 1).linear_parameters(case.settings.start_position)
    process = OneModeProcess(
        linear.mass_at_tools, linear.natural_frequency_hz, linear.damping_ratio, linear.overlap, linear.process_damping
    )
    found = roots(process, linear.cutting_stiffness, case.cutting.spindle_hz, 0.0)
    return [abs(root.imag) / (2 * math.pi) for root in found if root.real > found[0].real - 4.0]


@pytest.mark.parametrize("seed", range(1, 21))
def test_thesis_652_is_found_and_silenced(seed):
    summary = outcome("thesis-652", seed).summary
    assert min(abs(summary.chatter_hz - line) for line in leading_lines_hz("thesis-652")) < 3.0
    assert summary.detection_latency_s <= 0.1
    assert summary.first_command_s == summary.detected_s, "the report that detects carries the command"
    assert 2.0 <= summary.shift_deg <= 3.6
    assert summary.suppressed_s is not None
    assert summary.ra_before_um >= 2.5 * summary.ra_after_um
    assert summary.marked_length_mm <= 1.5
    assert summary.moves == 1, "one move is enough: no hunting"
    assert summary.commands_rejected == summary.commands_late == summary.blocks_lost == 0


@pytest.mark.parametrize("name", ["thesis-738", "thesis-depth-02"])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_other_bars_are_silenced(name, seed):
    summary = outcome(name, seed).summary
    assert summary.outcome == "suppressed"
    assert min(abs(summary.chatter_hz - line) for line in leading_lines_hz(name)) < 5.0
    assert summary.ra_before_um >= 2.5 * summary.ra_after_um


def test_the_depth_inversion():
    assert outcome("thesis-depth-02", 1).summary.chatter_onset_s is not None
    assert outcome("thesis-depth-03", 1).summary.outcome == "stable"


@pytest.mark.parametrize("seed", [1, 2])
def test_a_quiet_minute_has_no_alarm(seed):
    summary = outcome("quiet", seed).summary
    assert summary.simulated_s == 60.0
    assert summary.outcome == "stable"
    assert summary.moves == 0


def test_a_long_pass_stays_silent_with_one_shift():
    result = outcome("drift", 1)
    assert result.summary.outcome == "suppressed"
    assert result.summary.moves == 1
    assert result.summary.marked_length_twin_mm > 20 * result.summary.marked_length_mm


def test_armed_late_the_chatter_grows_first():
    summary = outcome("thesis-652", 1, 3.0).summary
    assert summary.detected_s < 3.0
    assert 3.0 <= summary.first_command_s <= 3.05
    assert summary.suppressed_s is not None


def test_the_twin_is_the_same_until_the_first_shift():
    record, summary = outcome("thesis-652", 1).record, outcome("thesis-652", 1).summary
    applied = round((summary.first_command_s + 0.02) * record.sample_rate_hz)  # three blocks after its cause began
    assert np.array_equal(record.controlled.vibration_um[:applied], record.twin.vibration_um[:applied])
    assert not np.array_equal(record.controlled.vibration_um[applied:], record.twin.vibration_um[applied:])
    apart = np.abs(record.controlled.force_x1_n[:applied] - record.twin.force_x1_n[:applied])
    assert apart.max() < 1e-6


def test_the_same_seed_gives_the_same_bits():
    one, two = outcome("thesis-652", 3), run_case(load_case("thesis-652"), 3, CountingClock())
    assert np.array_equal(one.record.controlled.vibration_um, two.record.controlled.vibration_um)
    assert one.record.reports.frequency_hz.tobytes() == two.record.reports.frequency_hz.tobytes()
    assert one.summary.shift_deg == two.summary.shift_deg


@pytest.mark.parametrize(
    ("part", "change"),
    [
        ("stage_mass", 0.8), ("stage_mass", 1.2), ("screw_stiffness", 0.8), ("screw_stiffness", 1.2),
        ("screw_damping", 0.5), ("stage_damping", 2.0),
    ],
)  # fmt: skip
def test_it_works_with_drives_believed_wrongly(part, change):
    case = load_case("thesis-652")
    wrong = {a: dataclasses.replace(d, **{part: change * getattr(d, part)}) for a, d in axes(case.belief).items()}
    believed = dataclasses.replace(case, belief=dataclasses.replace(case.belief, **wrong))
    summary = run_case(believed, 1, CountingClock()).summary
    assert summary.outcome == "suppressed"
    assert summary.detection_latency_s < 0.15


def axes(belief):
    return {"x1": belief.x1, "y1": belief.y1}


@pytest.mark.parametrize("share", [0.7, 1.3])
def test_it_works_with_the_cutting_stiffness_believed_wrongly(share):
    case = load_case("thesis-652")
    monitor = dataclasses.replace(case.monitor, expected_limit=share * case.monitor.expected_limit)
    summary = run_case(dataclasses.replace(case, monitor=monitor), 2, CountingClock()).summary
    assert summary.outcome == "suppressed"


def test_an_interrupted_run_reports_what_was_seen():
    def stop(share):
        if share > 0.375:
            raise KeyboardInterrupt

    result = run_case(load_case("thesis-652"), 1, CountingClock(), progress=stop)
    assert result.summary.interrupted
    assert 2.1 < result.summary.simulated_s < 2.5
    lengths = {getattr(result.record.controlled, name).size for name in ("vibration_um", "force_x1_n", "in_cut")}
    assert len(lengths) == 1


def test_interrupted_before_anything_happened():
    def stop(share):
        raise KeyboardInterrupt

    result = run_case(load_case("thesis-652"), 1, CountingClock(), progress=stop)
    assert result.summary.outcome == "no_cut"


class Disturbed:
    """A node whose messages pass through `change` on their way in."""

    def __init__(self, node, change):
        self.node, self.change, self.subscribes = node, change, node.subscribes

    def prepare(self):
        self.node.prepare()

    def handle(self, message):
        return [out for m in self.change(message) for out in self.node.handle(m)]


def disturbed(target, change, name="thesis-652", seed=1, **changes):
    case = load_case(name, changes)
    loop = Loop(case, seed, CountingClock())
    loop.wrap(target, lambda node: Disturbed(node, change))
    for number in range(blocks_of(case)):
        loop.step(number)
    return judge(case, seed, loop.tape, interrupted=False), loop


def test_lost_blocks_are_reported_and_the_loop_still_closes():
    lost = {150, 151, 195, 220}
    result, loop = disturbed("monitor", lambda m: [] if m.sequence in lost else [m])
    reports = loop.tape.of(ChatterReport)
    assert sum(report.gap_samples for report in reports) == 90 * len(lost)
    assert [r.sequence for r in reports if r.state == "gap"] == [152, 196, 221]
    assert loop.tape.blocks_lost == len(lost)
    assert result.summary.suppressed_s is not None


def test_blocks_that_come_twice_change_nothing_but_the_count():
    result, loop = disturbed("monitor", lambda m: [m, m])
    assert result.summary.suppressed_s is not None
    assert len(loop.tape.of(ChatterReport)) == 600


@pytest.mark.parametrize("bad", [math.nan, math.inf, 1e300])
def test_a_sensor_that_fails_is_said_and_moves_nothing(bad):
    def break_scale(message):
        if 140 <= message.sequence < 180:
            broken = message.x1_stage_position_m.copy()
            broken[7] = bad
            return [msgspec.structs.replace(message, x1_stage_position_m=broken)]
        return [message]

    result, loop = disturbed("monitor", break_scale)
    states = {r.sequence: r.state for r in loop.tape.of(ChatterReport)}
    assert all(states[number] == "invalid" for number in range(141, 180))
    assert all(abs(c.shift_deg) < 1e-9 for c in loop.tape.of(TurretCommand) if c.sequence < 190)
    assert result.summary.suppressed_s is not None


def hostile(message):
    """Send each command several times, late ones, foreign ones and absurd ones between."""
    change = msgspec.structs.replace
    return [
        change(message, shift_deg=50.0),
        message,
        message,
        change(message, sequence=message.sequence - 5),
        change(message, sequence=message.sequence + 1, shift_deg=math.nan),
        change(message, sequence=message.sequence + 1, source="nobody", shift_deg=3.0),
        change(message, sequence=message.sequence + 1, session="yesterday", shift_deg=3.0),
        change(message, sequence=message.sequence + 1, expires_at_sample=0, apply_at_sample=0, issued_sample=0),
    ]


def test_bad_commands_are_rejected_with_reasons_and_never_leave_the_limits():
    case = load_case("thesis-652")
    change = lambda m: hostile(m) if isinstance(m, TurretCommand) else [m]  # noqa: E731
    result, loop = disturbed("machine", change)
    assert result.summary.suppressed_s is not None, "the good command still gets through"
    assert result.summary.max_shift_deg <= math.degrees(case.limits.shift)
    reasons = {event.text.rsplit(": ", 1)[-1] for event in loop.tape.of(Event) if event.kind == "command_rejected"}
    assert {"limit", "duplicate", "out of order", "not finite", "source", "session"} <= reasons
    shift = np.concatenate([block.dy1p_um for block in loop.tape.of(SampleBlock)])
    assert np.abs(np.diff(shift)).max() < 1e3 * case.limits.slide_speed * 1e3 / 9000.0


def test_a_controller_that_falls_silent_leaves_the_turret_where_it_is():
    def silent(message):
        return [] if isinstance(message, TurretCommand) and message.sequence > 250 else [message]

    result, loop = disturbed("machine", silent)
    applied = result.record.controlled.shift_applied_deg
    assert np.ptp(applied[260 * 90 :]) < 0.01
    states = [e.text for e in loop.tape.of(Event) if e.kind == "guard_state"]
    assert any("HOLDING" in text for text in states)
    assert any("FAULT" in text for text in states)


def test_a_job_may_want_the_turret_back_and_the_chatter_comes_back_with_it():
    def silent(message):
        return [] if isinstance(message, TurretCommand) and message.sequence > 250 else [message]

    result, loop = disturbed("machine", silent, **{"limits.on_loss": "return"})
    states = [e.text for e in loop.tape.of(Event) if e.kind == "guard_state"]
    assert any("RETURNING" in text for text in states)
    record = result.record
    back = np.abs(record.controlled.shift_applied_deg) < 0.01
    assert back[420 * 90 : 440 * 90].all()
    rate = np.abs(np.diff(record.controlled.shift_applied_deg[360 * 90 :: 90])).max() / 0.01
    assert rate < 11.0, "not faster than the return speed, apart from the noise of the scale"
    assert record.controlled.vibration_um[-900:].std() > 10 * record.controlled.vibration_um[300 * 90 : 310 * 90].std()


@pytest.mark.parametrize("at", [260, 400])
def test_a_controller_started_afresh_takes_the_target_over(at):
    case = load_case("thesis-652")
    loop = Loop(case, 1, CountingClock())
    for number in range(blocks_of(case)):
        if number == at:
            loop.wrap("controller", lambda _: ControllerNode(case, loop.controller._run))
        loop.step(number)
    told = {command.shift_deg for command in loop.tape.of(TurretCommand) if command.sequence > at}
    before = [command.shift_deg for command in loop.tape.of(TurretCommand) if command.sequence < at][-1]
    assert max(abs(shift - before) for shift in told) < 1e-9
    assert not [event for event in loop.tape.of(Event) if event.kind == "command_rejected"]


@pytest.mark.parametrize("at", [260, 320, 450])
def test_a_monitor_started_afresh_in_mid_cut_does_not_cry_wolf(at):
    case = load_case("thesis-652")
    for seed in (1, 2):
        loop = Loop(case, seed, CountingClock())
        for number in range(blocks_of(case)):
            if number == at:
                loop.wrap("monitor", lambda _: MonitorNode(case, ""))
            loop.step(number)
        assert len([event for event in loop.tape.of(Event) if event.source == "controller"]) == 1


@pytest.mark.parametrize("name", ["standing", "optimal"])
def test_the_loop_takes_an_estimator_by_its_name(name):
    case = load_case("thesis-652", {"case.force_estimator": name})
    summary = run_case(case, 1, CountingClock()).summary
    assert summary.outcome in ("suppressed", "prevented")
    assert summary.moves == 1


def test_a_loop_and_what_it_recorded_are_gone_with_its_last_user():
    loop = Loop(load_case("thesis-652"), 1, WallClock())
    loop.step(0)
    gone = [weakref.ref(part) for part in (loop, loop.machine, loop.monitor)]
    gc.collect()
    gc.disable()
    try:
        del loop
        assert [part() for part in gone] == [None, None, None]
    finally:
        gc.enable()
