"""The loop in one process: the nodes in lockstep on a bus in memory, and the uncontrolled twin beside them."""

from __future__ import annotations

import uuid
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from services.bus import InMemoryBus, Node
from services.clock import Clock
from services.config import Case
from services.doubts import refusing
from services.messages import (
    BLOCK_S,
    ChatterReport,
    ForceBlock,
    MachineState,
    OperatorRequest,
    SampleBlock,
    Tick,
    Truth,
)
from services.metrics import SUMMARY_KEYS, Summary
from services.nodes.controller import ControllerNode
from services.nodes.machine import MachineNode, make_plant
from services.nodes.monitor import MonitorNode
from services.record import RunRecord
from services.tape import Tap, Tape, controlled_series, evaluate, make_record, plant_surface, tape_surface, twin_series
from turning_sim import PlantBlock, Simulator, slides_of_shift

Progress = Callable[[float], None]
_EACH_TURN = (MachineState, SampleBlock, Truth, ForceBlock, ChatterReport)


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """A finished (or interrupted) run."""

    record: RunRecord
    summary: Summary


def _silent(_: float) -> None:
    pass


def blocks_of(case: Case) -> int:
    """Return how many blocks a case lasts."""
    return round((case.settings.air_time + case.settings.cut_time) / BLOCK_S)


def run_case(
    case: Case,
    seed: int,
    clock: Clock,
    *,
    arm_after_s: float | None = 0.0,
    progress: Progress = _silent,
    advise_only: bool = False,
) -> Outcome:
    """Run the loop of a case and its twin, and evaluate both; Ctrl-C ends it early with what was seen.

    Parameters
    ----------
    case
        The case.
    seed
        Of the plant's noise; the twin has the same.
    clock
        For the latency and the speed of the loop; nothing else depends on it.
    arm_after_s
        When the guard is armed (s), None for never; later than the entry lets the chatter grow first.
    progress
        Told the share that is done, 0...1.
    advise_only
        Whether the controller only says what it would command.
    """
    tape, interrupted = run_loop(
        case, seed, clock, arm_after_s=arm_after_s, progress=progress, advise_only=advise_only
    )
    return judge(case, seed, tape, interrupted=interrupted)


def run_loop(
    case: Case,
    seed: int,
    clock: Clock,
    *,
    arm_after_s: float | None = 0.0,
    progress: Progress = _silent,
    advise_only: bool = False,
) -> tuple[Tape, bool]:
    """Run the loop alone; returns what was said and whether Ctrl-C ended it early. Arguments as in `run_case`."""
    loop = Loop(case, seed, clock, arm_after_s, advise_only=advise_only)
    blocks = blocks_of(case)
    try:
        with refusing(case, SUMMARY_KEYS):
            for number in range(blocks):
                loop.step(number)
                progress((number + 1) / blocks)
    except KeyboardInterrupt:
        return loop.tape, True
    return loop.tape, False


def judge(case: Case, seed: int, tape: Tape, *, interrupted: bool) -> Outcome:
    """Cut the twin and evaluate what is on the tape beside it."""
    tape = whole_blocks(tape)
    samples = tape.series(SampleBlock, "dx1_um").size
    with refusing(case, SUMMARY_KEYS):
        block = open_loop(case, make_plant(case, seed), samples)
    surface, twin = tape_surface(case, tape), plant_surface(case, block)
    cuts = controlled_series(case, tape, surface), twin_series(case, block, twin)
    record = make_record(case, seed, tape, *cuts, interrupted=interrupted)
    return Outcome(record=record, summary=evaluate(record, surface, twin))


def whole_blocks(tape: Tape) -> Tape:
    """Return the tape with only those turns in which every node was heard, in order and once.

    The last turn may have been interrupted; turns missing between others were lost on the way here, and are counted.
    """
    turns = [{m.sequence: m for m in reversed(tape.of(kind))} for kind in _EACH_TURN]
    kept = sorted(set(turns[0]).intersection(*turns[1:]))
    messages = dict(tape.messages)
    for kind, said in zip(_EACH_TURN, turns, strict=True):
        messages[kind] = [said[number] for number in kept]
    lost = kept[-1] - kept[0] + 1 - len(kept) if kept else 0
    return Tape(
        messages=messages,
        log=tape.log,
        latency_ms=tape.latency_ms,
        wall_s=tape.wall_s,
        blocks_lost=max(tape.blocks_lost, lost),
    )


def open_loop(case: Case, plant: Simulator, samples: int, shift: float = 0.0) -> PlantBlock:
    """Advance a plant whose turret stands at one shift (rad)."""
    x1, y1 = slides_of_shift(shift, plant.diameter, case.drives.axis_angle)
    return plant.advance(np.full(samples, float(x1)), np.full(samples, float(y1)))


class Loop:
    """The three nodes on one bus, with a tape of everything and the wall time of each turn.

    Parameters
    ----------
    case, seed
        As in `run_case`.
    clock
        For latency and speed.
    arm_after_s
        When the guard is asked (s), None for never.
    advise_only
        Whether the controller only says what it would command.
    request
        What is asked of the guard.
    """

    def __init__(
        self,
        case: Case,
        seed: int,
        clock: Clock,
        arm_after_s: float | None = 0.0,
        *,
        advise_only: bool = False,
        request: Literal["arm", "dry_run"] = "arm",
    ) -> None:
        run = str(uuid.uuid4())
        self.machine = MachineNode(case, seed, run)
        self.monitor = MonitorNode(case, run)
        self.controller = ControllerNode(case, run, advise_only)
        self._nodes: dict[str, Node] = {
            "machine": self.machine, "monitor": self.monitor, "controller": self.controller,
        }  # fmt: skip
        self._clock, self._tap = clock, Tap(clock)
        self._bus = InMemoryBus(self._nodes.values(), tap=self._tap)
        self._arm_block = None if arm_after_s is None else round(arm_after_s / BLOCK_S)
        self._arm = OperatorRequest(run=run, source="operator", sequence=0, request=request, nonce=uuid.uuid4().hex)
        for node in self._nodes.values():
            node.prepare()

    @property
    def tape(self) -> Tape:
        """What was said so far; another tape may be put in its place."""
        return self._tap.tape

    @tape.setter
    def tape(self, tape: Tape) -> None:
        self._tap.tape = tape

    def wrap(self, name: str, wrapper: Callable[[Node], Node]) -> None:
        """Put something between a node and the bus, such as a fault."""
        self._nodes[name] = wrapper(self._nodes[name])
        self._bus = InMemoryBus(self._nodes.values(), tap=self._tap)

    def step(self, number: int) -> None:
        """Let 10 ms pass."""
        begin = self._clock.now()
        if number == self._arm_block:
            self._bus.publish(self._arm)
        self._bus.publish(Tick(block=number))
        self.tape.wall_s += self._clock.now() - begin
        self.tape.blocks_lost = self.monitor.blocks_lost
