"""One bad day: machine, monitor and controller in lockstep, with what goes wrong between and in them."""

from __future__ import annotations

import dataclasses
import pathlib
from collections import Counter
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from services.config import Case
from services.event_log import EventLog
from services.faults.invariants import Ladder, excursions, restless, strayed, unlogged
from services.faults.links import FaultyLink
from services.faults.nodes import FaultyController, FaultyMachine, FaultyMonitor, FaultySensors
from services.faults.schedule import COMMAND, END_S, LINKS, REPORT, SERVO, Fault, Schedule
from services.messages import BLOCK_S, Event, MachineState, OperatorRequest, SampleBlock, Tick

AIR_S = 0.3
"""Time in air before the cut: short, so that a day is."""
SIGNS_OF_LIFE = ("frozen", "dwell", "moves", "travel")
"""Reasons to reject a command that is valid all the same."""
REQUESTS = ("arm", "dry_run", "disarm", "reset", "arm", "stop")
FULL = pathlib.Path("/dev/full")


@dataclass(frozen=True, slots=True, kw_only=True)
class Day:
    """What came of a day.

    Attributes
    ----------
    schedule
        What went wrong.
    violations
        What should not have been, in words.
    reaction_ms
        Longest time without a valid command until the guard answered (ms).
    excursion
        Largest set point, speed, acceleration, jerk or step over its limit; above 1 is beyond.
    following
        Largest distance of the stage from its set point over the stated following error.
    states
        Blocks in each state of the guard.
    rejected
        Commands rejected, by reason.
    """

    schedule: Schedule
    violations: tuple[str, ...]
    reaction_ms: float
    excursion: float
    following: float
    states: dict[str, int]
    rejected: dict[str, int]


@dataclass(slots=True)
class _Shift:
    """One machine from switching on to the end, or to the power cycle."""

    machine: FaultyMachine
    ladder: Ladder
    states: list[str] = field(default_factory=list[str])
    events: list[Event] = field(default_factory=list[Event])


def live(case: Case, schedule: Schedule) -> Day:
    """Live through a day; the same schedule gives the same day, except for the tokens of its sessions.

    Parameters
    ----------
    case
        Of the cut; its time in air is shortened.
    schedule
        What goes wrong.
    """
    settings = dataclasses.replace(case.settings, air_time=AIR_S)
    limits = dataclasses.replace(case.limits, on_loss="return" if schedule.returns else "hold")
    day = _Day(dataclasses.replace(case, settings=settings, limits=limits), schedule)
    for block in range(round(END_S / BLOCK_S)):
        if not day.step(block):
            break
    return day.judge()


