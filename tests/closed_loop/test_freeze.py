"""The shift stands still while the machine says so, and the loop goes on afterwards by itself."""

import dataclasses
import math

import numpy as np
import pytest

from services.closed_loop import Loop, blocks_of
from services.config import load_case
from services.messages import ChatterReport, Event, MachineState, SampleBlock
from tests.closed_loop.test_loop import CountingClock

BLOCK = 90
HELD = {"feed hold": {"feed_hold": True}, "tool change": {"blocked": "tool change", "tool": 2},
        "threading": {"blocked": "threading"}, "spindle speed changes": {"override_percent": 104.0}}  # fmt: skip


def loop_of(**changes):
    case = load_case("thesis-652", {f"limits.{name}": value for name, value in changes.items()})
    return Loop(case, 1, CountingClock())


def run(loop, blocks, start=0):
    for number in range(start, start + blocks):
        loop.step(number)


@pytest.mark.parametrize("blocks", [20, 80])
@pytest.mark.parametrize("name", HELD)
def test_in_mid_move_it_freezes_and_the_loop_ends_the_chatter_later(name, blocks):
    loop, number = loop_of(), 0
    while not loop.machine._guard.moving:
        run(loop, 1, number)
        number += 1
    run(loop, 2, number)
    begin = loop.machine._guard.shift
    loop.machine.panel = dataclasses.replace(loop.machine.panel, **HELD[name])
    run(loop, blocks, number + 2)
    stopped = loop.machine._guard.shift
    assert 0.0 < begin < stopped < math.radians(1.5), "it stops at once"
    state = loop.tape.of(MachineState)[-1]
    assert (state.guard_state, state.tool) == ("ACTIVE", HELD[name].get("tool", 1))
    assert state.override_percent == HELD[name].get("override_percent", 100.0)
    assert [event.text for event in loop.tape.of(Event) if event.kind == "frozen"] == [name]
    shift = np.concatenate([block.dy1p_um for block in loop.tape.of(SampleBlock)])
    assert np.ptp(shift[-5 * BLOCK :]) < 2.0, "it stands, but for the noise of the scale (um)"
    loop.machine.panel = dataclasses.replace(loop.machine.panel, feed_hold=False, blocked="")
    run(loop, blocks_of(loop.machine._case) - number - 2 - blocks, number + 2 + blocks)
    assert loop.machine._guard.shift > 1.2 * stopped
    assert {report.state for report in loop.tape.of(ChatterReport)[-50:]} == {"quiet"}


def test_out_of_cut_freezes_where_the_job_says_so():
    loop = loop_of(freeze_out_of_cut=True)
    run(loop, 20)
    assert [event.text for event in loop.tape.of(Event) if event.kind == "frozen"] == ["out of cut"]
    run(loop, 230, 20)
    assert loop.machine._guard.shift > 0.02, "in the cut it moves"


def test_not_homed_is_a_fault_and_stays_one():
    loop = loop_of()
    run(loop, 20)
    loop.machine.panel = dataclasses.replace(loop.machine.panel, homed=False)
    run(loop, 1, 20)
    loop.machine.panel = dataclasses.replace(loop.machine.panel, homed=True)
    run(loop, 5, 21)
    assert loop.tape.of(MachineState)[-1].guard_state == "FAULT"
