"""Passes without action, room between the turrets, and what else could be done."""

import dataclasses
import json
import math

import pytest

from services.alternatives import alternatives_of
from services.cli import app
from services.closed_loop import Loop
from services.config import load_case
from services.dashboard.facts import Facts
from services.dashboard.view import View
from services.effects import KEYS, effects_of
from services.errors import InputError, RefusalError
from services.messages import Event, MachineState
from tests.closed_loop.test_loop import CountingClock
from tests.services.dashboard_kit import HandClock, event, state


def mine(tmp_path, text):
    path = tmp_path / "mine.toml"
    path.write_text('extends = "thesis-652"\n' + text)
    return str(path)


FINISH = '[job]\npass = "finish"\npasses_without_action = ["thread", "groove", "finish"]\n'
ROOM = (
    "[clearance]\nturret1_envelope_mm = [-80.0, -12.5, -30.0, 10.0]\n"
    "turret2_envelope_mm = [12.5, 80.0, -30.0, 10.0]\nleast_clearance_mm = {}\n"
)


def test_in_a_finish_pass_nothing_moves(tmp_path):
    """Chatter comes and is found; the guard is not armed at all."""
    loop = Loop(load_case(mine(tmp_path, FINISH)), 1, CountingClock())
    for number in range(260):
        loop.step(number)
    assert {s.guard_state for s in loop.tape.of(MachineState)} == {"OFF"}
    assert any("finish pass: no action" in e.text for e in loop.tape.of(Event) if e.kind == "request_rejected")
    assert any("chatter at" in e.text for e in loop.tape.of(Event) if e.kind == "monitor_state")


def test_a_pass_that_begins_freezes_the_shift_where_it_stands(tmp_path):
    loop = Loop(load_case(mine(tmp_path, FINISH.replace('pass = "finish"', 'pass = "rough"'))), 1, CountingClock())
    for number in range(205):
        loop.step(number)
    assert loop.machine._guard.state == "ACTIVE"
    loop.machine.pass_kind = "thread"
    for number in range(205, 300):
        loop.step(number)
    states = loop.tape.of(MachineState)
    assert max(abs(s.shift_applied_deg) for s in states) < 0.01, "moved in a thread"
    assert any(e.kind == "frozen" and "thread" in e.text for e in loop.tape.of(Event))
    loop.machine.pass_kind = "rough"
    for number in range(300, 420):
        loop.step(number)
    assert loop.tape.of(MachineState)[-1].shift_applied_deg > 1.0


def test_the_turrets_keep_their_distance_or_the_case_is_refused(tmp_path):
    case = load_case(mine(tmp_path, ROOM.format(20.0)))
    assert effects_of(case, 0.05)["clearance_mm"] == pytest.approx(25.0 - 25.0 * math.sin(0.025) ** 2, abs=1e-6)
    with pytest.raises(InputError, match=r"limits.target_deg must be so small that clearance.least_clearance_mm"):
        load_case(mine(tmp_path, ROOM.format(25.0)))


@pytest.mark.parametrize(
    ("text", "field", "said"),
    [
        ('[job]\npass = "finish"\n', "job.passes_without_action", "given where the pass is"),
        ('[job]\npass = "drill"\n', "job.pass", "one of 'rough', 'finish'"),
        ('[job]\npasses_without_action = "thread"\n', "job.passes_without_action", "a list of words"),
        ('[job]\npasses_without_action = ["threat"]\n', "job.passes_without_action", "one of"),
        ('[job]\npasses_without_action = ["thread", "thread"]\n', "job.passes_without_action", "differ"),
        ("[job]\nadvise_only = 1\n", "job.advise_only", "true or false"),
        ("[job]\nquiet = true\n", "job.quiet", "a key of [job]"),
        (ROOM.format(-1.0), "clearance.least_clearance_mm", "above 0"),
        (ROOM.format(1.0).replace("[12.5, 80.0,", "[80.0, 12.5,"), "clearance.turret2_envelope_mm", "lowest"),
        (ROOM.format(1.0).replace("-30.0, 10.0]", "10.0]", 1), "clearance.turret1_envelope_mm", "4 numbers"),
        ("[clearance]\nleast_clearance_mm = 1.0\n", "clearance.turret1_envelope_mm", "given in"),
    ],
)
def test_bad_keys_are_named(tmp_path, text, field, said):
    with pytest.raises(InputError) as error:
        load_case(mine(tmp_path, text))
    assert error.value.field == field
    assert said in str(error.value)


