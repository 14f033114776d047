"""From one TOML table to one frozen parameter object: every key required, every unit in the key."""

from __future__ import annotations

import dataclasses
import difflib
import math
import re
import typing
from collections.abc import Mapping
from typing import Any, TypeVar

from services.errors import InputError
from services.units import SI

T = TypeVar("T")
_RULE = re.compile(r"^(\w+) must be (.+?),? got (.+)$", re.DOTALL)


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class Section:
    """How a table becomes an object of type `kind`.

    Attributes
    ----------
    kind
        Frozen dataclass that holds and checks the parameters in SI.
    units
        Unit of each field that has one (`{"diameter": "mm"}` reads the key `diameter_mm`). Fields with no entry are
        read under their own name as they are (words, whole numbers, ratios).
    given
        Fields that the caller fills in (objects built from other tables).
    renamed
        Fields that a file calls by another word (`spindle_hz` is a `spindle_speed` in rpm there).
    """

    kind: type[Any]
    units: Mapping[str, str]
    given: tuple[str, ...] = ()
    renamed: Mapping[str, str] = dataclasses.field(default_factory=dict)

    def keys(self) -> dict[str, str]:
        """Return TOML key -> field name."""
        names = [f.name for f in dataclasses.fields(self.kind) if f.name not in self.given]
        return {self._key(name): name for name in names}

    def _key(self, name: str) -> str:
        shown = self.renamed.get(name, name)
        return f"{shown}_{self.units[name]}" if name in self.units else shown


def read_section(table: Mapping[str, Any], where: str, section: Section, **given: Any) -> Any:
    """Build the object of `section` from `table`.

    Parameters
    ----------
    table
        The keys as parsed from TOML.
    where
        Name of the table, for the messages.
    section
        What is expected there.
    **given
        Values for the fields in `section.given`.

    Raises
    ------
    InputError
        Naming key, value and rule: unknown, missing, wrong type, not finite, out of range.
    """
    keys = section.keys()
    for key in table:
        if key not in keys:
            raise InputError(f"{where}.{key}", table[key], f"a key of [{where}]" + _hint(key, keys))
    types = typing.get_type_hints(section.kind)
    values: dict[str, Any] = {}
    for key, name in keys.items():
        if key not in table and type(None) in typing.get_args(types[name]):
            values[name] = None
            continue
        if key not in table:
            raise InputError(f"{where}.{key}", None, f"given in [{where}]")
        values[name] = _value(table[key], f"{where}.{key}", types[name], section.units.get(name))
    try:
        return section.kind(**values, **given)
    except ValueError as error:
        raise _translated(error, table, where, keys) from error


def _value(raw: Any, field: str, kind: Any, unit: str | None) -> Any:
    if type(None) in typing.get_args(kind):
        (kind,) = (part for part in typing.get_args(kind) if part is not type(None))
    choices = typing.get_args(kind) if typing.get_origin(kind) is typing.Literal else ()
    if choices and raw not in choices:
        raise InputError(field, raw, f"one of {', '.join(repr(choice) for choice in choices)}")
    if choices:
        return raw
    for exact, rule in ((bool, "true or false"), (str, "a text in quotes"), (int, "a whole number")):
        if kind is exact and type(raw) is not exact:
            raise InputError(field, raw, rule)
        if kind is exact:
            return raw
    if typing.get_origin(kind) is tuple:
        items = typing.get_args(kind)
        if typing.get_origin(items[0]) is typing.Literal:
            return _words(raw, field, items[0])
        return _numbers(raw, field, kind, unit)
    return _number(raw, field, unit)


def _numbers(raw: Any, field: str, kind: Any, unit: str | None) -> tuple[float, ...]:
    items = typing.get_args(kind)
    count = None if Ellipsis in items else len(items)
    if not isinstance(raw, list) or not raw or (count is not None and len(raw) != count):
        raise InputError(field, raw, f"a list of {count or 'some'} numbers in square brackets")
    return tuple(_number(item, field, unit) for item in raw)


def _words(raw: Any, field: str, kind: Any) -> tuple[Any, ...]:
    if not isinstance(raw, list):
        raise InputError(field, raw, "a list of words in square brackets")
    return tuple(_value(item, field, kind, None) for item in raw)


def _number(raw: Any, field: str, unit: str | None) -> float:
    if isinstance(raw, bool) or not isinstance(raw, int | float) or not math.isfinite(raw):
        raise InputError(field, raw, f"a finite number{f' ({unit})' if unit else ''}")
    return float(raw) * SI[unit] if unit else float(raw)


def _hint(key: str, keys: Mapping[str, str]) -> str:
    same = [known for known, name in keys.items() if key.startswith(name + "_") or key == name]
    if same:
        return f" (the unit is part of the key: {same[0]})"
    near = difflib.get_close_matches(key, list(keys), n=1)
    return f" (did you mean {near[0]}?)" if near else f" (known: {', '.join(keys)})"


def _translated(error: ValueError, table: Mapping[str, Any], where: str, keys: Mapping[str, str]) -> InputError:
    """Say a rule of the SI object in the words and the unit of the file."""
    match = _RULE.match(str(error))
    name = match.group(1) if match else ""
    key = next((key for key, field in keys.items() if field == name), "")
    if not match or not key:
        return InputError(where, None, str(error))
    unit = next((unit for unit in sorted(SI, key=len, reverse=True) if key.endswith("_" + unit)), "")
    suffix = f" (the rule is in SI units, this key in {unit})" if unit and SI[unit] != 1.0 else ""
    return InputError(f"{where}.{key}", table.get(key), match.group(2) + suffix)


def closest(word: str, known: list[str]) -> str:
    """Return a hint such as `; did you mean 'thesis-652'?`, or nothing."""
    near = difflib.get_close_matches(word, known, n=1)
    return f"; did you mean {near[0]!r}?" if near else ""
