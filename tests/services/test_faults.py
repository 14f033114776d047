"""The campaign of bad days: it repeats, it sees a guard that fails, and 300 days go well."""

import dataclasses
import json
import math

import numpy as np
import pytest

from services import guard, guard_motion
from services.cli import app
from services.config import load_case
from services.faults.campaign import campaign, rows
from services.faults.day import live
from services.faults.invariants import Ladder, excursions, restless, unlogged
from services.faults.links import FaultyLink
from services.faults.schedule import COMMAND, FAULTS, Fault, Schedule, draw
from services.guard_conditions import Conditions
from services.messages import Event
from tests.services.guard_kit import LIMITS, on_arc

CASE = load_case("thesis-652")
LAST = round(3.6 / 0.01)


def day_of(kind, *, first=60, last=LAST, seed=1, returns=False, **more):
    return Schedule(
        seed=seed, faults=(Fault(kind=kind, first=first, last=last, **more),), returns=returns, arm_block=0
    )


def test_three_hundred_bad_days():
    told = []
    lived = campaign("thesis-652", range(300), 2, lambda done, failed: told.append((done, failed)))
    assert told[-1] == (300, 0), [(day.schedule.seed, day.violations) for day in lived if day.violations]
    assert [day.schedule.seed for day in lived] == list(range(300))
    table = rows(lived)
    assert [row.fault for row in table] == list(FAULTS)
    lost = 1e3 * CASE.limits.loss_hold
    assert max(row.worst_reaction_ms for row in table) <= lost + 10.0
    assert 0.5 < max(row.worst_excursion for row in table) <= 1.0
    states = {state for day in lived for state, blocks in day.states.items() if blocks}
    assert states == {"OFF", "ARMED", "ACTIVE", "HOLDING", "RETURNING", "FAULT"}
    moved = sum(day.excursion > 0.1 for day in lived)
    assert moved > 250, "the turret must have moved on nearly all days, else they prove nothing"
    assert len({reason for day in lived for reason in day.rejected}) >= 10


@pytest.mark.parametrize("seed", [6, 14, 29])
def test_a_day_can_be_had_again(seed):
    assert draw(seed) == draw(seed)
    assert dataclasses.asdict(live(CASE, draw(seed))) == dataclasses.asdict(live(CASE, draw(seed)))


@pytest.mark.parametrize(("returns", "end"), [(False, "HOLDING"), (True, "RETURNING")])
def test_a_lost_controller_is_answered_after_t1_and_t2(returns, end):
    day = live(CASE, day_of("controller lost", last=60 + 150, returns=returns))
    assert not day.violations
    assert day.reaction_ms == pytest.approx(1e3 * CASE.limits.loss_hold, abs=10.0)
    assert day.states[end] > 10
    assert live(CASE, day_of("controller lost")).states["FAULT"] > 50


BROKEN = {
    "lets every path through": (
        guard_motion.Envelope, "follow", lambda self, request, samples, way: pass_on(self, request, samples),
        day_of("bad path", first=40, last=60),
    ),
    "never gives up": (
        guard.Guard, "_climb", lambda self, conditions, interlock: None, day_of("controller lost"),
    ),
}  # fmt: skip


def pass_on(envelope, request, samples):
    points = guard_motion._parse(request, samples)
    if points is None:
        return "not numbers"
    envelope._issue(points)
    envelope._stop = points[:, :0]
    envelope._held = False
    return ""


@pytest.mark.parametrize("name", BROKEN)
def test_a_broken_guard_is_found_out(monkeypatch, name):
    where, what, instead, schedule = BROKEN[name]
    assert not live(CASE, schedule).violations
    monkeypatch.setattr(where, what, instead)
    assert live(CASE, schedule).violations


