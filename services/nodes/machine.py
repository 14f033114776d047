"""The machine: guard, path of the shift and plant behind the same messages that a real lathe would exchange."""

from __future__ import annotations

import math
import secrets
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pitch import ShiftTrajectory, TrajectoryLimits, slide_set_points
from services.config import Case
from services.guard import Checked, Conditions, Guard, Plan
from services.messages import (
    BLOCK_S,
    Event,
    MachineState,
    Message,
    OperatorRequest,
    SampleBlock,
    Tick,
    Truth,
    TurretCommand,
)
from turning_sim import PlantBlock, Simulator

SOURCE = "machine"


def make_plant(case: Case, seed: int, initial_shift: float = 0.0, air_time: float | None = None) -> Simulator:
    """Return the plant of a case at rest, before its first sample; another time in air (s) may be wanted."""
    settings = case.settings
    return Simulator(
        workpiece=case.workpiece,
        cutting=case.cutting,
        drives=case.drives,
        sample_rate_hz=settings.sample_rate_hz,
        start_position=settings.start_position,
        air_time=settings.air_time if air_time is None else air_time,
        seed=seed,
        initial_shift=initial_shift,
        model=case.process,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Panel:
    """What the control of a machine says of itself, beside what is measured.

    Attributes
    ----------
    homed, feed_hold
        Whether the slides are homed, the feed is held.
    blocked
        Any other reason to keep the shift where it is, such as a tool change or threading; empty if none.
    override_percent
        Of the spindle.
    tool
        Number of the tool in turret 1.
    """

    homed: bool = True
    feed_hold: bool = False
    blocked: str = ""
    override_percent: float = 100.0
    tool: int = 1


class MachineNode:
    """Answers each tick with one block of servo samples, its state, the truth, and what happened.

    Parameters
    ----------
    case
        The case.
    seed
        Of the plant's noise.
    run
        Identifier of the run.
    initial_shift
        Where the turret stands when the machine is switched on (rad).

    Attributes
    ----------
    panel : Panel
        What the control of the machine says of itself; replaced by whoever knows.
    """

    subscribes = (Tick, TurretCommand, OperatorRequest)

    def __init__(self, case: Case, seed: int, run: str, initial_shift: float = 0.0) -> None:
        self.plant = make_plant(case, seed, initial_shift)
        self._case, self._run = case, run
        self._rate = case.settings.sample_rate_hz
        self._samples = round(BLOCK_S * self._rate)
        slides = slide_set_points(initial_shift, self.plant.diameter, case.drives.axis_angle)
        self._measured = np.array([initial_shift, *map(float, slides)])
        self._guard = Guard(
            case.limits, run=run, controller="controller", operator="operator",
            token=lambda: secrets.token_hex(8), start=self._measured.tolist(),
        )  # fmt: skip
        self._path = ShiftTrajectory(self._path_limits(None), self._rate, initial_shift)
        self._slow: float | None = None
        self.panel = Panel()
        self._in_cut = False
        self.pass_kind: str | None = None if case.job is None else case.job.pass_kind
        """Which pass is cut now, None when nobody says so."""
        self._events = 0

    def prepare(self) -> None:
        """Compile the kernels."""
        self.plant.prepare()

    def handle(self, message: Tick | TurretCommand | OperatorRequest) -> list[Message]:
        """Advance by one block, or take a command or request."""
        if isinstance(message, Tick):
            return self._block(message.block)
        if isinstance(message, TurretCommand):
            self._guard.command(message, self.plant.sample)
        else:
            self._guard.request(message)
        return self._notices(message.sequence)

    def summary(self) -> dict[str, Any]:
        """Return what there is to say of the machine itself, for JSON."""
        return {"adapter": "simulator"}

    def _block(self, number: int) -> list[Message]:
        n = self._samples
        plan = self._guard.begin_block(self.plant.sample, n, self._conditions())
        plant = self._drive(self._guard.check(*self._follow(plan, n)))
        self._measured = np.array([plant.shift[-1], plant.x1_stage_position[-1], plant.y1_stage_position[-1]])
        self._in_cut = bool(plant.in_cut[-1])
        return [
            *self._state(number, plant),
            self._servo(number, plant),
            self._truth(number, plant),
            *self._notices(number),
        ]

    def _conditions(self) -> Conditions:
        """Return what the guard is told of the machine before a block."""
        return Conditions(
            in_cut=self._in_cut, homed=self.panel.homed, feed_hold=self.panel.feed_hold, spindle_hz=self._speed,
            diameter=self.plant.diameter, measured=self._measured, blocked=self.panel.blocked or self._forbidden(),
        )  # fmt: skip

    def _forbidden(self) -> str:
        """Return why the present pass lets nothing move, empty if it does."""
        return "" if self._case.job is None else self._case.job.forbids(self.pass_kind)

    def _drive(self, checked: Checked) -> PlantBlock:
        """Let the drives follow what the guard lets through."""
        return self.plant.advance(checked.x1, checked.y1, self._speed)

    @property
    def _speed(self) -> float:
        """Speed of the spindle (Hz)."""
        return self._case.cutting.spindle_hz * (self.panel.override_percent / 100.0)

    def _follow(self, plan: Plan, n: int) -> tuple[Any, Any, Any]:
        """Return set points of shift (rad) and slides (m) towards the target, or at rest where the guard stands."""
        stands = plan.target is None and (self._path.moving or self._path.target != self._guard.shift)
        if stands or plan.speed != self._slow:
            self._slow = plan.speed
            self._path = ShiftTrajectory(self._path_limits(plan.speed), self._rate, self._guard.shift)
        if plan.target is not None and plan.target != self._path.target:
            self._path.retarget(plan.target)
        angle, diameter = self._case.drives.axis_angle, self.plant.diameter
        if self._path.moving:
            shift = self._path.advance(n)
            return (shift, *slide_set_points(shift, diameter, angle))
        points = (self._path.target, *slide_set_points(self._path.target, diameter, angle))
        return tuple(np.full(n, point) for point in points)  # pyright: ignore[reportReturnType]

    def _path_limits(self, speed: float | None) -> TrajectoryLimits:
        """Return the limits of the path; slower when the guard lets the turret return only so fast (rad/s)."""
        limits = self._case.path
        return limits if speed is None else replace(limits, max_speed=min(limits.max_speed, 0.999 * speed))

    def _header(self, number: int) -> dict[str, Any]:
        return {"run": self._run, "source": SOURCE, "sequence": number}

    def _servo(self, number: int, plant: PlantBlock) -> SampleBlock:
        return SampleBlock(
            **self._header(number),
            first_sample=plant.first_sample,
            sample_rate_hz=plant.sample_rate_hz,
            x1_thrust_n=plant.x1_thrust,
            x1_motor_position_m=plant.x1_motor_position,
            x1_stage_position_m=plant.x1_stage_position,
            y1_thrust_n=plant.y1_thrust,
            y1_motor_position_m=plant.y1_motor_position,
            y1_stage_position_m=plant.y1_stage_position,
            dx1_um=plant.dx1 * 1e6,
            dy1p_um=plant.dy1p * 1e6,
            shift_requested_deg=math.degrees(self._guard.requested),
            shift_applied_deg=math.degrees(plant.shift[-1]),
            moving=self._guard.moving,
            in_cut=bool(plant.in_cut.all()),
            spindle_speed_rpm=60.0 * self._speed,
            diameter_mm=1e3 * self.plant.diameter,
            guard_state=self._guard.state,
            session=self._guard.session,
        )

    def _state(self, number: int, plant: PlantBlock) -> list[Message]:
        guard = self._guard
        state = MachineState(
            **self._header(number),
            sample=plant.first_sample + self._samples - 1,
            spindle_speed_rpm=60.0 * self._speed,
            spindle_angle_rad=float(plant.spindle_angle[-1] % (2.0 * math.pi)),
            z_mm=1e3 * float(plant.tool_position[-1]),
            feed_mm_per_rev=1e3 * self._case.cutting.feed_per_rev,
            diameter_mm=1e3 * self.plant.diameter,
            override_percent=self.panel.override_percent,
            in_cut=self._in_cut,
            homed=self.panel.homed,
            feed_hold=guard.feed_hold_requested,
            tool=self.panel.tool,
            guard_state=guard.state,
            session=guard.session,
            shift_requested_deg=math.degrees(guard.requested),
            shift_target_deg=math.degrees(guard.target),
            shift_applied_deg=math.degrees(plant.shift[-1]),
            slide_x1_um=1e6 * float(plant.x1_stage_position[-1]),
            slide_y1_um=1e6 * float(plant.y1_stage_position[-1]),
            commands_accepted=guard.accepted,
            commands_rejected=guard.commands_rejected,
            commands_late=guard.late,
            reason=guard.reason,
        )
        return [state]

    def _truth(self, number: int, plant: PlantBlock) -> Truth:
        return Truth(
            **self._header(number),
            first_sample=plant.first_sample,
            sample_rate_hz=plant.sample_rate_hz,
            vibration_um=plant.vibration * 1e6,
            bar_displacement_um=plant.bar_displacement * 1e6,
            tool_radial_um=(plant.bar_displacement - plant.vibration) * 1e6,
            force_x1_n=plant.force_x1,
            force_y1p_n=plant.force_y1p,
            z_mm=plant.tool_position * 1e3,
            left1_um=plant.left1 * 1e6,
            left2_um=plant.left2 * 1e6,
            phase1_rad=plant.phase1,
            phase2_rad=plant.phase2,
            in_cut=plant.in_cut.astype(np.float64),
        )

    def _notices(self, cause: int) -> list[Message]:
        events: list[Message] = []
        for notice in self._guard.notices():
            events.append(
                Event(
                    run=self._run,
                    source=SOURCE,
                    sequence=self._events,
                    cause=cause,
                    sample=notice.sample,
                    kind=notice.kind,
                    text=notice.text,
                )  # fmt: skip
            )
            self._events += 1
        return events
