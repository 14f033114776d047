"""Recordings of our own (MCAP): the servo samples and the estimated force as channels."""

from __future__ import annotations

import pathlib
from collections import Counter

import numpy as np

from services.errors import InputError
from services.importers.recording import Recording
from services.importers.room import room
from services.importers.vocabulary import split_unit
from services.messages import Floats, ForceBlock, SampleBlock
from services.recording_file import read_messages

_SERVO = ("x1_thrust_n", "x1_motor_position_m", "x1_stage_position_m", "y1_thrust_n", "y1_motor_position_m",
          "y1_stage_position_m")  # fmt: skip
_FORCE = ("force_x1_n", "force_y1p_n")


def read_mcap(path: pathlib.Path, rate_hz: float | None) -> Recording:
    """Read the servo samples of `path` on their grid; blocks that are missing are gaps."""
    parts: list[tuple[int, str, Floats]] = []
    rates: Counter[float] = Counter()
    topics: Counter[str] = Counter()
    for topic, message in read_messages(path):
        topics[topic] += 1
        if isinstance(message, SampleBlock | ForceBlock):
            names = _SERVO if isinstance(message, SampleBlock) else _FORCE
            rates[message.sample_rate_hz] += 1
            parts += [(message.first_sample, name, getattr(message, name)) for name in names]
    if not parts:
        found = ", ".join(f"{topic} ({count})" for topic, count in topics.items()) or "no message that is known"
        raise InputError("file", str(path), f"a recording with servo samples or forces (found: {found})")
    rate = rates.most_common(1)[0][0]
    if rate_hz is not None and abs(rate_hz / rate - 1.0) > 0.02:
        raise InputError("rate-hz", rate_hz, f"the rate in {path} ({rate:g} Hz), or left out")
    names = [name for name in (*_SERVO, *_FORCE) if any(part[1] == name for part in parts)]
    first = min(part[0] for part in parts)
    rows = max(part[0] + len(part[2]) for part in parts) - first
    samples = room(rows, len(names))
    samples[:] = np.nan
    for start, name, values in parts:
        samples[start - first : start - first + len(values), names.index(name)] = values
    lost = int(np.count_nonzero(~np.isfinite(samples).any(axis=1)))
    notes = [f"{lost} samples are missing (blocks that were lost)"] if lost else []
    bare, units = zip(*(split_unit(name) for name in names), strict=True)
    return Recording(
        source=str(path), rate_hz=rate, names=bare, units=units, samples=samples, notes=tuple(notes)
    )