def test_a_node_that_dies_is_found_out(monkeypatch):
    def dies(self, message):
        raise FloatingPointError("nan")

    monkeypatch.setattr("services.nodes.controller.ControllerNode.handle", dies)
    assert "a node died of FloatingPointError: nan" in live(CASE, draw(0)).violations[0]


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("shift", lambda p: p + 0.2), ("x1", lambda p: p + np.array([[0.0], [3e-3], [0.0]])),
        ("shift_speed", lambda p: p * 14.0), ("slide_jerk", lambda p: p + 1e-6 * (np.arange(p.shape[1]) == 50)),
        ("set points that are numbers", lambda p: p * np.nan),
    ],
)  # fmt: skip
def test_every_excursion_is_measured(name, change):
    turn = np.linspace(0.0, np.pi, 2000)
    sound = on_arc(0.006 * (1.0 - np.cos(turn)))
    assert max(excursions(sound, LIMITS).values()) < 1.0
    assert excursions(change(sound), LIMITS)[name] > 1.0


def told(**changes):
    plain = {"in_cut": True, "homed": True, "feed_hold": False, "spindle_hz": 20.0, "diameter": 0.025}
    return Conditions(**(plain | {"measured": np.zeros(3)} | changes))


def test_the_ladder_is_held_against_time():
    def judged(states, limits=LIMITS, **conditions):
        ladder = Ladder(limits)
        for number, state in enumerate(states):
            ladder.block(90 * number, state, told(**conditions))
        return ladder

    sound = ["ACTIVE"] * 30 + ["HOLDING"] * 170 + ["FAULT"] * 5
    assert judged(sound).broken == []
    assert judged(sound).longest == 30 * 90
    assert judged(["ACTIVE"] * 32).broken
    assert judged(["ACTIVE"] * 30 + ["HOLDING"] * 180).broken
    back = dataclasses.replace(LIMITS, on_loss="return")
    assert judged(sound, back).broken
    assert judged(sound, back, feed_hold=True).broken == []
    assert judged(["ACTIVE"] * 30 + ["HOLDING"] * 70 + ["RETURNING"] * 100, back).broken == []
    assert judged(["ACTIVE"], homed=False).broken


def test_motion_after_the_end_and_states_without_an_event_are_found_out():
    still = np.zeros((3, 90 * 300))
    states = ["FAULT"] * 300
    assert restless(still, states, 90, LIMITS) == ""
    still[0, -1] = 1e-9
    assert "still move in FAULT" in restless(still, states, 90, LIMITS)
    events = [Event(run="r", source="m", sequence=0, sample=0, kind="guard_state", text="OFF -> ARMED: operator")]
    assert unlogged(["OFF", "ARMED"], events) == ""
    assert unlogged(["OFF", "ACTIVE"], events)
    assert unlogged(["OFF", "OFF"], events)


def test_links_lose_double_and_keep():
    def through(kind, share=1.0, delay=0):
        link = FaultyLink(
            COMMAND,
            (Fault(kind=kind, first=0, last=50, share=share, delay=delay),),
            np.random.default_rng(1),
        )
        found = []
        for block in range(120):
            if block < 50:
                link.put(block, block)
            found += [(block, message) for message in link.take(block)]
        return found

    assert through("lost") == through("router restart") == []
    assert [m for _, m in through("duplicated")] == sorted([*range(50), *range(50)])
    assert through("delayed", delay=7) == [(block + 7, block) for block in range(50)]
    assert [m for _, m in through("reordered", 0.5)] != list(range(50))
    assert sorted(m for _, m in through("reordered", 0.5)) == list(range(50))
    late = through("CPU starvation", delay=20)
    assert [m for _, m in late] == list(range(50))
    assert max(block for block, _ in late) == 50


def test_on_the_command_line(capsys, tmp_path):
    with pytest.raises(SystemExit) as ended:
        app.main(["faults", "--runs", "2", "--seed", "13", "--workers", "1", "--out", str(tmp_path), "--json"])
    answer = json.loads(capsys.readouterr().out)
    assert (ended.value.code, answer["runs"], answer["violations"]) == (0, 2, 0)
    assert {"fault", "runs", "worst_reaction_ms", "worst_excursion"} <= set(answer["rows"][0])
    assert "| controller lost | 1 |" in (tmp_path / "faults.md").read_text()
    with pytest.raises(SystemExit) as ended:
        app.main(["faults", "--runs", "0", "--json"])
    assert ended.value.code == 2
    assert math.isfinite(answer["rows"][0]["worst_reaction_ms"])
