"""A controller that only advises: it decides as ever, nothing leaves it, and the guard has nothing to do."""

import dataclasses
import functools
import json

import pytest

from services.cli import app
from services.closed_loop import Loop, judge
from services.config import load_case
from services.effects import shift_of, with_advice
from services.messages import ADVICE, ADVICE_OVER, MODE, ChatterReport, Event, MachineState, TurretCommand
from services.nodes.controller import ControllerNode
from services.sentences import verdict
from services.supervisor import SERVICES, Plan
from tests.closed_loop.test_loop import CountingClock


@functools.cache
def cut(advise_only, request, seconds=2.6, arm_after_s=0.0):
    loop = Loop(load_case("thesis-652"), 1, CountingClock(), arm_after_s, advise_only=advise_only, request=request)
    for number in range(round(100 * seconds)):
        loop.step(number)
    return loop.tape


def first_move(tape):
    return next(c.shift_deg for c in tape.of(TurretCommand) if c.action == "move")


def test_it_says_what_it_would_command_and_commands_nothing():
    tape = cut(True, "arm", arm_after_s=None)
    events = [e for e in tape.of(Event) if e.source == "controller"]
    assert [e.kind for e in events[:2]] == [MODE, ADVICE]
    assert not tape.of(TurretCommand)
    assert {s.guard_state for s in tape.of(MachineState)} == {"OFF"}
    assert {s.shift_requested_deg for s in tape.of(MachineState)} == {0.0}
    assert max(abs(s.shift_applied_deg) for s in tape.of(MachineState)) < 0.01
    assert events[1].shift_deg == pytest.approx(first_move(cut(False, "arm")), abs=1e-9)
    assert "not commanded" in events[1].text


def test_the_dry_run_of_the_guard_is_another_thing():
    """There commands are sent, judged and counted; only the guard lets nothing through."""
    tape = cut(False, "dry_run")
    last = tape.of(MachineState)[-1]
    assert last.guard_state == "ARMED"
    assert last.commands_accepted > 200
    assert first_move(tape) > 1.0
    assert max(abs(s.shift_applied_deg) for s in tape.of(MachineState)) < 0.01


def test_advice_is_said_once_and_withdrawn_when_the_chatter_goes():
    reports = cut(True, "arm", arm_after_s=None).of(ChatterReport)
    node = ControllerNode(load_case("thesis-652"), reports[0].run, advise_only=True)
    loud = next(r for r in reports if r.state == "chatter")

    def at(number, **changes):
        first = number * loud.samples
        values = {name: getattr(loud, name) for name in loud.__struct_fields__}
        return ChatterReport(**(values | {"sequence": number, "first_sample": first} | changes))

    said = [e for number in range(150) for e in node.handle(at(number))]
    assert [e.kind for e in said] == [MODE, ADVICE]
    said = [e for number in range(150, 250) for e in node.handle(at(number, state="quiet"))]
    assert [e.kind for e in said] == [ADVICE_OVER]
    said = [e for number in range(250, 400) for e in node.handle(at(number, spindle_speed_rpm=1500.0))]
    assert [e.kind for e in said] == [ADVICE]


def test_it_may_come_from_the_case(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text('extends = "thesis-652"\n[job]\nadvise_only = true\n')
    reports = cut(True, "arm", arm_after_s=None).of(ChatterReport)
    node = ControllerNode(load_case(str(path)), reports[0].run)
    out = [message for report in reports for message in node.handle(dataclass_armed(report))]
    assert {type(message) for message in out} == {Event}


def dataclass_armed(report):
    values = {name: getattr(report, name) for name in report.__struct_fields__}
    return ChatterReport(**(values | {"guard_state": "ACTIVE", "session": "s"}))


def test_the_report_says_what_would_have_been_done():
    case = load_case("thesis-652")
    outcome = judge(case, 1, cut(True, "arm", arm_after_s=None), interrupted=False)
    said = " ".join(verdict(outcome.record, outcome.summary).sentences)
    shift_deg = first_move(cut(False, "arm"))
    assert f"would have moved turret 1 to {shift_deg:.2f}°" in said
    record = with_advice(case, outcome.record)
    assert shift_of(record) == pytest.approx(shift_deg, abs=1e-9)
    assert record.effects[0][0] == "Feed marks"
    assert "unstable at equal pitch" in record.alternatives[0]
    unknown = with_advice(dataclasses.replace(case, foresight=None), outcome.record)
    assert "not known" in unknown.alternatives[0]


def test_the_option_reaches_the_controller_and_nobody_else():
    plan = Plan(case="quiet", machine="lathe-1", seed=1, advise_only=True)
    assert [s for s in SERVICES if "--advise-only" in plan.line(s, "tcp/127.0.0.1:1")] == ["controller"]


def test_who_only_advises_arms_nothing(capsys):
    with pytest.raises(SystemExit) as ended:
        app.main(["up", "quiet", "--advise-only", "--arm-after-s", "1", "--json"])
    assert ended.value.code == 2
    assert json.loads(capsys.readouterr().out)["error"]["field"] == "arm-after-s"
