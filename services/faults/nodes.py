"""A machine, a monitor and a controller that something goes wrong with."""

from __future__ import annotations

import math
from collections import deque
from typing import Any

import msgspec
import numpy as np

from services.config import Case
from services.faults.schedule import Fault
from services.guard import Checked, Conditions, Plan
from services.messages import ChatterReport, Event, Floats, SampleBlock, TurretCommand
from services.nodes.controller import ControllerNode
from services.nodes.machine import MachineNode
from services.nodes.monitor import MonitorNode
from turning_sim import PlantBlock

_POSITIONS = ("x1_motor_position_m", "x1_stage_position_m", "y1_motor_position_m", "y1_stage_position_m")
_COUNT_M = 1e-7
"""Ten counts of a coarse scale."""


class FaultyMachine(MachineNode):
    """The machine with whatever is wrong about it, and a witness of all that left its guard.

    Parameters
    ----------
    case, seed, run, initial_shift
        As for `MachineNode`.
    faults
        Of the day.
    rng
        For what has to be drawn.

    Attributes
    ----------
    block
        Present block, set from outside before each tick.
    issued, stood
        Set points that left the guard, and where the stage truly was, a piece of shape (3, n) for each block.
    told
        What the guard was told, and what it then asked the path for, for each block.
    """

    def __init__(
        self, case: Case, seed: int, run: str, faults: tuple[Fault, ...], rng: np.random.Generator,
        initial_shift: float = 0.0,
    ) -> None:  # fmt: skip
        super().__init__(case, seed, run, initial_shift)
        self._faults, self._rng = faults, rng
        self.block = 0
        self.issued: list[Floats] = [self._measured[:, None]]
        self.stood: list[Floats] = []
        self.told: list[Conditions] = []
        self._stuck: Floats | None = None

    @property
    def guard(self) -> Any:
        """The guard, to be looked at."""
        return self._guard

    def _acts(self, kind: str) -> bool:
        return any(fault.kind == kind and fault.acts(self.block) for fault in self._faults)

    def _conditions(self) -> Conditions:
        given = super()._conditions()
        changes: dict[str, Any] = {}
        if self._acts("spindle override"):
            changes["spindle_hz"] = 4.0 * self._case.limits.spindle_hz_max
        if self._acts("tool leaves the cut"):
            changes["in_cut"] = False
        if self._acts("feed hold"):
            changes["feed_hold"] = True
        if self._acts("tool change"):
            changes["blocked"] = "tool change"
        if self._acts("not homed"):
            changes["homed"] = False
        if self._acts("stuck scale"):
            self._stuck = given.measured if self._stuck is None else self._stuck
            changes["measured"] = self._stuck
        known = {name: getattr(given, name) for name in Conditions.__dataclass_fields__}
        self.told.append(Conditions(**(known | changes)))
        return self.told[-1]

    def _follow(self, plan: Plan, n: int) -> tuple[Any, Any, Any]:
        path = super()._follow(plan, n)
        if not self._acts("bad path"):
            return path
        points = np.array(path, dtype=np.float64)
        bent = (points * np.nan, points + 50e-3, points * 1000.0 + 1e-4, -points - 1e-5, points[:, 1:], points + 1e9)
        return tuple(bent[int(self._rng.integers(len(bent)))])  # pyright: ignore[reportReturnType]

    def _drive(self, checked: Checked) -> PlantBlock:
        plant = super()._drive(checked)
        self.issued.append(np.array(checked[:3]))
        self.stood.append(np.array([plant.shift, plant.x1_stage_position, plant.y1_stage_position]))
        return plant


class FaultySensors:
    """Bends what the machine's sensors say before the monitor hears it."""

    def __init__(self, faults: tuple[Fault, ...]) -> None:
        self._faults = faults
        self._held: dict[str, float] = {}

    def bend(self, block: SampleBlock, number: int) -> SampleBlock:
        """Return the block as a broken sensor tells it."""
        changes: dict[str, Any] = {}
        for fault in self._faults:
            if not fault.acts(number):
                continue
            for name in _POSITIONS:
                seen: Floats = changes.get(name, getattr(block, name))
                if fault.kind == "stuck encoder":
                    changes[name] = np.full_like(seen, self._held.setdefault(name, float(seen[0])))
                elif fault.kind == "quantisation x10":
                    changes[name] = _COUNT_M * np.rint(seen / _COUNT_M)
                elif fault.kind == "force sign flipped":
                    changes[name] = -seen
                elif fault.kind == "units x1000":
                    changes[name] = 1e3 * seen
        return msgspec.structs.replace(block, **changes) if changes else block


