"""The contract of a machine: the simulator keeps it, and whoever breaks it is found out."""

import functools

import msgspec
import numpy as np
import pytest

from services import supervisor
from services.cli import app
from services.config import load_case
from services.errors import InputError
from services.guard import Guard
from services.guard_conditions import Conditions
from services.machines.adapters import Choice, open_machine
from services.machines.conformance import RUN, conformance
from services.machines.contract import Machine
from services.messages import MachineState, SampleBlock, Tick
from services.nodes.machine import MachineNode


@functools.cache
def case():
    return load_case("thesis-652")


def failures(machine):
    return {finding.name for finding in conformance(machine, case()) if not finding.ok}


def test_the_simulator_is_the_first_adapter():
    with open_machine(Choice(), case(), 1, RUN) as machine:
        assert isinstance(machine, Machine)
        assert failures(machine) == set()
        assert machine.summary() == {"adapter": "simulator"}


class Forgetful(MachineNode):
    """Leaves out every third state."""

    def handle(self, message):
        said = super().handle(message)
        drop = isinstance(message, Tick) and message.block % 3 == 2
        return [m for m in said if not (drop and isinstance(m, MachineState))]


class Deaf(MachineNode):
    """Says that the turret is where it was asked to be, and leaves it where it is."""

    def _drive(self, checked):
        return super()._drive(checked._replace(x1=np.zeros_like(checked.x1), y1=np.zeros_like(checked.y1)))


class Late(MachineNode):
    """Counts its samples from one."""

    def handle(self, message):
        return [
            msgspec.structs.replace(m, first_sample=m.first_sample + 1) if isinstance(m, SampleBlock) else m
            for m in super().handle(message)
        ]


class Forgiving(MachineNode):
    """Takes back its own fault."""

    def handle(self, message):
        if self._guard.state == "FAULT":
            self._guard._go("OFF", "who cares")
        return super().handle(message)


@pytest.mark.parametrize(
    ("broken", "finding"),
    [
        (Forgetful, "one block and one state each tick"),
        (Deaf, "goes where it is commanded"),
        (Late, "contiguous"),
        (Forgiving, "goes on only after a reset"),
    ],
)
def test_a_machine_that_breaks_the_contract_is_found_out(broken, finding):
    assert finding in failures(broken(case(), 1, RUN))


@pytest.mark.parametrize(
    ("given", "field"),
    [
        ({"adapter": "fanuc"}, "adapter"),
        ({"folder": "x"}, "linuxcnc"),
        ({"attach": True}, "attach"),
        ({"adapter": "linuxcnc", "attach": True}, "attach"),
    ],
)
def test_a_choice_that_makes_no_sense_is_refused(given, field):
    with pytest.raises(InputError) as refused:
        Choice(**given)
    assert refused.value.field == field


def test_a_choice_is_handed_on_as_options():
    assert Choice().options() == ()
    choice = Choice(adapter="linuxcnc", folder="d", attach=True, trace="t.csv")
    assert choice.options() == ("--adapter", "linuxcnc", "--linuxcnc", "d", "--trace", "t.csv", "--attach")


def test_up_hands_the_adapter_on_to_its_machine(monkeypatch, capsys):
    plans = []
    monkeypatch.setattr(supervisor, "keep_up", lambda plan, *_, **__: plans.append(plan) or {})
    with pytest.raises(SystemExit):
        app.main(["up", "thesis-652", "--adapter", "linuxcnc", "--forever", "--json"])
    assert plans[0].lasts == ("--forever", "--adapter", "linuxcnc")
    assert capsys.readouterr().out.startswith("{")


def make_guard():
    return Guard(case().limits, run=RUN, controller="controller", operator="operator", token=lambda: "s")


def test_the_guard_is_told_where_it_stands_only_while_off():
    guard = make_guard()
    guard.stand((0.02, -1e-4, 2e-4))
    assert guard.position == pytest.approx([0.02, -1e-4, 2e-4])
    assert guard.target == pytest.approx(0.02)
    with pytest.raises(ValueError, match="start must be within the limits"):
        guard.stand((1.0, 0.0, 0.0))
    guard.state = "ACTIVE"
    with pytest.raises(RuntimeError, match="while OFF"):
        guard.stand((0.0, 0.0, 0.0))


def test_a_machine_that_failed_is_unfit_and_says_why():
    plain = {"in_cut": False, "feed_hold": False, "spindle_hz": 20.0, "diameter": 0.025, "measured": np.zeros(3)}
    assert Conditions(homed=True, failed="the control is gone", **plain).unfit == "the control is gone"
    assert Conditions(homed=True, **plain).unfit == ""
