"""From the arrays in a file to a recording: which are the signal, where its rate or its time is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from services.errors import InputError
from services.importers.channels import ASIDE, answers_to, rank_of
from services.importers.recording import Recording
from services.importers.room import room, slices, whole_share
from services.importers.timebase import epoch_seconds, even, same_rate
from services.importers.vocabulary import is_index, is_time, rate_from, seconds_per, split_unit, words
from services.messages import Floats

_MOST_COLUMNS = 64
_MOST_TOLD = 12
_MOST_RUNS = 8
"""Structs of an array that may still be the channels of one recording."""
_LEAST_SHARE = 0.01
"""A group of channels shorter than this part of the longest is no recording."""


@dataclass(slots=True)
class Contents:
    """What a file holds, by dotted names.

    Attributes
    ----------
    arrays
        Vectors and matrices of real numbers.
    numbers
        Single numbers, attributes among them.
    labels
        Lists of words: names of columns.
    units
        Of the arrays that tell theirs.
    skipped
        What was left out and why, in words.
    notes
        What a reader should know.
    """

    arrays: dict[str, np.ndarray] = field(default_factory=dict[str, np.ndarray])
    numbers: dict[str, float] = field(default_factory=dict[str, float])
    labels: dict[str, list[str]] = field(default_factory=dict[str, list[str]])
    units: dict[str, str] = field(default_factory=dict[str, str])
    skipped: list[str] = field(default_factory=list[str])
    notes: list[str] = field(default_factory=list[str])

    def add(self, name: str, value: Any) -> None:
        """Keep an array, a number or words; say what is left out."""
        array = np.squeeze(np.asarray(value))
        if array.dtype.kind in "USO":
            if array.size and all(isinstance(item, str | bytes) for item in array.ravel()[:_MOST_COLUMNS]):
                self.labels[name] = [_text(item) for item in array.ravel()]
        elif array.dtype.kind == "c":
            self.skipped.append(f"{name} (complex)")
        elif array.dtype.kind not in "biuf" or array.size == 0:
            self.skipped.append(f"{name} ({'empty' if array.size == 0 else array.dtype})")
        elif array.ndim == 0:
            self.numbers[name] = float(array)
        elif array.ndim == 1 or (array.ndim == 2 and min(array.shape) <= _MOST_COLUMNS):
            self.arrays[name] = array
        else:
            self.skipped.append(f"{name} ({' x '.join(map(str, array.shape))})")


@dataclass(frozen=True, slots=True)
class _Column:
    name: str
    unit: str
    values: np.ndarray

    @property
    def size(self) -> int:
        return int(self.values.size)

    @property
    def last(self) -> str:
        return self.name.rsplit(".", 1)[-1]


def recording_of(source: str, contents: Contents, rate_hz: float | None, wanted: Sequence[str]) -> Recording:
    """Guess which arrays are the channels of a recording and what their rate is, and say what was guessed.

    Channels are arrays of one length; with several lengths those of a wanted channel, or else of the vibration.

    Parameters
    ----------
    source
        The file.
    contents
        What it holds.
    rate_hz
        Sampling rate (Hz) for files that do not tell; a contradiction is an error.
    wanted
        Names of channels.
    """
    columns = [column for name, array in contents.arrays.items() for column in _columns(name, array, contents)]
    clocks = [column for column in columns if _is_clock(column)]
    signals = [column for column in columns if column not in clocks and not _counts_rows(column)]
    notes = list(contents.notes)
    group = _group(source, signals, contents, wanted, notes)
    clock = max((c for c in clocks if c.size == group[0].size), key=lambda c: _kinship(c, group), default=None)
    stated = _stated(contents, group, notes)
    step = _even_step(group[0]) if clock is None and len(group) > 1 and group[0].name.endswith("[0]") else None
    if step is not None:
        clock, group = _leading(group, step, stated[1] if stated else rate_hz, notes)
    samples = _stacked(group)
    rate, samples = _rate(source, clock, stated, rate_hz, samples, notes, contents, group)
    missing = whole_share(samples)
    if missing:
        notes.append(f"{missing} of {len(samples)} samples are not finite numbers and count as gaps")
    names = tuple(column.name for column in group)
    units = tuple(column.unit for column in group)
    return Recording(
        source=source, rate_hz=rate, names=names, units=units, samples=samples, notes=tuple(notes),
        numbers=dict(contents.numbers),
    )  # fmt: skip


def _stacked(group: Sequence[_Column]) -> Floats:
    """Return the channels side by side, shape (n, channels), piece by piece."""
    samples = room(group[0].size, len(group))
    for part in slices(len(samples)):
        for k, column in enumerate(group):
            samples[part, k] = column.values[part]
    whole_share(samples)
    return samples


def _columns(name: str, array: np.ndarray, contents: Contents) -> list[_Column]:
    """Return the channels in an array: the longer side is time."""
    unit = contents.units.get(name, "")
    if array.ndim == 1:
        bare, own = split_unit(name)
        return [_Column(name if unit or not own else bare, unit or own, array)]
    matrix = array if array.shape[0] >= array.shape[1] else array.T
    fitting = (said for key, said in contents.labels.items() if len(said) == matrix.shape[1] and _shares(key, name))
    labels = next(fitting, None)
    if labels is None:
        return [_Column(f"{name}[{k}]", unit, column) for k, column in enumerate(matrix.T)]
    named = [split_unit(label) for label in labels]
    return [_Column(bare, unit or own, column) for (bare, own), column in zip(named, matrix.T, strict=True)]


def _is_clock(column: _Column) -> bool:
    values = column.values
    return is_time(column.last) and bool((np.diff(values) >= 0).all()) and bool(values[-1] > values[0])


def _counts_rows(column: _Column) -> bool:
    return is_index(column.last) and bool((np.diff(column.values) == 1).all())


def _group(
    source: str, signals: Sequence[_Column], contents: Contents, wanted: Sequence[str], notes: list[str]
) -> list[_Column]:
    """Return the channels of one length."""
    found = ", ".join(f"{column.name} ({column.size})" for column in signals[:_MOST_TOLD])
    for name in wanted:
        out = [text for text in contents.skipped if text.rsplit(" (", 1)[0].endswith(name)]
        if out and not any(answers_to(c.name, c.unit, name) for c in signals):
            raise InputError("channel", name, f"a channel of real numbers in {source}: {out[0]}")
    signals = [column for column in signals if column.size > 1]
    if not signals:
        what = f"; it holds {', '.join(contents.skipped[:_MOST_TOLD])}" if contents.skipped else ""
        raise InputError("file", source, f"a file with arrays of real numbers{what}")
    longest = max(column.size for column in signals)
    lengths = {column.size for column in signals if column.size >= _LEAST_SHARE * longest}
    signals = _one_run(signals, wanted, notes)
    asked = [c.size for c in signals if any(answers_to(c.name, c.unit, name) for name in wanted)]
    best = {size: min(rank_of(c.name, c.unit) for c in signals if c.size == size) for size in lengths}
    size = asked[0] if asked else min(lengths, key=lambda length: (min(best[length], ASIDE), -length))
    group = [column for column in signals if column.size == size]
    if len(lengths) > 1:
        notes.append(f"the file holds channels of several lengths ({found}); those of {size} samples were taken")
    return group


def _one_run(signals: list[_Column], wanted: Sequence[str], notes: list[str]) -> list[_Column]:
    """Return the channels of one run, where a file holds an array of structs with the same fields for many."""
    runs: dict[str, list[_Column]] = {}
    for column in signals:
        head, found, _ = column.name.partition("].")
        runs.setdefault(head + found if found else "", []).append(column)
    if len(runs) <= _MOST_RUNS:
        return signals
    asked = next((run for run, columns in runs.items() if {c.name for c in columns} & set(wanted)), next(iter(runs)))
    notes.append(f"the file holds {len(runs)} runs; {asked[:-1] or 'the first'} was taken: --channel names another")
    return runs[asked]


def _kinship(column: _Column, group: Sequence[_Column]) -> int:
    return _common(column.name, group[0].name)


def _common(one: str, other: str) -> int:
    """Return how many parts two dotted names have in common from the left."""
    parts = list(zip(one.split("."), other.split("."), strict=False))
    return next((k for k, (a, b) in enumerate(parts) if a != b), len(parts))


def _shares(key: str, name: str) -> bool:
    """Whether two names lie in the same group."""
    return key.rpartition(".")[0] in (name.rpartition(".")[0], name)


def _stated(contents: Contents, group: Sequence[_Column], notes: list[str]) -> tuple[str, float] | None:
    """Return the name and value (Hz) of the rate that stands nearest to the channels."""
    rates = {name: rate_from(name.rsplit(".", 1)[-1], value) for name, value in contents.numbers.items()}
    known = {name: rate for name, rate in rates.items() if rate is not None}
    if not known:
        return None
    name = max(known, key=lambda key: _nearness(key, group[0].name))
    others = [f"{key} {rate:g} Hz" for key, rate in known.items() if not same_rate(rate, known[name])]
    if others:
        notes.append(f"the file states several rates; {name} {known[name]:g} Hz was taken, not {', '.join(others)}")
    return name, known[name]


def _nearness(key: str, channel: str) -> tuple[int, int, int]:
    """Return how near a rate stands to a channel: same group, same first words, and else the fewest words."""
    own, other = words(key.rsplit(".", 1)[-1]), words(channel.rsplit(".", 1)[-1])
    alike = next((k for k, (a, b) in enumerate(zip(own, other, strict=False)) if a != b), min(len(own), len(other)))
    return _common(key, channel), alike, -len(own)


def _even_step(column: _Column) -> float | None:
    step = np.diff(column.values.astype(np.float64))
    period = float(np.median(step))
    return period if period > 0.0 and bool((np.abs(step - period) <= 0.01 * period).all()) else None


def _leading(
    group: list[_Column], step: float, rate_hz: float | None, notes: list[str]
) -> tuple[_Column | None, list[_Column]]:
    """Return the first column of a matrix as time, or without it if it counts the rows."""
    first, others = group[0], group[1:]
    if step == 1.0 and rate_hz != 1.0:
        return None, others
    if rate_hz is not None and not any(same_rate(1.0 / (step * unit), rate_hz) for unit in (1.0, 1e-3, 1e-6)):
        return None, group
    notes.append(f"{first.name} rises evenly and was taken for the time")
    return first, others


def _rate(
    source: str, clock: _Column | None, stated: tuple[str, float] | None, option: float | None, samples: Floats,
    notes: list[str], contents: Contents, group: Sequence[_Column],
) -> tuple[float, Floats]:  # fmt: skip
    """Return the rate (Hz) and the samples on its grid."""
    told: tuple[str, float] | None = stated
    if clock is not None:
        unit = seconds_per(clock.last, clock.unit)
        time = epoch_seconds(clock.values) * (unit or 1.0)
        rate, samples = even(source, time, samples, notes)
        known = stated[1] if stated else option
        if unit is None and known is not None:
            rate = next((rate / f for f in (1.0, 1e-3, 1e-6, 1e-9) if same_rate(rate / f, known)), rate)
        told = clock.name, rate
        if stated is not None and not same_rate(stated[1], rate):
            notes.append(f"{stated[0]} says {stated[1]:g} Hz, {clock.name} {rate:.6g} Hz; the time counts")
    if told is None and option is None:
        listed = ", ".join([f"{c.name} ({c.size})" for c in group[:_MOST_TOLD]] + list(contents.numbers)[:_MOST_TOLD])
        rule = "given: {} holds {}, but neither a time (t, time ...) nor a rate (fs, sample_rate, dt ...)"
        raise InputError("rate-hz", None, rule.format(source, listed))
    if told is None or option is not None and same_rate(option, told[1]):
        return float(option or 0.0), samples
    if option is not None:
        raise InputError("rate-hz", option, f"the rate in {source} ({told[0]}: {told[1]:.6g} Hz), or left out")
    notes.append(f"the rate is that of {told[0]}")
    return told[1], samples


def _text(item: str | bytes) -> str:
    return item.decode("utf-8", errors="replace") if isinstance(item, bytes) else item