class FaultyMonitor:
    """The monitor when it stops, is slow, repeats itself, says NaN or another frequency."""

    def __init__(self, case: Case, run: str, faults: tuple[Fault, ...]) -> None:
        self._node, self._faults = MonitorNode(case, run), faults
        self._late: deque[tuple[int, list[Any]]] = deque()
        self._last: ChatterReport | None = None

    def prepare(self) -> None:
        """Compile."""
        self._node.prepare()

    def handle(self, block: SampleBlock, number: int) -> list[ChatterReport | Event]:
        """Return the reports and events that leave it in this block."""
        acting = {fault.kind: fault for fault in self._faults if fault.acts(number)}
        said: list[Any] = []
        if "estimator stopped" not in acting:
            said = [m for m in self._node.handle(block) if isinstance(m, ChatterReport | Event)]
        said = [self._bend(message, acting) if isinstance(message, ChatterReport) else message for message in said]
        slow = acting.get("estimator slow")
        self._late.append((number + (slow.delay if slow else 0), said))
        return self.due(number)

    def due(self, number: int) -> list[ChatterReport | Event]:
        """Return what it has kept back until this block."""
        out: list[Any] = []
        while self._late and self._late[0][0] <= number:
            out += self._late.popleft()[1]
        return out

    def _bend(self, report: ChatterReport, acting: dict[str, Fault]) -> ChatterReport:
        if "estimator NaN" in acting:
            nan = math.nan
            report = msgspec.structs.replace(
                report, indicator=nan, limit=nan, frequency_hz=nan, amplitude_n=nan, state="chatter"
            )
        if "frequency hop" in acting and report.frequency_hz is not None:
            report = msgspec.structs.replace(report, frequency_hz=report.frequency_hz + 38.0)
        if "estimator frozen" in acting and self._last is not None:
            same = ("state", "indicator", "frequency_hz", "amplitude_n", "shift_applied_deg", "shift_requested_deg")
            return msgspec.structs.replace(report, **{name: getattr(self._last, name) for name in same})
        self._last = report
        return report


class FaultyController:
    """The controller, a second one, a forger, or whoever else can put a command."""

    def __init__(self, case: Case, run: str, faults: tuple[Fault, ...], rng: np.random.Generator) -> None:
        self._node, self._faults, self._rng, self._run = ControllerNode(case, run), faults, rng, run
        self._said: list[TurretCommand] = []

    def prepare(self) -> None:
        """Compile."""
        self._node.prepare()

    def handle(self, report: ChatterReport, number: int) -> list[TurretCommand | Event]:
        """Return the commands and events that follow from a report."""
        acting = {fault.kind: fault for fault in self._faults if fault.acts(number)}
        if "controller lost" in acting:
            return []
        out: list[Any] = []
        for message in self._node.handle(report):
            if not isinstance(message, TurretCommand):
                out.append(message)
                continue
            self._said.append(message)
            if "wrong order" in acting:
                turns = 360.0 / 33.0  # another whole wave round the bar
                message = msgspec.structs.replace(message, shift_deg=message.shift_deg + turns, order=3)
            if "clock jump" in acting:
                message = self._moved(message)
            out.append(message)
            if "two commanders" in acting:
                out.append(msgspec.structs.replace(message, shift_deg=float(self._rng.uniform(-4.0, 4.0))))
            if "replayed commands" in acting:
                out.append(self._said[int(self._rng.integers(len(self._said)))])
            if "forged commands" in acting:
                out += [self._forged(message) for _ in range(3)]
        return out

    def _moved(self, command: TurretCommand) -> TurretCommand:
        jump = int(self._rng.choice([-32_400_000, -900, 900, 32_400_000]))
        names = ("issued_sample", "apply_at_sample", "expires_at_sample")
        return msgspec.structs.replace(command, **{name: getattr(command, name) + jump for name in names})

    def _forged(self, like: TurretCommand) -> TurretCommand:
        """Make a command by somebody who knows nearly everything; sometimes everything but the limits."""
        rng = self._rng
        wild = (math.nan, math.inf, 1e9, -50.0, 6.5, 359.9, 4.99, float(rng.uniform(-5.0, 5.0)), 1e-300)
        changes: dict[str, Any] = {"shift_deg": wild[int(rng.integers(len(wild)))]}
        for name, value in (
            ("sequence", like.sequence + int(rng.integers(-5, 6))), ("run", "another run"), ("session", ""),
            ("source", "dashboard"), ("apply_at_sample", like.apply_at_sample - int(rng.integers(0, 10_000))),
            ("expires_at_sample", 2**62), ("issued_sample", -1), ("version", 99),
        ):  # fmt: skip
            if rng.random() < 0.25:
                changes[name] = value
        return msgspec.structs.replace(like, **changes)
