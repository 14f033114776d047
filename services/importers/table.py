"""CSV tables: the first row names the columns with their units, as in `time_s,current_a`; much else is understood."""

from __future__ import annotations

import io
import pathlib
import warnings
from collections.abc import Sequence

import numpy as np

from services.errors import InputError
from services.importers.recording import Recording
from services.importers.room import Growing, room, slices, watched, whole_share
from services.importers.sniff import Layout, cells_of, decoded, layout_of, number, text_of
from services.importers.timebase import clock_of, epoch_seconds, even, same_rate
from services.importers.vocabulary import is_index, is_time, seconds_per, split_unit
from services.messages import Floats

_PROBE = 64
_LARGE, _HEAD, _PIECE = 1 << 26, 1 << 20, 1 << 24
"""Bytes from which on a file is read in pieces, of its beginning that is looked at, and of a piece."""
_LIKELY_HZ = (10.0, 1e7)
"""Of a rate that nobody states."""


def read_csv(path: pathlib.Path, rate_hz: float | None) -> Recording:
    """Read `path`; the rate comes from the time column, from a line above the table, or from `rate_hz`.

    Empty cells and words such as `nan` count as missing. Missing rows (steps in time) become gaps.
    """
    notes: list[str] = []
    layout, values, dated = _large(path, notes) if path.stat().st_size > _LARGE else _small(path, notes)
    clock, signals = _columns(layout, values, dated, rate_hz)
    if not signals:
        raise InputError("file", str(path), f"a CSV with a signal beside the time (columns: {', '.join(layout.names)})")
    samples, rate = _taken(values, signals), rate_hz or layout.rate_hz
    if clock is not None:
        scale = 1.0 if clock == dated else _scale(layout, clock, values, rate)
        told, samples = even(str(path), scale * epoch_seconds(values[:, clock]), samples, notes, layout.first + 1)
        rate = _agreed(str(path), told, rate_hz, layout.rate_hz, notes)
    elif rate is None:
        raise InputError("rate-hz", None, _lacking(str(path), layout))
    elif rate_hz is not None and layout.rate_hz is not None and not same_rate(rate_hz, layout.rate_hz):
        raise InputError("rate-hz", rate_hz, f"the rate stated in {path} ({layout.rate_hz:g} Hz), or left out")
    of_numbers = np.isfinite(samples).any(axis=0)
    missing = whole_share(samples if of_numbers.all() else samples[:, of_numbers])
    if missing:
        notes.append(f"{missing} of {len(samples)} rows have values that are missing; they count as gaps")
    names, units = zip(*(_named(layout, k) for k in signals), strict=True)
    return Recording(
        source=str(path), rate_hz=float(rate), names=names, units=units, samples=samples, notes=tuple(notes)
    )


def _small(path: pathlib.Path, notes: list[str]) -> tuple[Layout, Floats, int | None]:
    """Return layout and table of a file that is read at once, and which of its columns holds dates."""
    lines = text_of(path).splitlines()
    if not any(line.strip() for line in lines):
        raise InputError("file", str(path), "a CSV whose first row names the columns (the file is empty)")
    layout = layout_of(lines, str(path))
    rows = [line for line in lines[layout.first :] if line.strip()]
    _drop_torn(rows, layout, notes)
    values, dated = _values(str(path), rows, layout)
    return layout, values, dated


def _large(path: pathlib.Path, notes: list[str]) -> tuple[Layout, Floats, int | None]:
    """Return the same of a file that is read piece by piece.

    Every piece is read behind the first row, so that dates count from there.
    """
    with path.open("rb") as file:
        head, coding = decoded(file.read(_HEAD), str(path))
    layout = layout_of(head.splitlines()[:-1], str(path))
    first, dated, table = "", None, Growing(len(layout.names))
    with (
        path.open(encoding=coding, errors="replace", newline=None) as text,
        watched(path.name, path.stat().st_size, _LARGE) as advance,
    ):
        for _ in range(layout.first):
            text.readline()
        while lines := text.readlines(_PIECE):
            rows = [line.rstrip("\n") for line in lines if line.strip()]
            if len(lines) < 2 or not lines[-1].endswith("\n"):
                _drop_torn(rows, layout, notes)
            values, dated = _values(str(path), [first, *rows] if first else rows, layout)
            table.append(values[1:] if first else values)
            first = first or rows[0]
            advance(sum(map(len, lines)))
    return layout, table.whole(), dated


def _drop_torn(rows: list[str], layout: Layout, notes: list[str]) -> None:
    if len(rows) > 2 and 1 <= len(cells_of(rows[-1], layout.separator)) < len(cells_of(rows[-2], layout.separator)):
        notes.append("the last line is not whole: it was cut, or is no row; it was left out")
        rows.pop()


def _lacking(source: str, layout: Layout) -> str:
    columns = f"the columns {', '.join(layout.names)}" if layout.named else "columns without names"
    return (
        f"given: {source} has {columns}, but neither one of time (time_s, t, timestamp ...) nor a line above them such "
        "as `fs = 25600`"
    )


def _taken(values: Floats, signals: list[int]) -> Floats:
    samples = room(len(values), len(signals))
    for part in slices(len(values)):
        samples[part] = values[part][:, signals]
    return samples


