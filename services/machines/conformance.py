"""Does an adapter keep the contract? Tried on the adapter itself, from boot to fault and back, in air.

Twelve findings; each names what was expected and what came. The machine moves by a degree (0.2 mm on a 25 mm bar).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from services.config import Case
from services.doctor import Finding
from services.machines.contract import Machine
from services.messages import BLOCK_S, Event, MachineState, Message, OperatorRequest, SampleBlock, Tick, TurretCommand

GOAL_DEG, NEAR_DEG = 1.0, 0.05
ARMING_S, MOVE_S = 3.0, 1.5
RUN = "conformance"


class Trial:
    """Speaks to a machine as controller and operator would.

    Parameters
    ----------
    machine
        Prepared.
    case
        Its case.
    pace
        Called before each tick; returns when it is time for it.
    """

    def __init__(self, machine: Machine, case: Case, pace: Callable[[], None]) -> None:
        self._machine, self._case, self._pace = machine, case, pace
        self.block = self._sequence = self._nonce = 0
        self.states: list[MachineState] = []
        self.servo: list[SampleBlock] = []
        self.events: list[Event] = []

    @property
    def state(self) -> MachineState:
        """The last one."""
        return self.states[-1]

    def tick(self, count: int = 1, shift_deg: float | None = None) -> None:
        """Let blocks pass, with a command before each if a shift is given."""
        for _ in range(count):
            self._pace()
            if shift_deg is not None:
                self.command(shift_deg)
            self._keep(self._machine.handle(Tick(block=self.block)))
            self.block += 1

    def until(self, holds: Callable[[], bool], seconds: float, shift_deg: float | None = None) -> bool:
        """Let blocks pass until something holds; returns whether it did."""
        for _ in range(round(seconds / BLOCK_S)):
            if holds():
                return True
            self.tick(1, shift_deg)
        return holds()

    def command(self, shift_deg: float, **changes: Any) -> None:
        """Command a shift as of now."""
        now = self.block * round(BLOCK_S * self._case.settings.sample_rate_hz)
        self._sequence += 1
        plain: dict[str, Any] = {
            "run": RUN, "source": "controller", "sequence": self._sequence, "cause": self.block - 1,
            "session": self.state.session if self.states else "", "shift_deg": shift_deg, "order": 0,
            "action": "move", "issued_sample": now, "apply_at_sample": now, "expires_at_sample": now + 900,
            "reason": "conformance",
        }  # fmt: skip
        self._keep(self._machine.handle(TurretCommand(**(plain | changes))))

    def ask(self, request: Any) -> None:
        """Ask as the operator."""
        self._nonce += 1
        said = OperatorRequest(
            run=RUN, source="operator", sequence=self._nonce, request=request, nonce=f"conformance-{self._nonce}"
        )
        self._keep(self._machine.handle(said))

    def reaches(self, *states: str, seconds: float, shift_deg: float | None = None) -> bool:
        """Whether the guard reaches one of some states in time."""
        return self.until(lambda: self.state.guard_state in states, seconds, shift_deg)

    def _keep(self, messages: list[Message]) -> None:
        for message in messages:
            if isinstance(message, MachineState):
                self.states.append(message)
            elif isinstance(message, SampleBlock):
                self.servo.append(message)
            elif isinstance(message, Event):
                self.events.append(message)


def conformance(machine: Machine, case: Case, pace: Callable[[], None] = lambda: None) -> list[Finding]:
    """Try an adapter, and return what was found.

    Parameters
    ----------
    machine
        Made for run `RUN`; prepared here.
    case
        Its case.
    pace
        Waits for the next 10 ms of a machine that lives in real time.
    """
    found: list[Finding] = []

    def see(name: str, ok: bool, detail: str) -> None:
        found.append(Finding(name=name, ok=ok, detail=detail))

    see("hears", {Tick, TurretCommand, OperatorRequest} <= set(machine.subscribes), "ticks, commands, requests")
    machine.prepare()
    trial = Trial(machine, case, pace)
    trial.tick(10)
    _publishes(trial, case, see)
    _stands_off(trial, see)
    trial.ask("arm")
    see("arms", trial.reaches("ACTIVE", seconds=ARMING_S) and bool(trial.state.session), _where(trial))
    _moves(trial, see)
    _refuses(trial, case, see)
    _loses(trial, case, see)
    return found


See = Callable[[str, bool, str], None]


def _where(trial: Trial) -> str:
    state = trial.state
    return f"guard {state.guard_state}, shift {state.shift_applied_deg:.3f} deg; {state.reason}"


def _publishes(trial: Trial, case: Case, see: See) -> None:
    n = round(BLOCK_S * case.settings.sample_rate_hz)
    firsts = [block.first_sample for block in trial.servo]
    each = len(trial.servo) == len(trial.states) == trial.block
    see("one block and one state each tick", each, f"{len(trial.servo)} blocks, {len(trial.states)} states")
    see("contiguous", firsts == [n * k for k in range(len(firsts))], f"first samples {firsts[:3]}..., {n} a block")
    series = [
        getattr(block, name) for block in trial.servo for name in block.__struct_fields__
        if isinstance(getattr(block, name), np.ndarray)
    ]  # fmt: skip
    whole = bool(series) and all(s.shape == (n,) and bool(np.isfinite(s).all()) for s in series)
    see("finite", whole, f"{len(series)} series of {n} finite samples")


def _stands_off(trial: Trial, see: See) -> None:
    see("boots OFF", trial.states[0].guard_state == "OFF", trial.states[0].guard_state)
    trial.tick(20, shift_deg=GOAL_DEG)
    state = trial.state
    still = abs(state.shift_applied_deg) < NEAR_DEG and state.commands_accepted == 0 and state.commands_rejected > 0
    see("takes no command while OFF", still, f"{state.commands_rejected} rejected; {_where(trial)}")


def _moves(trial: Trial, see: See) -> None:
    def there() -> bool:
        return abs(trial.state.shift_applied_deg - GOAL_DEG) < NEAR_DEG

    begun = trial.block
    arrived = trial.until(there, MOVE_S, GOAL_DEG)
    see("goes where it is commanded", arrived, f"{(trial.block - begun) * 10} ms; {_where(trial)}")
    trial.tick(30, GOAL_DEG)
    off_um = abs(trial.state.slide_y1_um - trial.states[-2].slide_y1_um)
    see("comes to rest", there() and off_um < 1.0, f"{off_um:.3f} um in the last 10 ms; {_where(trial)}")


def _refuses(trial: Trial, case: Case, see: See) -> None:
    before = trial.state.commands_rejected
    wrong: tuple[dict[str, Any], ...] = (
        {"shift_deg": 2.0 * math.degrees(case.limits.target)}, {"shift_deg": math.nan}, {"run": "another"},
        {"source": "somebody"}, {"session": "stale"}, {"expires_at_sample": 0},
    )  # fmt: skip
    for change in wrong:
        trial.command(change.get("shift_deg", 0.5), **{k: v for k, v in change.items() if k != "shift_deg"})
    trial.tick(10, GOAL_DEG)
    rejected = trial.state.commands_rejected - before
    still = abs(trial.state.shift_applied_deg - GOAL_DEG) < NEAR_DEG
    see("refuses what is not meant for it", rejected == len(wrong) and still, f"{rejected} of {len(wrong)} rejected")


def _loses(trial: Trial, case: Case, see: See) -> None:
    holds = trial.reaches("HOLDING", seconds=2.0 * case.limits.loss_hold)
    shift = trial.state.shift_applied_deg
    faults = trial.reaches("FAULT", seconds=1.5 * case.limits.loss_fault)
    drift = abs(trial.state.shift_applied_deg - shift)
    ok = holds and faults and drift < NEAR_DEG
    see("holds, then gives up, without commands", ok, f"moved {drift:.4f} deg meanwhile; {_where(trial)}")
    trial.ask("arm")
    trial.tick(5, GOAL_DEG)
    latched = trial.state.guard_state == "FAULT"
    trial.ask("reset")
    trial.tick(2)
    see("goes on only after a reset", latched and trial.state.guard_state == "OFF", _where(trial))
