"""LabVIEW measurement files (.lvm, .txt): one or many headers, with and without columns of time, decimal commas."""

from __future__ import annotations

import pathlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from services.errors import InputError
from services.importers.recording import Recording
from services.importers.sniff import number, text_of
from services.importers.timebase import even, same_rate
from services.messages import Floats

MAGIC = "LabVIEW Measurement"
_END = "***End_of_Header***"
_SEAM = 32
"""Samples on each side of a seam between two blocks that are compared."""
_BREAK = 4.0
_TIMES = ("time", "zeit", "temps", "")


@dataclass(slots=True)
class _Segment:
    keys: dict[str, list[str]] = field(default_factory=dict[str, list[str]])
    names: list[str] = field(default_factory=list[str])
    rows: list[list[str]] = field(default_factory=list[list[str]])


@dataclass(frozen=True, slots=True)
class _Block:
    """Channels of one segment."""

    rate_hz: float
    names: tuple[str, ...]
    units: tuple[str, ...]
    samples: Floats


def is_lvm(head: bytes) -> bool:
    """Whether a file begins as LabVIEW writes it."""
    return head.lstrip(b"\xef\xbb\xbf").startswith(MAGIC.encode())


def read_lvm(path: pathlib.Path, rate_hz: float | None) -> Recording:
    """Read `path`; segments follow each other with one missing sample between them."""
    source, notes = str(path), list[str]()
    lines = text_of(path).splitlines()
    separator = "," if len(lines) > 1 and "\t" not in lines[1] and "," in lines[1] else "\t"
    rows = [[cell.strip() for cell in line.split(separator)] for line in lines]
    head, first = _header(rows, 1)
    comma = (head.get("Decimal_Separator") or ["."])[0] == ","
    segments = list(_segments(rows[first:]))
    if not any(segment.rows for segment in segments):
        found = "it ends within its header" if first >= len(rows) else "it has a header, but no rows of numbers"
        raise InputError("file", source, f"a LabVIEW measurement with samples ({found})")
    blocks = [
        block
        for segment in segments
        if segment.rows
        for block in _blocks(source, segment, (head.get("X_Columns") or ["No"])[0].lower(), comma, rate_hz, notes)
    ]
    return _joined(source, blocks, notes)


def _header(rows: Sequence[Sequence[str]], first: int) -> tuple[dict[str, list[str]], int]:
    """Return the keys of a header and the row behind its end."""
    keys: dict[str, list[str]] = {}
    for k in range(first, len(rows)):
        cells = rows[k]
        if cells and cells[0] == _END:
            return keys, k + 1
        if cells and cells[0] and not cells[0].startswith("***"):
            keys[cells[0]] = list(cells[1:])
    return keys, len(rows)


def _segments(rows: Sequence[list[str]]) -> Iterator[_Segment]:
    """Cut what follows the first header into segments: keys, names, rows."""
    at, segment = 0, _Segment()
    while at < len(rows):
        cells = rows[at]
        if cells[0] in ("Channels", "Samples"):
            if segment.rows:
                yield segment
            keys, at = _header(rows, at)
            segment = _Segment(keys=keys)
            continue
        if cells[0].lower().replace(" ", "_") == "x_value":
            segment.names = cells
        elif any(cells) and not cells[0].startswith("***"):
            segment.rows.append(cells)
        at += 1
    if segment.rows:
        yield segment


def _blocks(
    source: str, segment: _Segment, columns: str, comma: bool, option: float | None, notes: list[str]
) -> list[_Block]:
    """Return the blocks of a segment; a header that announces fewer rows than follow may stand for several."""
    comma = comma or any("," in cell for cell in segment.rows[0]) and "." not in "".join(segment.rows[0])
    width = max(len(cells) for cells in segment.rows[:64])
    count = _channels(segment, columns, width)
    every = 2 if columns == "multi" else 1
    at = [1 + every * k for k in range(count)]
    need = at[-1] + 1
    kept = [cells for cells in segment.rows if len(cells) > 1]
    if kept and len(kept[-1]) < need:
        kept = kept[:-1]
        notes.append("the last row is not whole and was left out: the file ends early")
    table = np.array([[_value(cells[k], comma) if k < len(cells) else np.nan for k in at] for cells in kept])
    table = table.reshape(-1, count)
    if len(table) < 2:
        rule = f"a LabVIEW measurement with at least two rows of numbers ({len(table)} found)"
        raise InputError("file", source, rule)
    names = tuple((segment.names[k] if k < len(segment.names) else "") or f"ch{n}" for n, k in enumerate(at))
    units = tuple(_cell(segment.keys.get("Y_Unit_Label"), n) for n in range(count))
    _only_time(source, segment)
    rate, table, group = _rate(source, segment, columns, comma, kept, table, option, notes)
    names, units = (tuple(words[k] for k in group) for words in (names, units))
    return [_Block(rate, names, units, part) for part in _parts(segment, table, notes)]


