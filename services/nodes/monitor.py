"""The monitor: servo samples in, estimated force and one verdict per block out."""

from __future__ import annotations

from typing import Any

import numpy as np

from chatter import ChatterEstimate, ChatterMonitor
from chatter.input_check import InputCheck
from chatter.limits import LearnedLevel
from chatter.monitor import MonitorState
from services.config import Case
from services.errors import InputError
from services.estimator import estimated_force, force_observer
from services.messages import ChatterReport, Event, Floats, ForceBlock, Message, ReportedLine, SampleBlock

SOURCE = "monitor"

LONGEST_M = 10.0
"""No slide of a lathe is further from home (m): such a position, like NaN, is a broken sensor."""


class MonitorNode:
    """Knows the nominal drives and the signals of the sensors, nothing of the plant.

    Parameters
    ----------
    case
        The case; only its belief, its monitor and how the loops are tuned are read.
    run
        Identifier of the run.
    """

    subscribes = (SampleBlock,)

    def __init__(self, case: Case, run: str) -> None:
        rate = case.settings.sample_rate_hz
        self._run, self._rate = run, rate
        self._observer = force_observer(case)
        self._latency = self._observer.latency
        self._monitor = ChatterMonitor(case.monitor, rate, channels=2)
        self._false_alarms = case.monitor.false_alarms_per_hour
        self._check = InputCheck(2)
        self._periods = [
            (axis, period)
            for axis, drive in enumerate(case.belief.drives)
            for period in (drive.motor_period, drive.stage_period)
            if period is not None
        ]
        self._next: int | None = None
        self._state = ""
        self._events = 0
        self.blocks_lost = 0
        if case.learned is not None:
            try:
                self.restore(case.learned.snapshot())
            except ValueError as error:
                raise InputError("learned", None, f"learned with this band and window ({error})") from error

    def prepare(self) -> None:
        """Compile the kernels."""
        self._observer.prepare()
        self._monitor.prepare()
        InputCheck(2).look(np.zeros((2, 2)))

    def handle(self, message: SampleBlock) -> list[Message]:
        """Return the force of the block, its verdict, and an event when the verdict changes."""
        motor = _side_by_side(message.x1_motor_position_m, message.y1_motor_position_m)
        stage = _side_by_side(message.x1_stage_position_m, message.y1_stage_position_m)
        if self._next is not None and message.first_sample + len(stage) <= self._next:
            self._monitor.process(np.zeros_like(stage), message.first_sample)  # told twice: counted, not heard
            return []
        force, heard, notes = self._forces(message, motor, stage)
        out: list[Message] = [
            ForceBlock(
                **self._header(message),
                first_sample=message.first_sample,
                sample_rate_hz=message.sample_rate_hz,
                force_x1_n=force[:, 0],
                force_y1p_n=force[:, 1],
                latency_s=self._latency,
            )
        ]
        estimates = self._monitor.process(
            heard,
            message.first_sample,
            in_cut=message.in_cut,
            spindle_hz=message.spindle_speed_rpm / 60.0,
            moving=message.moving,
            encoder_hz=self._encoder_hz(stage),
        )
        for estimate in estimates:
            out += [self._report(message, estimate, notes), *self._changes(message, estimate)]
        return out

    def _header(self, block: SampleBlock) -> dict[str, Any]:
        return {"run": self._run, "source": SOURCE, "sequence": block.sequence, "cause": block.sequence}

    def snapshot(self) -> dict[str, Any]:
        """Return the learned limits as plain values, for a successor in the same run."""
        return {
            name: {
                "windows": level.windows, "power": level.power.tolist(),
                "square": level.square, "fourth": level.fourth,
            }
            for name, level in self._levels(self._monitor.snapshot()).items()
        }  # fmt: skip

    def restore(self, saved: dict[str, Any]) -> None:
        """Take over the limits that a predecessor learned; its windows are gone with it.

        Raises
        ------
        ValueError
            If `saved` does not fit this monitor; nothing is taken over then.
        """
        state = self._monitor.snapshot()
        for name, level in self._levels(state).items():
            kept = saved.get(name)
            values = _numbers(kept, level.power.size)
            if values is None:
                raise ValueError(f"limits learned in {name} must be those of {level.power.size} bins, got {kept!r:.80}")
            level.windows, level.square, level.fourth = values[:3].tolist()
            level.power[:] = values[3:]
        self._monitor.restore(state)

    @staticmethod
    def _levels(state: MonitorState) -> dict[str, LearnedLevel]:
        """Return the learned levels inside a copy of the state; they may be changed there."""
        limits = state.parts[-1][0]
        return {"air": limits.air, "cut": limits.cut}

    def _forces(self, block: SampleBlock, motor: Floats, stage: Floats) -> tuple[Floats, Floats, tuple[str, ...]]:
        """Return the force, what the monitor listens to, and what is wrong with the scales.

        What cannot be estimated is NaN, and the observers start anew behind it.
        """
        if self._next is not None and block.first_sample != self._next:
            self.blocks_lost += max(0, block.first_sample - self._next) // max(1, len(motor))
            self._reset()
        self._next = block.first_sample + len(motor)
        if not (np.abs(motor).max() < LONGEST_M and np.abs(stage).max() < LONGEST_M):
            self._reset()
            nothing = np.full(motor.shape, np.nan)
            return nothing, nothing, ()
        notes = self._check.look(stage)
        force = heard = estimated_force(self._observer, (block.x1_thrust_n, block.y1_thrust_n), motor, stage)
        if "repeated" in notes or ("constant" in notes and block.in_cut):
            heard = np.full(motor.shape, np.nan)
        return force, heard, tuple(note for note in notes if note != "clipped" and (note != "constant" or block.in_cut))

    def _reset(self) -> None:
        self._observer.reset()
        self._check = InputCheck(2)

    def _encoder_hz(self, stage: Floats) -> tuple[float, ...]:
        """Return how many signal periods of each encoder pass per second."""
        speed = np.abs(stage[-1] - stage[0]) * self._rate / max(len(stage) - 1, 1)
        return tuple(float(speed[axis]) / period for axis, period in self._periods)

    def _report(self, block: SampleBlock, estimate: ChatterEstimate, wrong: tuple[str, ...]) -> ChatterReport:
        return ChatterReport(
            **self._header(block),
            first_sample=estimate.first_sample,
            samples=estimate.samples,
            guard_state=block.guard_state,
            session=block.session,
            state=estimate.state,
            indicator=estimate.indicator,
            limit=estimate.limit,
            limit_source=estimate.limit_source,
            frequency_hz=estimate.frequency_hz,
            amplitude_n=estimate.amplitude,
            kind=estimate.kind,
            confidence=estimate.confidence,
            gap_samples=estimate.gap,
            moving=estimate.moving,
            in_cut=block.in_cut,
            spindle_speed_rpm=block.spindle_speed_rpm,
            diameter_mm=block.diameter_mm,
            line_n=estimate.line,
            line_limit_n=estimate.line_limit,
            lines=tuple(
                ReportedLine(
                    frequency_hz=line.frequency_hz,
                    amplitude_n=line.amplitude,
                    growth_1_per_s=line.growth,
                    kind=line.kind,
                    confidence=line.confidence,
                )
                for line in estimate.lines
            ),
            cutting=estimate.cutting,
            comb_hz=estimate.comb_hz,
            notes=tuple(dict.fromkeys((*estimate.notes, *wrong))),
            false_alarms_per_h=self._false_alarms,
            shift_requested_deg=block.shift_requested_deg,
            shift_applied_deg=block.shift_applied_deg,
        )

    def _changes(self, block: SampleBlock, estimate: ChatterEstimate) -> list[Message]:
        if estimate.state == self._state:
            return []
        before, self._state = self._state, estimate.state
        at = f" at {estimate.frequency_hz:.1f} Hz, {estimate.kind}" if estimate.frequency_hz is not None else ""
        lost = f", {estimate.gap} samples lost" if estimate.gap else ""
        self._events += 1
        return [
            Event(
                run=self._run,
                source=SOURCE,
                sequence=self._events,
                cause=block.sequence,
                sample=estimate.first_sample + estimate.samples,
                kind="monitor_state",
                text=f"{before or 'start'} -> {estimate.state}{at}{lost}",
            )  # fmt: skip
        ]


def _side_by_side(x1: Floats, y1: Floats) -> Floats:
    both = np.empty((len(x1), 2))
    both[:, 0], both[:, 1] = x1, y1
    return both


def _numbers(kept: Any, bins: int) -> np.ndarray | None:
    """Return windows, square, fourth and the power of every bin of a kept level, None if they are not all there."""
    try:
        values = np.array([kept["windows"], kept["square"], kept["fourth"], *kept["power"]], dtype=np.float64)
    except (KeyError, TypeError, ValueError):
        return None
    return values if values.size == 3 + bins and np.isfinite(values).all() and (values >= 0).all() else None
