"""The loop does not hunt: each try has its time, their number is bounded, and then it says that it cannot help."""

import itertools
import math

import msgspec
import numpy as np
import pytest

from services.closed_loop import Loop
from services.config import load_case
from services.messages import ChatterReport, Event, MachineState, TurretCommand
from tests.closed_loop.test_loop import CountingClock

BLOCK = 90


class Restless:
    """A monitor that hears chatter for ever, at lines in turn, whatever is done."""

    def __init__(self, node, lines):
        self.node, self.lines, self.subscribes = node, itertools.cycle(lines), node.subscribes
        self.line = next(self.lines)

    def prepare(self):
        self.node.prepare()

    def handle(self, message):
        said = []
        for report in self.node.handle(message):
            if isinstance(report, ChatterReport) and report.in_cut:
                self.line = next(self.lines) if report.sequence % 40 == 0 else self.line
                report = msgspec.structs.replace(
                    report, state="chatter", kind="regenerative", frequency_hz=self.line, indicator=2.0 * report.limit
                )
            said.append(report)
        return said


@pytest.mark.parametrize(
    "lines", [(652.0,), (652.0, 690.0), (560.0, 740.0, 612.0, 668.0)], ids=["one line", "two lines", "four lines"]
)
def test_chatter_that_nothing_ends_is_given_up(lines):
    case = load_case("thesis-652", {"case.cut_time_s": 12.0})
    loop = Loop(case, 1, CountingClock())
    loop.wrap("monitor", lambda node: Restless(node, lines))
    for number in range(1100):
        loop.step(number)
    commands = loop.tape.of(TurretCommand)
    moves = [command for command in commands if command.action == "move"]
    assert 1 <= len(moves) <= case.planner.max_moves
    gaps = np.diff([command.issued_sample for command in moves]) / (BLOCK / 0.01)
    assert (gaps >= case.planner.dwell).all()
    assert case.planner.dwell >= case.limits.dwell, "what the planner may do, the guard lets it do"
    assert not [event for event in loop.tape.of(Event) if event.kind == "command_rejected"]
    ends = [event for event in loop.tape.of(Event) if event.kind == "give_up"]
    assert ends
    assert "cannot stabilise" in ends[-1].text or "no stable pitch" in ends[-1].text
    advice = [event.text for event in loop.tape.of(Event) if event.kind == "feed_hold_request"]
    assert advice
    assert all(text.strip() for text in advice)
    after = [command.shift_deg for command in commands if command.issued_sample > ends[-1].sample]
    assert len(after) > 100
    assert np.ptp(after) == 0.0, "given up, it stands still"
    states = loop.tape.of(MachineState)
    assert {state.guard_state for state in states[2:]} == {"ACTIVE"}
    assert abs(states[-1].shift_applied_deg) <= math.degrees(case.limits.target)
