"""What the monitor says of a stream, and its settings that a sweep goes through."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np

from chatter import ChatterEstimate, ChatterMonitor, MonitorConfig
from services.bench.detector.stream import Stream
from services.messages import BLOCK_S, Floats
from services.metrics import CHATTER_STATE

REGENERATIVE = "regenerative"
DEFAULT = "default"
STEPS = (-1.0, 1.0, 2.0)
"""Settings of the sweep: so many steps of 3 dB more sensitive than the default."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Said:
    """Reports of a monitor, one for each block, shape (m,) each.

    Attributes
    ----------
    alarm
        Whether it said chatter.
    limit
        Limit of the line amplitude in force (N): the higher of the two that an alarm must pass.
    estimates
        The reports themselves.
    """

    alarm: np.ndarray
    limit: Floats
    estimates: Sequence[ChatterEstimate]

    def first(self, entry_s: float) -> tuple[float, ChatterEstimate] | None:
        """Return when the first alarm after the entry was due (s) and its report; None without one."""
        block = int(round(entry_s / BLOCK_S))
        found = np.flatnonzero(self.alarm[block:])
        if not found.size:
            return None
        at = block + int(found[0])
        return (at + 1) * BLOCK_S, self.estimates[at]


def settings(config: MonitorConfig) -> dict[str, MonitorConfig]:
    """Return the monitors of the sweep: the default, and less and more sensitive ones."""
    return {DEFAULT: config, **{f"{step:+g}": _more_sensitive(config, step) for step in STEPS}}


def _more_sensitive(config: MonitorConfig, steps: float) -> MonitorConfig:
    if "sensitivity" in {field.name for field in fields(config)}:
        return replace(config, **{"sensitivity": getattr(config, "sensitivity") + steps})  # noqa: B009
    lower = 10.0 ** (0.05 * 3.0 * steps)
    expected = None if config.expected_limit is None else config.expected_limit / lower
    return replace(config, expected_limit=expected, false_alarm_interval=config.false_alarm_interval / lower**12)


def listen(stream: Stream, config: MonitorConfig, *, until: float = math.inf, tail_s: float = 0.0) -> Said:
    """Let a monitor hear a stream block by block, as its node does.

    Parameters
    ----------
    stream
        What is heard.
    config
        Parameters of the monitor.
    until, tail_s
        It may stop this long after `until`, once it has given the alarm (s).
    """
    force = stream.force[:, stream.process.channels]
    monitor = ChatterMonitor(config, stream.rate, channels=force.shape[1])
    said: list[ChatterEstimate] = []
    left = math.inf
    for number, (engaged, speed) in enumerate(zip(stream.engaged.tolist(), stream.spindle_hz.tolist(), strict=True)):
        first = number * stream.block
        said += monitor.process(force[first : first + stream.block], first, in_cut=engaged, spindle_hz=speed)
        if left == math.inf and (number + 1) * BLOCK_S >= until and _alarms(said[-1]):
            left = round(tail_s / BLOCK_S)
        left -= 1
        if left < 0:
            break
    return Said(
        alarm=np.array([_alarms(one) for one in said]),
        limit=np.array([max(2.0**0.5 * one.limit, one.line_limit) for one in said]),
        estimates=said,
    )


def _alarms(estimate: ChatterEstimate) -> bool:
    return estimate.state == CHATTER_STATE and estimate.kind in (None, REGENERATIVE)
