"""Recordings as tables: one row for each sample, block or message, the unit in the name of each column.

A topic of samples gives two tables, one with a row for each sample and one with a row for each block. Nothing is held
in memory but a few thousand rows.
"""

from __future__ import annotations

import json
import math
import pathlib
import types
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass, field
from typing import Any, Literal, Union, get_args, get_origin

import msgspec
import numpy as np

from services.errors import InputError, RefusalError
from services.messages import TOPICS, Floats, Message
from services.recording_file import RecordingReader
from services.table_files import WRITERS, Columns, Kind, Kinds, TableFile

BATCH_ROWS = 20_000
INDICES = ("first_sample", "sample", "issued_sample")
"""Fields that say of which sample a message speaks."""
_TIMES: Kinds = {"received_s": "float", "time_s": "float"}


@dataclass(slots=True)
class Converted:
    """What was written.

    Attributes
    ----------
    tables
        Of each: topic, file, rows, columns.
    notes
        What the recording lacks.
    written
        Files.
    """

    tables: list[dict[str, Any]] = field(default_factory=list[dict[str, Any]])
    notes: list[str] = field(default_factory=list[str])
    written: list[pathlib.Path] = field(default_factory=list[pathlib.Path])


def check_format(name: str) -> str:
    """Return a format that can be written."""
    if name not in WRITERS:
        raise InputError("to", name, f"one of {', '.join(WRITERS)}")
    return name


def convert(
    path: pathlib.Path, to: str, folder: pathlib.Path, topics: frozenset[str] = frozenset(),
    progress: Callable[[float], None] = lambda _: None,
) -> Converted:  # fmt: skip
    """Write the topics of a recording as tables into a folder, and `recording.json` with what was run.

    Parameters
    ----------
    path
        Recording.
    to
        `parquet`, `csv` or `hdf5`.
    folder
        Where to; tables that are there are replaced.
    topics
        Which; none: all.
    progress
        Told the time up to which the recording was read (s).

    Raises
    ------
    RefusalError
        If nothing on these topics can be read.
    """
    suffix, begin = WRITERS[check_format(to)]
    reader, tables, done = RecordingReader(path), dict[str, _Table](), Converted()
    rate_hz: float | None = None
    try:
        with ExitStack() as stack:
            for topic, message, time_ns in reader.messages():
                rate_hz = getattr(message, "sample_rate_hz", rate_hz or _rate_told(reader.metadata))
                progress(time_ns / 1e9)
                for name, kinds, rows in _rows(topic, message, time_ns / 1e9, rate_hz):
                    if topics and topic not in topics:
                        continue
                    if name not in tables:
                        folder.mkdir(parents=True, exist_ok=True)
                        file = begin(folder / f"{name}{suffix}", kinds, {"topic": topic, **reader.metadata})
                        tables[name] = stack.enter_context(_Table(topic, file, kinds))
                    tables[name].add(rows)
        done.notes = reader.notes
        if not tables:
            raise RefusalError(
                f"{path} holds nothing that can be read" + (f" on {', '.join(sorted(topics))}" if topics else ""),
                {"file": str(path), "tables": [], "notes": done.notes},
            )
        done.tables = [table.told() for table in tables.values()]
        done.written = [table.file.path for table in tables.values()]
        done.written.append(_describe(folder / "recording.json", reader, done))
    except OSError as error:
        raise InputError("out", str(folder), f"a folder that can be written to ({error.strerror or error})") from error
    return done


