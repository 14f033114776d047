"""CSV tables: the first row names the columns with their units, as in `time_s,current_a`."""

from __future__ import annotations

import csv
import pathlib
import re
import warnings

import numpy as np

from services.errors import InputError
from services.importers.recording import Recording
from services.messages import Floats

_TIME = re.compile(r"^(time|t)([ _]?[\[(]?(s|ms|us|ns)?[\])]?)$", re.IGNORECASE)
_SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
_UNIT = re.compile(r"^(.*?)[ _]*(?:[\[(](.+)[\])]|_([a-z0-9]+))$", re.IGNORECASE)


def read_csv(path: pathlib.Path, rate_hz: float | None) -> Recording:
    """Read `path`; the rate comes from the time column, or from `rate_hz` when there is none.

    Empty cells and words such as `nan` count as missing. Missing rows (steps in time) become gaps.
    """
    header, delimiter = _header(path)
    values = _values(path, delimiter, len(header))
    clock = [k for k, name in enumerate(header) if _TIME.match(name)]
    signals = [k for k in range(len(header)) if k not in clock]
    if not signals:
        raise InputError("file", str(path), f"a CSV with a signal beside the time (columns: {', '.join(header)})")
    notes: list[str] = []
    samples = values[:, signals]
    if clock:
        rate, samples = _even(path, _seconds(header[clock[0]]) * values[:, clock[0]], samples, notes)
        if rate_hz is not None and abs(rate_hz / rate - 1.0) > 0.02:
            raise InputError("rate-hz", rate_hz, f"the rate of the time column of {path} ({rate:.6g} Hz), or left out")
    elif rate_hz is None:
        raise InputError("rate-hz", None, f"given, or {path} must have a column time_s (columns: {', '.join(header)})")
    else:
        rate = rate_hz
    missing = int(np.count_nonzero(~np.isfinite(samples).all(axis=1)))
    if missing:
        notes.append(f"{missing} of {len(samples)} rows have values that are missing; they count as gaps")
    names, units = zip(*(_split(header[k]) for k in signals), strict=True)
    return Recording(
        source=str(path), rate_hz=float(rate), names=names, units=units, samples=samples, notes=tuple(notes)
    )


def _header(path: pathlib.Path) -> tuple[list[str], str]:
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            line = file.readline(65536)
    except UnicodeDecodeError as error:
        raise InputError("file", str(path), "a CSV in UTF-8 text (this looks like binary data)") from error
    delimiter = max(",;\t", key=line.count)
    header = [name.strip() for name in next(csv.reader([line], delimiter=delimiter), [])]
    if not any(header):
        raise InputError("file", str(path), "a CSV whose first row names the columns (the file is empty)")
    if all(_is_number(name) for name in header):
        raise InputError(
            "file", str(path), f"a CSV whose first row names the columns with units (got {line.strip()!r})"
        )
    return header, delimiter


def _values(path: pathlib.Path, delimiter: str, columns: int) -> Floats:
    try:
        with path.open(encoding="utf-8-sig") as file, warnings.catch_warnings():
            warnings.simplefilter("ignore")  # an empty table has its own message below
            values = np.loadtxt(file, delimiter=delimiter, skiprows=1, ndmin=2, comments=None)
    except ValueError:
        values = _tolerant(path, delimiter, columns)
    if values.shape[0] < 2 or values.shape[1] != columns:
        raise InputError(
            "file", str(path), f"a CSV with at least two rows of {columns} numbers ({values.shape[0]} found)"
        )
    return np.where(np.isfinite(values), values, np.nan)


def _tolerant(path: pathlib.Path, delimiter: str, columns: int) -> Floats:
    rows: list[list[float]] = []
    bad = 0
    with path.open(newline="", encoding="utf-8-sig", errors="replace") as file:
        reader = csv.reader(file, delimiter=delimiter)
        next(reader)
        for row in reader:
            if not row:
                continue
            cells = [_number(cell, delimiter) for cell in row[:columns]] + [np.nan] * (columns - len(row))
            bad += len(row) != columns or all(np.isnan(cells))
            rows.append(cells)
    if rows and bad > max(1, len(rows) // 2):
        raise InputError("file", str(path), f"a CSV of numbers ({bad} of {len(rows)} rows are not)")
    return np.array(rows, dtype=np.float64).reshape(-1, columns)


def _number(cell: str, delimiter: str) -> float:
    text = cell.strip().replace(",", ".") if delimiter == ";" else cell.strip()
    return float(text) if _is_number(text) else np.nan


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _seconds(name: str) -> float:
    match = _TIME.match(name)
    return _SECONDS[(match.group(3) or "s").lower()] if match else 1.0


def _even(path: pathlib.Path, time: Floats, samples: Floats, notes: list[str]) -> tuple[float, Floats]:
    """Put the rows on an even grid; rows that are not there become NaN."""
    if not np.isfinite(time).all():
        row = int(np.flatnonzero(~np.isfinite(time))[0])
        raise InputError("time", None, f"a number in every row of {path} (row {row + 2})")
    step = np.diff(time)
    if (step <= 0).any():
        row = int(np.flatnonzero(step <= 0)[0])
        raise InputError("time", float(time[row + 1]), f"increasing from row to row of {path} (row {row + 3})")
    period = float(np.median(step))
    if (np.abs(step - period) <= 0.5 * period).all():
        period = float(time[-1] - time[0]) / (len(time) - 1)
        return 1.0 / period, samples
    index = np.rint((time - time[0]) / period).astype(np.int64)
    if (np.diff(index) == 0).any() or index[-1] > 20 * len(time):
        raise InputError(
            "time", f"steps {step.min():.3g}..{step.max():.3g} s", f"evenly spaced in {path}: resample it first"
        )
    even = np.full((int(index[-1]) + 1, samples.shape[1]), np.nan)
    even[index] = samples
    notes.append(f"{len(even) - len(samples)} rows are missing in the time column; they count as gaps")
    return 1.0 / period, even


def _split(name: str) -> tuple[str, str]:
    match = _UNIT.match(name)
    return (match.group(1), match.group(2) or match.group(3)) if match and match.group(1) else (name, "")
