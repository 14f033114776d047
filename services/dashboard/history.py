"""The last seconds of every trace on one grid of columns, each with its least and greatest sample."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from services.messages import Floats

COLUMN_S = 0.010
SPAN_S = 15.0
COLUMNS = round(SPAN_S / COLUMN_S)
RESENT = 30
"""Columns at the end that are sent with every frame: messages of other topics, or late ones, may still fill them."""
ENVELOPES = ("x1_min_n", "x1_max_n", "y1p_min_n", "y1p_max_n")
ROWS = (
    *ENVELOPES, "indicator_n", "limit_n", "frequency_hz", "shift_requested_deg", "shift_applied_deg",
)  # fmt: skip
PLACE = {name: row for row, name in enumerate(ROWS)}


def decimate(values: Floats, first: int, per_column: int) -> tuple[int, Floats, Floats]:
    """Return the first column of a run of samples, and least and greatest of each column; NaN where all are NaN.

    Parameters
    ----------
    values
        Samples, shape (n,), n > 0.
    first
        Index of the first one.
    per_column
        Samples on a column of the grid.
    """
    column = first // per_column
    if first + values.size <= (column + 1) * per_column:
        cuts = [0]
    else:
        cuts = [0, *range((column + 1) * per_column - first, values.size, per_column)]
    return column, np.fmin.reduceat(values, cuts), np.fmax.reduceat(values, cuts)


class History:
    """A ring of columns in which the newest win; what was never filled is NaN.

    Attributes
    ----------
    head
        Number of the newest column, -1 before the first.
    """

    def __init__(self, rows: int = len(ROWS), columns: int = COLUMNS) -> None:
        self._values: NDArray[np.float32] = np.full((rows, columns), np.nan, np.float32)
        self.head = -1

    def clear(self) -> None:
        """Forget everything."""
        self._values.fill(np.nan)
        self.head = -1

    def put(self, row: int, column: int, value: float) -> None:
        """Write one value; what is older than the ring is forgotten at once."""
        if self._reach(column):
            self._values[row, column % self._values.shape[1]] = value

    def widen(self, row: int, column: int, least: Floats, greatest: Floats) -> None:
        """Let the pair of rows from `row` hold at least what lies between, from `column` on, shape (k,) each."""
        size = self._values.shape[1]
        skipped = max(0, least.size - size)
        for k in range(skipped, least.size):
            if self._reach(column + k):
                slot = (column + k) % size
                held = self._values[row : row + 2, slot]
                held[0], held[1] = np.fmin(held[0], least[k]), np.fmax(held[1], greatest[k])

    def _reach(self, column: int) -> bool:
        """Make room up to a column; False when it has left the ring already."""
        size = self._values.shape[1]
        if column > self.head:
            new = min(column - self.head, size) if self.head >= 0 else size
            slots = np.arange(column - new + 1, column + 1) % size
            self._values[:, slots] = np.nan
            self.head = column
        return column > self.head - size

    def since(self, column: int) -> tuple[int, NDArray[np.float32]]:
        """Return the first column behind `column` that is still there, and all from it on, shape (rows, k)."""
        size = self._values.shape[1]
        first = max(column + 1, self.head - size + 1, 0)
        return first, self._values[:, np.arange(first, self.head + 1) % size]
