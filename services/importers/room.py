"""Room for samples: in memory while they are few, in a file that the system pages in and out when they are many."""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Generator, Iterator
from contextlib import contextmanager
from typing import Protocol

import numpy as np
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

from services.messages import Floats

IN_MEMORY_BYTES = 1 << 28
"""Samples that take more than this lie in a file."""
CHUNK_ROWS = 1 << 19
"""Rows that are worked on at once."""


class Advance(Protocol):
    """Says that so much more is done."""

    def __call__(self, amount: float) -> None: ...  # noqa: D102


def room(rows: int, columns: int) -> Floats:
    """Return an array for samples, shape (rows, columns); what it holds is not defined.

    Parameters
    ----------
    rows, columns
        Its shape.
    """
    if 8 * rows * columns <= IN_MEMORY_BYTES:
        return np.empty((rows, columns))
    with tempfile.TemporaryFile() as file:  # gone from the folder at once, from the disk with the last view
        return np.memmap(file, dtype=np.float64, mode="w+", shape=(rows, columns))


class Growing:
    """Room for rows whose number is not known before the end.

    Parameters
    ----------
    columns
        Numbers in a row.
    """

    def __init__(self, columns: int) -> None:
        self._columns, self._parts, self._bytes = columns, list[Floats](), 0
        self._file = None

    def append(self, rows: Floats) -> None:
        """Add rows, shape (n, columns)."""
        self._bytes += rows.nbytes
        self._parts.append(rows)
        if self._bytes > IN_MEMORY_BYTES:
            self._file = self._file or tempfile.TemporaryFile()  # noqa: SIM115
            for part in self._parts:
                self._file.write(np.ascontiguousarray(part, dtype=np.float64).tobytes())
            self._parts.clear()
            self._bytes = IN_MEMORY_BYTES

    def whole(self) -> Floats:
        """Return all rows, shape (n, columns)."""
        if self._file is None:
            return np.concatenate(self._parts) if self._parts else np.empty((0, self._columns))
        with self._file:
            for part in self._parts:
                self._file.write(np.ascontiguousarray(part, dtype=np.float64).tobytes())
            self._file.flush()
            flat = np.memmap(self._file, dtype=np.float64, mode="r+")
        return flat.reshape(-1, self._columns)


def slices(rows: int, size: int = CHUNK_ROWS) -> Iterator[slice]:
    """Return slices that cover so many rows.

    Parameters
    ----------
    rows
        How many.
    size
        Longest slice.
    """
    return (slice(k, min(k + size, rows)) for k in range(0, rows, size))


def whole_share(samples: Floats) -> int:
    """Return in how many rows a number is missing; such rows get NaN where it is infinite.

    Parameters
    ----------
    samples
        shape (n, channels), changed in place.
    """
    missing = 0
    for part in slices(len(samples)):
        block = samples[part]
        bad = ~np.isfinite(block)
        if bad.any():
            block[bad] = np.nan
            missing += int(bad.any(axis=1).sum())
    return missing


@contextmanager
def watched(what: str, total: float, least: float) -> Generator[Advance]:
    """Show a bar on a terminal while something large is read.

    Parameters
    ----------
    what
        Words for it.
    total
        Amount to be done.
    least
        Amount from which on the bar is worth showing.
    """
    if total < least or not sys.stderr.isatty():
        yield lambda amount: None
        return
    share = TextColumn("{task.percentage:.0f} %")
    columns = (TextColumn("{task.description}"), BarColumn(), share, TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(what, total=total)
        yield lambda amount: bar.advance(task, amount)
