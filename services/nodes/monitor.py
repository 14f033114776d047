"""The monitor: servo samples in, estimated force and one verdict per block out."""

from __future__ import annotations

from typing import Any

import numpy as np

from chatter import ChatterEstimate, ChatterMonitor
from chatter.limits import LearnedLevel
from chatter.monitor import MonitorState
from services.config import Case
from services.estimator import estimated_force, force_observer
from services.messages import ChatterReport, Event, ForceBlock, Message, SampleBlock

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
        self._run = run
        self._observer = force_observer(case)
        self._latency = self._observer.latency
        self._monitor = ChatterMonitor(case.monitor, rate, channels=2)
        self._next: int | None = None
        self._state = ""
        self._events = 0
        self.blocks_lost = 0

    def prepare(self) -> None:
        """Compile the kernels."""
        self._observer.prepare()
        self._monitor.prepare()

    def handle(self, message: SampleBlock) -> list[Message]:
        """Return the force of the block, its verdict, and an event when the verdict changes."""
        force = self._force(message)
        header: dict[str, Any] = {
            "run": self._run,
            "source": SOURCE,
            "sequence": message.sequence,
            "cause": message.sequence,
        }
        out: list[Message] = [
            ForceBlock(
                **header,
                first_sample=message.first_sample,
                sample_rate_hz=message.sample_rate_hz,
                force_x1_n=force[:, 0],
                force_y1p_n=force[:, 1],
                latency_s=self._latency,
            )
        ]
        estimates = self._monitor.process(
            force,
            message.first_sample,
            in_cut=message.in_cut,
            spindle_hz=message.spindle_speed_rpm / 60.0,
            moving=message.moving,
        )
        for estimate in estimates:
            out += [self._report(message, estimate), *self._changes(message, estimate)]
        return out

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

    def _force(self, block: SampleBlock) -> np.ndarray:
        """Estimate the force; what cannot be estimated is NaN, and the observer starts anew behind it."""
        motor = np.column_stack([block.x1_motor_position_m, block.y1_motor_position_m])
        stage = np.column_stack([block.x1_stage_position_m, block.y1_stage_position_m])
        if self._next is not None and block.first_sample != self._next:
            self.blocks_lost += max(0, block.first_sample - self._next) // max(1, len(motor))
            self._observer.reset()
        self._next = block.first_sample + len(motor)
        if not (np.abs(motor).max() < LONGEST_M and np.abs(stage).max() < LONGEST_M):
            self._observer.reset()
            return np.full(motor.shape, np.nan)
        return estimated_force(self._observer, (block.x1_thrust_n, block.y1_thrust_n), motor, stage)

    def _report(self, block: SampleBlock, estimate: ChatterEstimate) -> ChatterReport:
        return ChatterReport(
            run=self._run,
            source=SOURCE,
            sequence=block.sequence,
            cause=block.sequence,
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


def _numbers(kept: Any, bins: int) -> np.ndarray | None:
    """Return windows, square, fourth and the power of every bin of a kept level, None if they are not all there."""
    try:
        values = np.array([kept["windows"], kept["square"], kept["fourth"], *kept["power"]], dtype=np.float64)
    except (KeyError, TypeError, ValueError):
        return None
    return values if values.size == 3 + bins and np.isfinite(values).all() and (values >= 0).all() else None
