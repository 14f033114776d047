"""The machine of a case through its real nodes, block by block; another machine may be put in its place."""

from __future__ import annotations

import uuid
from collections.abc import Callable, Sequence
from typing import Literal

from services.bus import InMemoryBus, Node
from services.config import Case
from services.messages import BLOCK_S, Message, OperatorRequest, SampleBlock, Tick, TurretCommand
from services.nodes.controller import ControllerNode
from services.nodes.machine import MachineNode
from services.nodes.monitor import MonitorNode
from services.tape import Tape

MakeMachine = Callable[[Case, int, str], Node]
"""From case, seed and run to a node that answers each `Tick` with a block."""


def simulated(case: Case, seed: int, run: str) -> Node:
    """Return the simulated machine of a case."""
    return MachineNode(case, seed, run)


class TestShift:
    """In the place of the controller: stands, goes to one shift, stands there, and comes back.

    Parameters
    ----------
    case
        For the timing of commands.
    run
        Identifier of the run.
    shift_deg
        Where to go (deg).
    out_block, back_block
        When to go, and when to come back.
    """

    __test__ = False
    subscribes = (SampleBlock,)

    def __init__(self, case: Case, run: str, shift_deg: float, out_block: int, back_block: int) -> None:
        self._run, self._shift, self._out, self._back = run, shift_deg, out_block, back_block
        block = round(BLOCK_S * case.settings.sample_rate_hz)
        self._apply, self._expire = case.settings.apply_after_blocks * block, case.settings.expires_after_blocks * block

    def prepare(self) -> None:
        """Nothing to compile."""

    def handle(self, message: SampleBlock) -> list[Message]:
        """Return the command of a block."""
        if message.guard_state in ("OFF", "FAULT"):
            return []
        away = self._out <= message.sequence < self._back
        first = message.first_sample
        return [
            TurretCommand(
                run=self._run, source="controller", sequence=message.sequence, cause=message.sequence,
                session=message.session, shift_deg=self._shift if away else 0.0, order=0,
                action="move" if message.sequence in (self._out, self._back) else "hold",
                issued_sample=first + len(message.x1_thrust_n), apply_at_sample=first + self._apply,
                expires_at_sample=first + self._expire, reason="test shift",
            )
        ]  # fmt: skip


class Lockstep:
    """Machine, and whoever listens, on a bus in memory with a tape of everything.

    Parameters
    ----------
    case, seed
        Of the machine.
    make
        Makes the machine.
    advise_only
        Whether the controller only says what it would command.
    test_shift
        `(shift_deg, out_block, back_block)` to put a `TestShift` in the place of monitor and controller.
    """

    def __init__(
        self, case: Case, seed: int, make: MakeMachine, *, advise_only: bool = False,
        test_shift: tuple[float, int, int] | None = None,
    ) -> None:  # fmt: skip
        self.run, self.tape = str(uuid.uuid4()), Tape()
        self.monitor = MonitorNode(case, self.run)
        followers: Sequence[Node] = (self.monitor, ControllerNode(case, self.run, advise_only))
        if test_shift is not None:
            followers = (TestShift(case, self.run, *test_shift),)
        nodes = (make(case, seed, self.run), *followers)
        for node in nodes:
            node.prepare()
        self._bus = InMemoryBus(nodes, tap=lambda m: None if isinstance(m, Tick) else self.tape.add(m))

    def ask(self, request: Literal["arm", "dry_run", "disarm"]) -> None:
        """Ask something of the guard."""
        self._bus.publish(
            OperatorRequest(run=self.run, source="operator", sequence=0, request=request, nonce=uuid.uuid4().hex)
        )

    def go(self, seconds: float) -> Tape:
        """Let time pass (s) from the first block on, and return what was said."""
        for number in range(round(seconds / BLOCK_S)):
            self._bus.publish(Tick(block=number))
        return self.tape