def _value(cell: str, comma: bool) -> float:
    found = number(cell, comma)
    return np.nan if found is None else found


def _cell(cells: Sequence[str] | None, n: int) -> str:
    return cells[n] if cells is not None and n < len(cells) else ""


def _channels(segment: _Segment, columns: str, width: int) -> int:
    stated = number(_cell(segment.keys.get("Channels"), 0), False)
    named = [name for name in segment.names[1:] if name and name.lower() not in ("comment", "x_value")]
    count = int(stated) if stated else len(named) or (width // 2 if columns == "multi" else width - 1)
    return max(1, min(count, width // 2 if columns == "multi" else width - 1))


def _only_time(source: str, segment: _Segment) -> None:
    what = _cell(segment.keys.get("X_Dimension"), 0)
    if what.lower() not in _TIMES:
        raise InputError("file", source, f"a recording over time (its X_Dimension is {what})")


def _rate(
    source: str, segment: _Segment, columns: str, comma: bool, rows: Sequence[Sequence[str]], table: Floats,
    option: float | None, notes: list[str],
) -> tuple[float, Floats, list[int]]:  # fmt: skip
    """Return the rate (Hz), the samples on its grid, and which channels have it."""
    steps = [number(cell, comma or "," in cell) for cell in segment.keys.get("Delta_X", [])[: table.shape[1]]]
    rates = [1.0 / step if step and step > 0.0 else None for step in steps]
    everything = list(range(table.shape[1]))
    told = next((rate for rate in rates if rate), None)
    if columns != "no" and len(rows[0]) > 1 and rows[0][0]:
        time = np.array([_value(cells[0], comma) for cells in rows])
        if np.isfinite(time).all() and np.ptp(time) > 0.0:
            rate, table = even(source, time, table, notes)
            return rate, table, everything
    if told is None:
        if option is None:
            raise InputError("rate-hz", None, f"given: {source} has neither Delta_X nor a column of time")
        return option, table, everything
    if option is not None and not same_rate(option, told):
        raise InputError("rate-hz", option, f"the rate in {source} (Delta_X: {told:.6g} Hz), or left out")
    group = [k for k in everything if k >= len(rates) or rates[k] is None or same_rate(rates[k] or told, told)]
    if len(group) < len(everything):
        count = len(everything) - len(group)
        notes.append(f"{count} channels have another rate than {told:.6g} Hz; they were left out")
        table = table[:, group]
    whole = np.isfinite(table).any(axis=1)
    return told, table[: int(np.flatnonzero(whole).max(initial=0)) + 1], group


def _parts(segment: _Segment, table: Floats, notes: list[str]) -> list[Floats]:
    """Cut a table at the seams of blocks of which only the first has a header, if the signal breaks there."""
    told = number(_cell(segment.keys.get("Samples"), 0), False)
    size = int(told or 0)
    if not 2 * _SEAM <= size < len(table):
        return [table]
    seams = list(range(size, len(table) - _SEAM, size))
    broken = sum(_breaks(table, seam) for seam in seams)
    if not seams or broken < 0.5 * len(seams):
        return [table]
    notes.append(f"one header stands for {len(seams) + 1} blocks of {size} samples; the signal breaks between them")
    return [table[k : k + size] for k in range(0, len(table), size)]


def _breaks(table: Floats, seam: int) -> bool:
    """Whether a channel jumps at a seam, or moves otherwise behind it than before it."""
    before, after = np.diff(table[seam - _SEAM : seam], axis=0), np.diff(table[seam : seam + _SEAM], axis=0)
    sizes = [np.sqrt(np.mean(part**2, axis=0)) + 1e-300 for part in (before, after)]
    jump = np.abs(table[seam] - table[seam - 1])
    return bool((jump > 8.0 * np.maximum(*sizes)).any() or (np.abs(np.log(sizes[0] / sizes[1])) > np.log(_BREAK)).any())


def _joined(source: str, blocks: list[_Block], notes: list[str]) -> Recording:
    first = blocks[0]
    same = [b for b in blocks if b.names == first.names and same_rate(b.rate_hz, first.rate_hz)]
    if len(same) < len(blocks):
        notes.append(f"{len(blocks) - len(same)} of {len(blocks)} segments have other channels and were left out")
    if len(same) > 1:
        notes.append(f"{len(same)} segments were joined, with one missing sample between them")
    gap = np.full((1, len(first.names)), np.nan)
    parts = [part for block in same for part in (block.samples, gap)][:-1]
    return Recording(
        source=source, rate_hz=first.rate_hz, names=first.names, units=first.units, samples=np.vstack(parts),
        notes=tuple(notes),
    )  # fmt: skip
