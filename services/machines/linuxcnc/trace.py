"""What was requested, what LinuxCNC applied and what the simulated slides did, servo cycle by servo cycle."""

from __future__ import annotations

import csv
import pathlib
from collections.abc import Sequence
from dataclasses import dataclass, field

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