def _named(layout: Layout, k: int) -> tuple[str, str]:
    name, unit = split_unit(layout.names[k])
    return (layout.names[k], layout.units[k]) if layout.units[k] else (name, unit)


def _columns(layout: Layout, values: Floats, dated: int | None, rate_hz: float | None) -> tuple[int | None, list[int]]:
    """Return the column of time, None without one, and the columns of signals."""
    names = layout.names
    kept = [k for k in range(len(names)) if names[k].strip() or not np.isnan(values[:, k]).all()]
    counted = [k for k in kept if layout.named and is_index(names[k]) and (np.diff(values[:, k]) == 1.0).all()]
    kept = [k for k in kept if k not in counted]
    clocks = [k for k in kept if layout.named and is_time(names[k]) and _may_be_time(names[k], values[:, k])]
    clocks = clocks if dated is None else [dated, *clocks]
    if not clocks and len(kept) > 1 and (not layout.named or names[kept[0]].strip().lower() in ("", "x")):
        step = _even_step(values[:, kept[0]])
        rates = [] if step is None else [1.0 / (step * unit) for unit in (1.0, 1e-3, 1e-6)]
        known = rate_hz or layout.rate_hz
        if step == 1.0 and not (known is not None and same_rate(1.0, known)):
            kept = kept[1:]  # it counts the rows
        elif any(same_rate(rate, known) for rate in rates) if known else rates and _likely(rates[0]):
            clocks = kept[:1]
    return (clocks[0] if clocks else None), [k for k in kept if k not in clocks]


def _likely(rate_hz: float) -> bool:
    return _LIKELY_HZ[0] < rate_hz < _LIKELY_HZ[1]


def _may_be_time(name: str, column: Floats) -> bool:
    """Whether a column of such a name counts as time: a lone letter may as well mean a torque."""
    return len(split_unit(name)[0].strip()) > 1 or bool((np.diff(column) >= 0.0).all())


def _even_step(column: Floats) -> float | None:
    step = np.diff(column)
    period = float(np.median(step)) if np.isfinite(step).all() else 0.0
    return period if period > 0.0 and bool((np.abs(step - period) <= 0.5 * period).all()) else None


def _scale(layout: Layout, clock: int, values: Floats, rate_hz: float | None) -> float:
    """Return the seconds in one unit of the time column; a stated rate tells when its name does not."""
    told = seconds_per(layout.names[clock], layout.units[clock])
    step = _even_step(values[:, clock])
    if told is not None or rate_hz is None or step is None:
        return 1.0 if told is None else told
    return next((unit for unit in (1.0, 1e-3, 1e-6, 1e-9) if same_rate(1.0 / (step * unit), rate_hz)), 1.0)


def _agreed(source: str, told: float, option: float | None, stated: float | None, notes: list[str]) -> float:
    if option is not None and not same_rate(option, told):
        raise InputError("rate-hz", option, f"the rate of the time column of {source} ({told:.6g} Hz), or left out")
    if stated is None or same_rate(stated, told):
        return told
    notes.append(f"a line above the table says {stated:g} Hz, the time column {told:.6g} Hz; the time column counts")
    return told


def _values(source: str, lines: Sequence[str], layout: Layout) -> tuple[Floats, int | None]:
    """Return the table, shape (rows, columns), and which of its columns holds dates, now in seconds from the first."""
    columns = len(layout.names)
    body = "\n".join(lines)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # an empty table has its own message below
            values = np.loadtxt(
                io.StringIO(body.replace(",", ".") if layout.decimal_comma else body), delimiter=layout.separator,
                ndmin=2, comments=None, quotechar='"',
            )  # fmt: skip
        dated = None
    except ValueError:
        values, dated = _tolerant(source, lines, layout)
    if values.shape[0] < 2 or values.shape[1] != columns:
        raise InputError("file", source, f"a CSV with at least two rows of {columns} numbers ({values.shape[0]} found)")
    return np.where(np.isfinite(values), values, np.nan), dated


def _tolerant(source: str, lines: Sequence[str], layout: Layout) -> tuple[Floats, int | None]:
    """Read row by row: what is no number is missing."""
    columns = len(layout.names)
    table = [cells_of(line, layout.separator) for line in lines if line.strip()]
    rows = [cells[:columns] + [""] * (columns - len(cells)) for cells in table]
    values = np.array([[_number(cell, layout.decimal_comma) for cell in row] for row in rows]).reshape(-1, columns)
    dated = None
    for k in range(columns):
        seconds = clock_of([row[k] for row in rows]) if np.isnan(values[:_PROBE, k]).all() else None
        if seconds is not None and dated is None:
            dated, values[:, k] = k, seconds
    last = int(np.flatnonzero(~np.isnan(values).all(axis=1)).max(initial=-1))
    values = values[: last + 1]  # below it stand words
    empty = np.isnan(values).all(axis=1)
    bad = int(empty.sum()) + sum(len(cells) != columns for cells in table[: len(values)])
    if len(values) and bad > max(1, len(values) // 2):
        raise InputError("file", source, f"a CSV of numbers ({bad} of {len(values)} rows are not)")
    return values, dated


def _number(cell: str, comma: bool) -> float:
    found = number(cell, comma)
    return np.nan if found is None else found