class _Day:
    def __init__(self, case: Case, schedule: Schedule) -> None:
        self._case, self._plan = case, schedule
        self._rng = np.random.default_rng([schedule.seed, 11])
        self._links = {name: FaultyLink(name, schedule.faults, self._rng) for name in LINKS}
        self._requests = self._asked = 0
        self._broken: list[str] = []
        self._done: list[_Shift] = []
        self._sensors = FaultySensors(schedule.faults)
        self._disk = EventLog(FULL) if self._has("full disk") and FULL.exists() else None
        self._switch_on(0.0)

    def _has(self, kind: str) -> bool:
        return any(fault.kind == kind for fault in self._plan.faults)

    def _begins(self, kind: str, block: int) -> list[Fault]:
        return [fault for fault in self._plan.faults if fault.kind == kind and fault.first == block]

    def _switch_on(self, shift: float) -> None:
        """Start a machine, and a monitor and a controller for its run."""
        run = f"run-{len(self._done)}"
        faults, case = self._plan.faults, self._case
        machine = FaultyMachine(case, self._plan.seed, run, faults, self._rng, shift)
        self._now = _Shift(machine, Ladder(case.limits))
        self._monitor = FaultyMonitor(case, run, faults)
        self._controller = FaultyController(case, run, faults, self._rng)
        self._run, self._armed = run, False

    def step(self, block: int) -> bool:
        """Let 10 ms pass; False when a node died."""
        try:
            self._operate(block)
            self._turn(block)
        except Exception as error:  # a node that dies is what is looked for; the day ends there
            self._broken.append(f"{block * BLOCK_S:.2f} s: a node died of {type(error).__name__}: {error}")
            return False
        return True

    def _operate(self, block: int) -> None:
        if self._begins("power cycle", block) and block > 0:
            where = self._now.machine.guard.shift
            self._done.append(self._now)
            self._switch_on(where)
            self._asked = block + 10
        if block == max(self._plan.arm_block, self._asked):
            self._ask("arm")
        if self._begins("operator stop", block):
            self._ask("stop")
            if self._now.machine.guard.state not in ("OFF", "FAULT"):
                self._broken.append(f"{block * BLOCK_S:.2f} s: {self._now.machine.guard.state} after `stop`")
        if any(fault.kind == "arm again" and fault.acts(block) for fault in self._plan.faults) and block % 7 == 0:
            self._ask(str(self._rng.choice(REQUESTS)))

    def _ask(self, request: Any) -> None:
        self._requests += 1
        asked = OperatorRequest(
            run=self._run, source="operator", sequence=self._requests, request=request, nonce=f"n{self._requests}"
        )
        self._note(self._now.machine.handle(asked))

    def _turn(self, block: int) -> None:
        now, machine = self._now, self._now.machine
        machine.block = block
        for command in self._links[COMMAND].take(block):
            self._command(command)
        first = machine.plant.sample
        said = machine.handle(Tick(block=block))
        self._note(said)
        now.states.append(next(m.guard_state for m in said if isinstance(m, MachineState)))
        now.ladder.block(first, machine.guard.state, machine.told[-1])
        for message in said:
            if isinstance(message, SampleBlock):
                self._links[SERVO].put(self._sensors.bend(message, block), block)
        for servo in self._links[SERVO].take(block):
            if servo.run == self._run:
                self._pass_on(self._monitor.handle(servo, block), REPORT, block)
        self._pass_on(self._monitor.due(block), REPORT, block)
        for report in self._links[REPORT].take(block):
            if report.run == self._run:
                self._pass_on(self._controller.handle(report, block), COMMAND, block)

    def _command(self, command: Any) -> None:
        """Hand a command to the machine, and note whether it counts as a sign of life."""
        machine = self._now.machine
        before, counted = machine.guard.accepted, Counter(machine.guard.rejected)
        now = machine.plant.sample
        self._note(machine.handle(command))
        more = Counter(machine.guard.rejected) - counted
        if machine.guard.accepted > before or any(more[reason] for reason in SIGNS_OF_LIFE):
            self._now.ladder.valid(now)

    def _pass_on(self, messages: list[Any], link: str, block: int) -> None:
        for message in messages:
            if not isinstance(message, Event):
                self._links[link].put(message, block)

    def _note(self, said: list[Any]) -> None:
        events = [message for message in said if isinstance(message, Event)]
        self._now.events += events
        if self._disk is not None:
            for event in events:
                self._disk.write(event)

    def judge(self) -> Day:
        """Hold what was against what must be."""
        broken, limits = self._broken, self._case.limits
        excursion = following = reaction = 0.0
        states: Counter[str] = Counter()
        rejected: Counter[str] = Counter()
        for shift in (*self._done, self._now):
            machine = shift.machine
            issued = np.concatenate(machine.issued, axis=1)
            found = excursions(issued, limits)
            worst = max(found, key=found.__getitem__)
            if found[worst] > 1.0:
                broken.append(f"{worst} at {found[worst]:.6g} of its limit")
            if machine.stood:
                away = strayed(issued[:, 1:], np.concatenate(machine.stood, axis=1), limits)
                following = max(following, away)
                if away > 1.0:
                    broken.append(f"stage {away:.3g} times the following error from its set points")
            samples = machine.issued[-1].shape[1]
            texts = restless(issued[:, 1:], shift.states, samples, limits), unlogged(shift.states, shift.events)
            broken += [*shift.ladder.broken, *filter(None, texts)]
            excursion = max(excursion, found[worst])
            reaction = max(reaction, 1e3 * shift.ladder.longest / limits.sample_rate_hz)
            states.update(shift.states)
            rejected.update(machine.guard.rejected)
        if self._disk is not None:
            self._disk.close()
            if not self._disk.failure:
                broken.append("a full disk went unnoticed")
        return Day(
            schedule=self._plan, violations=tuple(broken), reaction_ms=reaction, excursion=excursion,
            following=following, states=dict(states), rejected=dict(rejected),
        )  # fmt: skip