class _Table:
    """Gathers rows, and hands them to the file in large pieces."""

    def __init__(self, topic: str, file: TableFile, kinds: Kinds) -> None:
        self.topic, self.file, self.rows = topic, file, 0
        self._kinds, self._pieces, self._waiting = kinds, list[Columns](), 0

    def __enter__(self) -> _Table:
        return self

    def __exit__(self, *_: object) -> None:
        try:
            self._flush()
        finally:
            self.file.close()

    def add(self, columns: Columns) -> None:
        """Add rows."""
        self._pieces.append(columns)
        self._waiting += len(next(iter(columns.values())))
        if self._waiting >= BATCH_ROWS:
            self._flush()

    def _flush(self) -> None:
        if self._pieces:
            self.file.write({name: _joined([piece[name] for piece in self._pieces]) for name in self._kinds})
            self.rows += self._waiting
            self._pieces, self._waiting = [], 0

    def told(self) -> dict[str, Any]:
        """Return what the table is, for JSON."""
        return {"topic": self.topic, "file": self.file.path.name, "rows": self.rows, "columns": list(self._kinds)}


def _joined(parts: list[Any]) -> Any:
    if isinstance(parts[0], np.ndarray):
        return np.concatenate(parts)
    return [value for part in parts for value in part]


def _rate_told(metadata: dict[str, str]) -> float | None:
    """Return the sampling rate in the configuration (Hz), for what was said before the first block."""
    try:
        return float(json.loads(metadata.get("config", ""))["case"]["sample_rate_hz"])
    except (ValueError, TypeError, KeyError):
        return None


def _rows(
    topic: str, message: Message, received_s: float, rate_hz: float | None
) -> Iterator[tuple[str, Kinds, Columns]]:
    """Yield name, columns and rows of each table that a message gives rows to."""
    plain, arrays = _PLAIN[type(message)], _ARRAYS[type(message)]
    name = topic.replace("/", "_")
    sample = next((getattr(message, index) for index in INDICES if hasattr(message, index)), None)
    rows: Columns = {
        "received_s": [received_s],
        "time_s": [None if sample is None or rate_hz is None else sample / rate_hz],
        **{column: [_cell(getattr(message, column))] for column in plain},
    }
    if not arrays:
        yield name, _TIMES | plain, rows
        return
    values: list[Floats] = [getattr(message, array) for array in arrays]
    samples = (sample or 0) + np.arange(values[0].size)
    rate = getattr(message, "sample_rate_hz", math.nan)
    kinds: Kinds = {"time_s": "float", "sample": "int", **dict.fromkeys(arrays, "float")}
    yield name, kinds, {"time_s": samples / rate, "sample": samples, **dict(zip(arrays, values, strict=True))}
    yield f"{name}_blocks", _TIMES | plain, rows


def _cell(value: Any) -> Any:
    """Return what a cell can hold: what has parts becomes JSON."""
    if value is None or isinstance(value, bool | int | float | str):
        return value
    return msgspec.json.encode(value).decode()


def _kind(annotation: Any) -> Kind:
    """Return what a column of a type holds."""
    if get_origin(annotation) in (Union, types.UnionType):
        some: list[Kind] = [_kind(option) for option in get_args(annotation) if option is not type(None)]
        return some[0] if len(set(some)) == 1 else "text"
    known: dict[Any, Kind] = {int: "int", float: "float", bool: "bool"}
    return "text" if get_origin(annotation) is Literal else known.get(annotation, "text")


_PLAIN: dict[type[Message], Kinds] = {
    kind: {f.name: _kind(f.type) for f in msgspec.structs.fields(kind) if f.type != Floats} for kind in TOPICS.values()
}
_ARRAYS = {kind: tuple(f.name for f in msgspec.structs.fields(kind) if f.type == Floats) for kind in TOPICS.values()}


def _describe(path: pathlib.Path, reader: RecordingReader, done: Converted) -> pathlib.Path:
    """Write what was run and which tables there are."""
    told: dict[str, Any] = dict(reader.metadata)
    try:
        told["config"] = json.loads(told.get("config", "null"))
    except ValueError:
        done.notes.append("the configuration in the recording is damaged")
    known = {"recording": reader.path.name, "run": told, "tables": done.tables, "notes": done.notes}
    path.write_text(json.dumps(known, indent=1) + "\n", encoding="utf-8")
    return path
