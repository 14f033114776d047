"""A machine through the real nodes, block by block: the simulated one of a case, or whatever an adapter reaches."""

from __future__ import annotations

import uuid
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, ExitStack
from dataclasses import dataclass
from typing import Any, Literal, Self

from services.bus import InMemoryBus, Node
from services.config import Case
from services.machines.adapters import Choice, open_machine
from services.messages import BLOCK_S, MachineState, Message, OperatorRequest, SampleBlock, Tick, TurretCommand
from services.nodes.controller import ControllerNode
from services.nodes.monitor import MonitorNode
from services.tape import Tape

MakeMachine = Callable[[Case, int, str], AbstractContextManager[Node]]
"""From case, seed and run to a node that answers each `Tick` with a block, for as long as it is held."""
GRANTED_S, AGAIN_S = 6.0, 2.0
"""How long a request may take, and how often it is repeated meanwhile."""
REACHED = {"arm": "ACTIVE", "dry_run": "ARMED"}


def simulated(case: Case, seed: int, run: str) -> AbstractContextManager[Node]:
    """Return the simulated machine of a case."""
    return open_machine(Choice(), case, seed, run)


def _at_once() -> None:
    """Wait for nobody, as a simulated machine does."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Place:
    """Where the machine is.

    Attributes
    ----------
    make
        Opens it.
    pace
        Waits for the next 10 ms of a machine that lives in real time.
    """

    make: MakeMachine = simulated
    pace: Callable[[], None] = _at_once


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
        When to go, and when to come back, in blocks after the guard was armed.

    Attributes
    ----------
    armed
        First block with the guard armed, None before.
    """

    __test__ = False
    subscribes = (SampleBlock,)

    def __init__(self, case: Case, run: str, shift_deg: float, out_block: int, back_block: int) -> None:
        self._run, self._shift, self._out, self._back = run, shift_deg, out_block, back_block
        self.armed: int | None = None
        block = round(BLOCK_S * case.settings.sample_rate_hz)
        self._apply, self._expire = case.settings.apply_after_blocks * block, case.settings.expires_after_blocks * block

    def prepare(self) -> None:
        """Nothing to compile."""

    def handle(self, message: SampleBlock) -> list[Message]:
        """Return the command of a block."""
        if message.guard_state in ("OFF", "FAULT"):
            return []
        if self.armed is None:
            self.armed = message.sequence
        since = message.sequence - self.armed
        away = self._out <= since < self._back
        first = message.first_sample
        return [
            TurretCommand(
                run=self._run, source="controller", sequence=message.sequence, cause=message.sequence,
                session=message.session, shift_deg=self._shift if away else 0.0, order=0,
                action="move" if since in (self._out, self._back) else "hold",
                issued_sample=first + len(message.x1_thrust_n), apply_at_sample=first + self._apply,
                expires_at_sample=first + self._expire, reason="test shift",
            )
        ]  # fmt: skip


class Lockstep:
    """Machine, and whoever listens, on a bus in memory with a tape of everything; held while it is used.

    Parameters
    ----------
    case, seed
        Of the machine.
    place
        Where it is.
    advise_only
        Whether the controller only says what it would command.
    test_shift
        `(shift_deg, out_block, back_block)` to put a `TestShift` in the place of monitor and controller.
    """

    def __init__(
        self, case: Case, seed: int, place: Place, *, advise_only: bool = False,
        test_shift: tuple[float, int, int] | None = None,
    ) -> None:  # fmt: skip
        self.run, self.tape = str(uuid.uuid4()), Tape()
        self._case, self._seed, self._place = case, seed, place
        self.monitor = MonitorNode(case, self.run)
        self.shifter = None if test_shift is None else TestShift(case, self.run, *test_shift)
        self._followers: Sequence[Node] = (self.monitor, ControllerNode(case, self.run, advise_only))
        if self.shifter is not None:
            self._followers = (self.shifter,)
        self._stack, self._block, self._asked = ExitStack(), 0, 0

    def __enter__(self) -> Self:
        """Open the machine."""
        with ExitStack() as stack:
            for node in self._followers:
                node.prepare()
            machine = stack.enter_context(self._place.make(self._case, self._seed, self.run))
            machine.prepare()
            self._bus = InMemoryBus((machine, *self._followers), tap=self._keep)
            self._stack = stack.pop_all()
        return self

    def __exit__(self, *_: object) -> None:
        """Let go of the machine."""
        self._stack.close()

    def _keep(self, message: Any) -> None:
        if not isinstance(message, Tick):
            self.tape.add(message)

    def reach(self, request: Literal["arm", "dry_run"]) -> bool:
        """Ask the guard until it grants it, and return whether it did."""
        for block in range(round(GRANTED_S / BLOCK_S)):
            if block % round(AGAIN_S / BLOCK_S) == 0:
                self._ask(request)
            states: list[MachineState] = self.go(BLOCK_S).of(MachineState)
            if states and states[-1].guard_state == REACHED[request]:
                return True
        return False

    def _ask(self, request: Literal["arm", "dry_run"]) -> None:
        self._asked += 1
        nonce = uuid.uuid4().hex
        self._bus.publish(
            OperatorRequest(run=self.run, source="operator", sequence=self._asked, request=request, nonce=nonce)
        )

    def go(self, seconds: float) -> Tape:
        """Let time pass (s), and return all that was said."""
        for _ in range(round(seconds / BLOCK_S)):
            self._place.pace()
            self._bus.publish(Tick(block=self._block))
            self._block += 1
        return self.tape
