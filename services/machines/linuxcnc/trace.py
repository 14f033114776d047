"""What was requested, what LinuxCNC applied and what the simulated slides did, servo cycle by servo cycle."""

from __future__ import annotations

import csv
import pathlib
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from services.machines.linuxcnc.link import Row
from services.messages import BLOCK_S, Floats

COLUMNS = (
    "time_s", "cycle", "requested_x1_mm", "requested_y1_mm", "applied_x1_mm", "applied_y1_mm",
    "simulated_x1_mm", "simulated_y1_mm", "joint_1_mm", "joint_2_mm", "feed_mm", "fault", "limited", "enabled",
)  # fmt: skip


@dataclass(slots=True)
class Trace:
    """Servo cycles on the time axis of the run; a block is counted where it was cut, one before it was published."""

    rows: list[tuple[float, ...]] = field(default_factory=list[tuple[float, ...]])

    def add(
        self, number: int, rows: Sequence[Row], requested: Floats, applied: Floats, simulated: Floats
    ) -> None:
        """Keep the cycles of one block.

        Parameters
        ----------
        number
            Of the block.
        rows
            Its servo cycles.
        requested, simulated
            Slides X1 and Y1 over the block (m), shape (2, n).
        applied
            The same as LinuxCNC has them, shape (2, len(rows)).
        """
        count = len(rows)
        if not count:
            return
        share = (np.arange(count) + 1.0) / count
        grid = (np.arange(requested.shape[1]) + 1.0) / requested.shape[1]
        series = [np.interp(share, grid, 1e3 * line) for line in (*requested, *simulated)]
        for k, row in enumerate(rows):
            self.rows.append((
                (number - 1 + share[k]) * BLOCK_S, row.cycle, series[0][k], series[1][k],
                1e3 * applied[0][k], 1e3 * applied[1][k], series[2][k], series[3][k],
                row.joint_1_mm, row.joint_2_mm, row.feed_mm, row.fault, row.limited, row.enabled,
            ))  # fmt: skip

    def write(self, path: pathlib.Path) -> None:
        """Write CSV; the first line names the columns."""
        with path.open("w", encoding="utf-8", newline="") as file:
            out = csv.writer(file)
            out.writerow(COLUMNS)
            out.writerows([[f"{value:.9g}" for value in row] for row in self.rows])


def read_trace(path: pathlib.Path) -> dict[str, Floats]:
    """Return the columns of a trace by name."""
    values = np.loadtxt(path, delimiter=",", skiprows=1, ndmin=2)
    return {name: values[:, k] for k, name in enumerate(COLUMNS)} if values.size else {}


SETTLED_MM = 5e-3
QUIET_CYCLES = 200
"""A move of the turret begins when the request changes after so many servo cycles of rest."""


def judge_trace(trace: dict[str, Floats], machine: dict[str, Any]) -> dict[str, Any]:
    """Return how well the control followed: settling of each move, difference at rest, feed during moves.

    Parameters
    ----------
    trace
        As `read_trace` returns it.
    machine
        What the machine said at its end; for the time from a command to the first motion of a joint.
    """
    if not trace:
        return {}
    asked, applied = (np.array([trace[f"{kind}_{axis}1_mm"] for axis in "xy"]) for kind in ("requested", "applied"))
    moving = np.flatnonzero(np.abs(np.diff(asked[1])) > 0.0)
    starts = [int(k) for n, k in enumerate(moving) if n == 0 or k - moving[n - 1] > QUIET_CYCLES]
    off = np.abs(applied - asked).max(axis=0)
    settled, rest = [], []
    for start, end in zip(starts, [*starts, off.size - 1][1:], strict=False):
        goal = asked[:, end - 1 if end < off.size - 1 else end, None]
        away = np.abs(applied[:, start:end] - goal).max(axis=0) > SETTLED_MM
        settled.append(1e-3 * (int(np.flatnonzero(away)[-1]) + 1 if away.any() else 0))
        rest.append(1e3 * float(off[end - 1]))
    motion = machine.get("first_motion_ms") or []
    return {
        "adapter": "linuxcnc", "linuxcnc": machine.get("linuxcnc"), "servo_cycles": int(off.size),
        "moves_linuxcnc": len(starts), "settled_s": settled, "rest_um": rest,
        "first_motion_ms": float(np.median(motion)) if motion else None, "faults": int(np.any(trace["fault"])),
    }  # fmt: skip