def test_advice_follows_the_believed_stiffness():
    """At the border the margin is 0; half the stiffness there is one of 100 %."""
    case = load_case("thesis-652")
    margin = alternatives_of(case).margin

    def with_stiffness(factor):
        belief = dataclasses.replace(case.foresight, cutting_stiffness=factor * case.foresight.cutting_stiffness)
        return alternatives_of(dataclasses.replace(case, foresight=belief))

    assert with_stiffness(1.0 + margin).margin == pytest.approx(0.0, abs=1e-9)
    half = with_stiffness(0.5 * (1.0 + margin))
    assert half.margin == pytest.approx(1.0)
    assert half.best["depth"].margin > half.margin
    near = with_stiffness(1.02 * (1.0 + margin))
    assert near.margin < 0.0 < near.nearest["feed"].margin
    assert near.nearest["feed"].value > 0.15
    assert "less than the 30 %" in " ".join(near.sentences())


def test_advice_needs_a_belief_and_says_what_it_does_not_know():
    case = load_case("thesis-652")
    with pytest.raises(RefusalError, match="nothing is believed"):
        alternatives_of(dataclasses.replace(case, foresight=None))
    deep = dataclasses.replace(case.cutting, depth_of_cut=0.6e-3)
    other = alternatives_of(dataclasses.replace(case, cutting=deep))
    assert "depth" not in other.best
    assert "deeper than the nose" in other.sentences()[-1]
    slow = dataclasses.replace(case.cutting, spindle_hz=6.0)
    with pytest.raises(InputError, match="spindle_speed"):
        alternatives_of(dataclasses.replace(case, cutting=slow))


def test_the_verb_advise(capsys):
    with pytest.raises(SystemExit) as ended:
        app.main(["advise", "quiet", "--json"])
    answer = json.loads(capsys.readouterr().out)
    assert ended.value.code == 0
    assert set(answer["effects"]) == set(KEYS)
    assert answer["present"]["stable"]
    assert answer["speed"]["best"]["margin_percent"] >= answer["present"]["margin_percent"]
    with pytest.raises(SystemExit) as ended:
        app.main(["advise", "quiet", "--shift-deg", "9", "--json"])
    assert ended.value.code == 2
    assert json.loads(capsys.readouterr().out)["error"]["field"] == "shift-deg"


def test_the_dashboard_knows_the_effects():
    facts = Facts.of(load_case("thesis-652"))
    assert facts.effects(2.77)["mark_widths_um"] == pytest.approx([76.15, 73.85], abs=0.01)
    assert facts.effects(None) is None
    assert facts.effects(99.0) is None


def test_the_dashboard_shows_what_is_advised_and_what_it_would_leave():
    view = View(Facts.of(load_case("thesis-652")), HandClock())

    def hear(message):
        view.handle(message)
        return view.state()

    hear(state(0))
    shown = hear(event(0, "not commanded: turret 1 to 2.77 deg", kind="advice", shift_deg=2.77))
    assert shown["advice"].startswith("not commanded")
    assert shown["advised_shift_deg"] == 2.77
    assert shown["effects"]["shift_deg"] == pytest.approx(2.77)
    assert hear(event(1, "another run", kind="advice", shift_deg=1.0, run="r2"))["advised_shift_deg"] == 2.77
    assert hear(event(2, "nonsense", kind="advice", shift_deg=math.nan))["advised_shift_deg"] == 2.77
    shown = hear(event(3, "gone", kind="advice_over"))
    assert (shown["advice"], shown["advised_shift_deg"]) == (None, None)
    assert shown["effects"]["shift_deg"] == 0.0
