"""The machine whose turret is moved by LinuxCNC: its guard and its path here, the motion there, the cut simulated.

The slides of the simulated lathe follow the joints of the control, read back in every servo cycle. What was read
between two ticks is the motion of the block that the second one publishes.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import msgspec
import numpy as np

from pitch import TrajectoryLimits, arc_position, offset_from_slides
from services.clock import WallClock
from services.config import Case
from services.errors import RefusalError
from services.guard import Checked, Conditions
from services.machines.linuxcnc.link import Link, Row
from services.machines.linuxcnc.settings import PATH_SPEED_DEG_PER_S
from services.machines.linuxcnc.trace import Trace
from services.messages import Event, Floats, MachineState, Message, OperatorRequest, Tick, TurretCommand
from services.nodes.machine import SOURCE, MachineNode, Panel
from turning_sim import PlantBlock

CLOCK = WallClock()
SILENT_S = 0.5
"""Without a word of the bridge for so long nothing that was read back is trusted."""
NEAR_ZERO_MM = 1e-3
MOVED_MM = 5e-5
"""Half a tenth of a micrometre: from here a joint has begun to move."""
END_S = 3.0


class LinuxcncNode(MachineNode):
    """A machine node that hands what its guard lets through to LinuxCNC.

    Parameters
    ----------
    case, seed, run
        As for `MachineNode`.
    link
        To the bridge; the control is on and homed.
    program
        Part program that is started with the first block; None: somebody else does that.
    """

    def __init__(self, case: Case, seed: int, run: str, link: Link, program: str | None = None) -> None:
        super().__init__(case, seed, run)
        link.settings.fit(case)
        self.trace = Trace()
        self.first_motion_ms: list[float] = []
        self.link, self._program, self._own = link, program, program is not None
        self._angle = float(case.drives.axis_angle)
        self._waiting: OperatorRequest | None = None
        self._base: tuple[float, float] | None = None
        self._refs = np.zeros((2, self._samples))
        self._sent = np.zeros((2, self._samples))
        self._rows: list[Row] = []
        self._ran = self._tripped = self._held = self._begun = False
        self._asked: tuple[float, int] | None = None
        self._moves: tuple[float, float] | None = None

    def prepare(self) -> None:
        """Compile the kernels, and refuse a control that stands where the offset has no room."""
        super().prepare()
        link = self.link
        link.wait(lambda: link.last is not None, "no servo cycle of LinuxCNC is seen")
        if why := link.unready():
            raise RefusalError(why)
        applied = (link.last.applied_1_mm, link.last.applied_2_mm) if link.last else ()
        if max(map(abs, applied)) > NEAR_ZERO_MM:
            raise RefusalError(f"an offset of {applied} mm is applied already: restart LinuxCNC, or clear it")
        if self._program is not None:
            link.control("load", self._program)
            link.wait(lambda: link.answered, "the program is not loaded")
        self._read()

    def handle(self, message: Tick | TurretCommand | OperatorRequest) -> list[Message]:
        """Advance by one block, or take a command or request."""
        if isinstance(message, Tick):
            self._read()
            return [*self._go_on_arming(), *super().handle(message)]
        if isinstance(message, OperatorRequest):
            if message.request == "arm" and not self.link.armed and self._guard.state == "OFF":
                return self._arm(message)
            if message.request in ("stop", "disarm"):
                self._waiting = None
        before = self._guard.requested
        answer = super().handle(message)
        if isinstance(message, TurretCommand) and self._guard.requested != before:
            self._asked = CLOCK.now(), message.apply_at_sample
        return answer

    def close(self) -> None:
        """Take the offset back and let go, if the control lets us; a frozen one stays frozen.

        A program of our own is ended for that. One that somebody else runs is not: it is left to the watchdog, which
        freezes the offset and holds the feed.
        """
        link = self.link
        try:
            if self._own:
                link.control("abort")
                link.wait(lambda: link.status["program"] == "idle" or self._lost(), "the program does not end", END_S)
            link.ask("disarm")
            link.wait(lambda: link.answered, "the offset does not go back", END_S)
        except RefusalError:
            pass
        link.close()

    def summary(self) -> dict[str, Any]:
        """Return what there is to say of the control, for JSON."""
        known = self.first_motion_ms
        return {
            "adapter": "linuxcnc", "linuxcnc": self.link.status.get("version"),
            "first_motion_ms": known, "servo_cycles": len(self.trace.rows),
            "bridge_rejected": self.link.status.get("rejected"),
        }  # fmt: skip

    def _lost(self) -> bool:
        return not self.link.alive or CLOCK.now() - self.link.heard > SILENT_S

    def _read(self) -> None:
        """Take the servo cycles since the last block as the motion of this one."""
        self._rows = rows = self.link.take()
        if not rows:
            self._refs = np.repeat(self._refs[:, -1:], self._samples, axis=1)
            return
        if self._base is None:
            first = rows[0]
            self._base = first.joint_1_mm - first.applied_1_mm, first.joint_2_mm - first.applied_2_mm
        joints = np.array([(row.joint_1_mm, row.joint_2_mm) for row in rows]).T - np.array([self._base]).T
        slides = np.array(self.link.settings.to_slides(joints[0], joints[1], self._angle))
        points = np.concatenate((self._refs[:, -1:], slides), axis=1)
        share = np.linspace(0.0, 1.0, self._samples + 1)[1:]
        grid = np.linspace(0.0, 1.0, points.shape[1])
        self._refs = np.array([np.interp(share, grid, line) for line in points])
        self._time_motion(rows)

    def _time_motion(self, rows: list[Row]) -> None:
        """Note how long it took from a command to the first motion of a joint."""
        if self._moves is None:
            return
        began, stood = self._moves
        for row in rows:
            if abs(row.joint_2_mm - stood) > MOVED_MM:
                moved = self.link.at - 1e-3 * (rows[-1].cycle - row.cycle)
                self.first_motion_ms.append(1e3 * (moved - began))
                self._moves = None
                return

    def _arm(self, request: OperatorRequest) -> list[Message]:
        """Let the bridge clear and arm the offsets again; only by an operator, with the tools out of the cut."""
        if self.link.answered:
            why = self.link.unready() or ("the tools are in the cut" if self._in_cut else "")
            if why:
                return [self._event("request_rejected", f"'arm': {why}")]
            self.link.ask("arm")
        self._waiting = request
        return []

    def _go_on_arming(self) -> list[Message]:
        """Arm the offsets before the first block, start the program then, and see to what waits for that."""
        link = self.link
        if not self._begun and link.last is not None:
            self._begun = True
            if not link.last.fault:
                link.ask("arm")
        if not (link.answered or self._lost()):
            return []
        if link.armed and self._program is not None:
            link.control("run")
            self._program = None
        request, self._waiting = self._waiting, None
        if request is None:
            return []
        if not link.armed:
            why = "the bridge says nothing" if self._lost() else link.status["why"] or link.status["bridge"]
            return [self._event("request_rejected", f"'arm': LinuxCNC: {why}")]
        self._guard.stand((0.0, 0.0, 0.0))
        self._base, self._tripped = None, False
        self._guard.request(request)
        return self._notices(request.sequence)

    def _event(self, kind: str, text: str) -> Event:
        self._events += 1
        return Event(
            run=self._run, source=SOURCE, sequence=self._events - 1, cause=0, sample=self.plant.sample, kind=kind,
            text=text,
        )  # fmt: skip

    def _conditions(self) -> Conditions:
        """Return what the guard is told: the panel is that of LinuxCNC, measured is what it applies."""
        status = self.link.status
        self._ran = self._ran or status["program"] == "runs"
        self.panel = Panel(homed=self.link.homed(), feed_hold=status["paused"], blocked=self._blocked())
        return replace(super()._conditions(), measured=self._applied(), failed=self._failed())

    def _applied(self) -> Floats:
        """Return where LinuxCNC has the turret: shift (rad), x1, y1 (m)."""
        last = self.link.last
        offsets = (last.applied_1_mm, last.applied_2_mm) if last else (0.0, 0.0)
        x1, y1 = self.link.settings.to_slides(*offsets, self._angle)
        shift = arc_position(offset_from_slides(x1, y1, self._angle), self.plant.diameter).shift
        return np.array([shift, x1, y1])

    def _blocked(self) -> str:
        status = self.link.status
        if not self.link.armed and self._begun and not self._tripped:  # who tripped it has said why
            return "the offsets of LinuxCNC are not armed"
        return "no program runs on LinuxCNC any more" if self._ran and status["program"] == "idle" else ""

    def _failed(self) -> str:
        """Return why nothing can be moved any more, empty if it can."""
        if self._lost():
            return "the bridge to LinuxCNC has ended" if not self.link.alive else "the bridge to LinuxCNC is silent"
        last = self.link.last
        if last is None or not last.fault or not self.link.answered or self.link.status["bridge"] == "idle":
            return ""
        if not last.enabled:
            stopped = self.link.status["estop"]
            return f"LinuxCNC: {'emergency stop' if stopped else 'the machine was switched off'}, the offset is frozen"
        if last.limited:
            return "LinuxCNC: the offset met a soft limit and was cut short, it is frozen"
        return "LinuxCNC: no sign of life reached the servo thread in time, the offset is frozen"

    def _drive(self, checked: Checked) -> PlantBlock:
        """Send the set points on, and cut with the motion that was read back."""
        settings, guard, n = self.link.settings, self._guard, self._samples
        first, second = settings.to_axes(checked.x1, checked.y1, self._angle)
        step = round(n * 0.001 / (n / self._rate))
        over = n / self._rate
        self.link.tell(do="move", x=first[step - 1 :: step].tolist(), y=second[step - 1 :: step].tolist(), over_s=over)
        self._oversee()
        if self._asked is not None and guard.target == guard.requested:
            asked, due = self._asked
            self._asked = None
            late = due <= self.plant.sample - n
            last = self.link.last
            self._moves = (asked if late else CLOCK.now(), last.joint_2_mm if last else 0.0)
        plant = self.plant.advance(*self._refs)
        simulated = np.array((plant.x1_stage_position, plant.y1_stage_position))
        number = plant.first_sample // n
        applied = [settings.to_slides(row.applied_1_mm, row.applied_2_mm, self._angle) for row in self._rows]
        self.trace.add(number, self._rows, self._sent, np.array(applied).reshape(-1, 2).T, simulated)
        self._sent = np.array((checked.x1, checked.y1))
        return plant

    def _oversee(self) -> None:
        """Pass on what the guard asks of the control: feed hold, and at a fault the latched freeze."""
        guard = self._guard
        if guard.feed_inhibit_requested and not self._tripped and self.link.armed:
            self._tripped = self.link.tell(do="trip")
        hold = guard.feed_hold_requested or guard.feed_inhibit_requested  # the freeze comes one watchdog later
        if hold != self._held:
            self._held = hold
            self.link.tell(do="hold", on=hold)

    def _path_limits(self, speed: float | None) -> TrajectoryLimits:
        limits = super()._path_limits(speed)
        return replace(limits, max_speed=min(limits.max_speed, math.radians(PATH_SPEED_DEG_PER_S)))

    def _state(self, number: int, plant: PlantBlock) -> list[Message]:
        """Say where LinuxCNC has the turret, not where the simulation has it."""
        shift, x1, y1 = self._applied()
        return [
            msgspec.structs.replace(
                state, shift_applied_deg=math.degrees(shift), slide_x1_um=1e6 * float(x1), slide_y1_um=1e6 * float(y1),
            ) if isinstance(state, MachineState) else state
            for state in super()._state(number, plant)
        ]  # fmt: skip
