"""From time stamps to an even grid: gaps, repeated stamps, coarse clocks, dates."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime

import numpy as np

from services.errors import InputError
from services.messages import Floats

_FEW = 0.02
"""Part of the steps that may differ before they count as the way of the clock, and not as gaps in it."""
_DATES = ("%d.%m.%Y %H:%M:%S.%f", "%d.%m.%Y %H:%M:%S", "%m/%d/%Y %H:%M:%S.%f", "%m/%d/%Y %H:%M:%S",
          "%Y/%m/%d %H:%M:%S.%f", "%Y/%m/%d %H:%M:%S", "%d-%b-%Y %H:%M:%S.%f", "%d-%b-%Y %H:%M:%S",
          "%m/%d/%Y %I:%M:%S.%f %p", "%m/%d/%Y %I:%M:%S %p", "%H:%M:%S.%f", "%H:%M:%S")  # fmt: skip
_EPOCHS = ((1e17, 1e-9), (1e14, 1e-6), (1e11, 1e-3))
"""Whole numbers since 1970 that are so large count nano-, micro- or milliseconds."""


def same_rate(one_hz: float, other_hz: float) -> bool:
    """Whether two statements of a rate mean the same."""
    return abs(one_hz / other_hz - 1.0) <= 0.02


def epoch_seconds(time: np.ndarray) -> Floats:
    """Return whole stamps since 1970 as seconds from the first; other numbers as they are."""
    if time.size == 0 or time.dtype.kind not in "iu" and not np.isfinite(time).all():
        return time.astype(np.float64)
    size = abs(float(time[0]))
    unit = next((unit for least, unit in _EPOCHS if size > least), None)
    if unit is None:
        return time.astype(np.float64)
    return (time - time[0]).astype(np.float64) * unit


def clock_of(cells: Sequence[str]) -> Floats | None:
    """Return dates or times of day as seconds from the first, None if they are not; NaN for an empty cell."""
    known = next((cell.strip() for cell in cells if cell.strip()), "")
    form = next((form for form in (None, *_DATES) if _moment(known, form) is not None), "")
    if form == "":
        return None
    moments = [_moment(cell.strip(), form) for cell in cells]
    start = next(moment for moment in moments if moment is not None)
    seconds = np.array([np.nan if m is None else (m - start).total_seconds() for m in moments])
    if form is not None and form.startswith("%H"):  # past midnight
        seconds[1:] += 86400.0 * np.cumsum(np.diff(seconds) < -43200.0)
    return seconds


def _moment(cell: str, form: str | None) -> datetime | None:
    text = cell.replace(",", ".")
    try:
        found = datetime.fromisoformat(text) if form is None else datetime.strptime(_microseconds(text), form)
    except ValueError:
        return None
    if form is None and len(text) < 10:
        return None
    return found.replace(tzinfo=None)


def _microseconds(text: str) -> str:
    head, dot, fraction = text.rpartition(".")
    digits = fraction.split(" ")[0]
    return f"{head}{dot}{digits[:6]}{fraction[len(digits) :]}" if dot and len(digits) > 6 else text


def even(source: str, time: Floats, samples: Floats, notes: list[str], first: int = 1) -> tuple[float, Floats]:
    """Return the rate (Hz) and the rows on an even grid; rows that are not there become NaN.

    Parameters
    ----------
    source
        File, for the messages.
    time
        Stamps of the rows (s), shape (n,).
    samples
        Rows, shape (n, channels).
    notes
        What was found is appended.
    first
        Number of the first row, for the messages.
    """
    known = np.isfinite(time)
    if not known.all():
        row = int(np.argmin(known))
        raise InputError("time", None, f"a number in every row of {source} (row {row + first})")
    time, samples = _once(time, samples, notes)
    step = np.diff(time)
    if time.size < 2 or (step < 0.0).any() or not (step > 0.0).any():
        row = int(np.argmax(step <= 0.0)) + 1 if step.size else 0
        value = float(time[row]) if time.size else None
        raise InputError("time", value, f"increasing from row to row of {source} (row {row + first})")
    period = float(np.median(step[step > 0.0]))
    away = np.abs(step - period) > 0.5 * period
    if not away.any():
        return (time.size - 1) / float(time[-1] - time[0]), samples
    if away.mean() <= _FEW or time.size < 1.0 / _FEW:
        gapless = _with_gaps(time, samples, period, notes)
        if gapless is not None:
            return 1.0 / period, gapless
    return _coarse(source, time, step, notes), samples


def _once(time: Floats, samples: Floats, notes: list[str]) -> tuple[Floats, Floats]:
    """Drop rows that repeat the row before, stamp and all."""
    if time.size < 2:
        return time, samples
    still = np.diff(time) == 0.0
    again = still & ((samples[1:] == samples[:-1]) | np.isnan(samples[1:])).all(axis=1)
    if not still.any() or not again[still].all():  # a coarse clock repeats stamps too, but not the values
        return time, samples
    notes.append(f"{int(again.sum())} rows repeat the row before, time stamp and all; they were left out")
    kept = np.concatenate([[True], np.logical_not(again)])
    return time[kept], samples[kept]


def _with_gaps(time: Floats, samples: Floats, period: float, notes: list[str]) -> Floats | None:
    index = np.rint((time - time[0]) / period).astype(np.int64)
    if (np.diff(index) == 0).any() or index[-1] > 20 * len(time):
        return None
    grid = np.full((int(index[-1]) + 1, samples.shape[1]), np.nan)
    grid[index] = samples
    notes.append(f"{len(grid) - len(samples)} rows are missing in the time column; they count as gaps")
    return grid


def _coarse(source: str, time: Floats, step: Floats, notes: list[str]) -> float:
    """Return the rate (Hz) of rows whose clock is coarser than they are; refuse rows that are not even.

    A clock that ticks stays within one tick of an even one, a number with few digits within its last digit.
    """
    tick = float(np.percentile(step[step > 0.0], 5.0))
    row = np.arange(time.size) - 0.5 * (time.size - 1)
    slope = float(row @ (time - time.mean()) / (row @ row))
    stray = np.abs(time - time.mean() - slope * row)
    if (stray > np.maximum(1.01 * np.maximum(tick, _last_digit(time)), 0.5 * slope)).any():
        steps = f"steps {step.min():.3g}..{step.max():.3g} s"
        raise InputError("time", steps, f"evenly spaced in {source}: resample it first")
    repeated = int(np.count_nonzero(step == 0.0))
    what = f"{repeated} time stamps repeat" if repeated else "the steps of the time stamps vary"
    notes.append(f"{what} (steps from {tick:.3g} s); the rows fit an even rate of {1.0 / slope:.6g} Hz")
    return 1.0 / slope


def _last_digit(time: Floats) -> Floats:
    """Return the worth of the last digit of each stamp, if all are written with as few digits; else 0."""
    size = np.floor(np.log10(np.maximum(np.abs(time), np.finfo(float).tiny)))
    for digits in range(3, 8):
        worth = 10.0 ** (size - digits + 1)
        if np.allclose(time / worth, np.rint(time / worth), rtol=0.0, atol=1e-3):
            return worth
    return np.zeros(time.size)
