"""The controller is lost in mid-cut: the same cut for a job that wants the shift held, and for one that wants it back.

Without the shift both tools are at equal pitch again, and the chatter that the shift had silenced may come back.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass
from itertools import groupby
from typing import Any

import numpy as np

from services.bus import Node
from services.clock import Clock
from services.closed_loop import Loop
from services.config import Case
from services.guard_limits import OnLoss
from services.messages import BLOCK_S, Floats, MachineState, SampleBlock, Truth

JOBS: tuple[OnLoss, ...] = ("hold", "return")
AFTER_S = 1.0
"""How long the cut goes on after T3 (s)."""
_SHARE_S = 0.3
"""Stretch over which the vibration before the loss and at the end is taken (s)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Lost:
    """A cut whose controller falls silent.

    Attributes
    ----------
    on_loss
        What the job wants.
    lost_at_s
        When the last command was heard (s).
    time_s, shift_deg, vibration_um
        Of each block: its end, the shift there, and the vibration in it (rms); shape (n,).
    states
        Of each block.
    feed_hold
        Whether the guard asks for feed hold, for each block.
    """

    on_loss: OnLoss
    lost_at_s: float
    time_s: Floats
    shift_deg: Floats
    vibration_um: Floats
    states: tuple[str, ...]
    feed_hold: tuple[bool, ...]

    def spans(self) -> list[tuple[str, float, float]]:
        """Return the states in order, each with its beginning and end (s)."""
        found: list[tuple[str, float, float]] = []
        for state, group in groupby(range(len(self.states)), key=lambda k: self.states[k]):
            blocks = list(group)
            found.append((state, blocks[0] * BLOCK_S, (blocks[-1] + 1) * BLOCK_S))
        return found

    def answer(self) -> dict[str, Any]:
        """Return it for JSON."""
        blocks = round(_SHARE_S / BLOCK_S)
        lost = round(self.lost_at_s / BLOCK_S)
        return {
            "on_loss": self.on_loss,
            "states": [{"state": state, "from_s": start, "to_s": end} for state, start, end in self.spans()],
            "feed_hold_from_s": next((k * BLOCK_S for k, asked in enumerate(self.feed_hold) if asked), None),
            "shift_before_deg": float(self.shift_deg[lost - 1]),
            "shift_after_deg": float(self.shift_deg[-1]),
            "vibration_before_um": float(self.vibration_um[lost - blocks : lost].mean()),
            "vibration_after_um": float(self.vibration_um[-blocks:].mean()),
        }


class _Silenced:
    """A controller that is heard no more from one report on."""

    def __init__(self, node: Node, last: int) -> None:
        self._node, self._last, self.subscribes = node, last, node.subscribes

    def prepare(self) -> None:
        self._node.prepare()

    def handle(self, message: Any) -> list[Any]:
        return list(self._node.handle(message)) if message.sequence < self._last else []


def lose(case: Case, seed: int, lost_at_s: float, on_loss: OnLoss, clock: Clock,
         progress: Callable[[float], None]) -> Lost:  # fmt: skip
    """Cut until some time after T3 with a controller that falls silent.

    Parameters
    ----------
    case, seed, clock
        As for `services.closed_loop.Loop`.
    lost_at_s
        When the controller falls silent (s).
    on_loss
        What the job wants.
    progress
        Told the share that is done.
    """
    limits = dataclasses.replace(case.limits, on_loss=on_loss)
    loop = Loop(dataclasses.replace(case, limits=limits), seed, clock)
    last = round(lost_at_s / BLOCK_S)
    loop.wrap("controller", lambda node: _Silenced(node, last))
    blocks = last + round((limits.loss_fault + AFTER_S) / BLOCK_S)
    for number in range(blocks):
        loop.step(number)
        progress((number + 1) / blocks)
    states = loop.tape.of(MachineState)
    return Lost(
        on_loss=on_loss, lost_at_s=last * BLOCK_S, time_s=BLOCK_S * np.arange(1, blocks + 1),
        shift_deg=np.array([block.shift_applied_deg for block in loop.tape.of(SampleBlock)]),
        vibration_um=np.array([float(np.std(truth.vibration_um)) for truth in loop.tape.of(Truth)]),
        states=tuple(state.guard_state for state in states), feed_hold=tuple(state.feed_hold for state in states),
    )  # fmt: skip
