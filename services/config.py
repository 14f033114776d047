"""Cases: TOML files turned into frozen parameter objects, with units converted and every rule checked."""

from __future__ import annotations

import dataclasses
import hashlib
import importlib.resources
import json
import pathlib
import tomllib
from dataclasses import dataclass
from typing import Any

from services.case_settings import CaseSettings
from services.errors import InputError
from services.sections import build
from services.toml_section import closest


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """Everything that a run needs to know.

    Attributes
    ----------
    name
        Word on the command line, or the stem of the file.
    settings
        How long, how fast, against what the result is measured.
    workpiece, cutting, drives, process
        The plant as it is, and how much of its process is computed.
    limits, path
        What the guard allows, and what the path of the shift uses of it.
    monitor, belief
        Parameters of the monitor, and the drives as it believes them to be.
    planner
        Parameters of the decision.
    foresight
        What the controller believes of bar and cut (`pitch.ProcessBelief`), None when nothing.
    job, room, learned
        Passes without action, what must not come near to each other, and limits that the monitor has learned before;
        None when the file says nothing.
    text, digest
        The resolved file as JSON, and its SHA-256.
    """

    name: str
    settings: CaseSettings
    workpiece: Any
    cutting: Any
    drives: Any
    process: Any
    limits: Any
    path: Any
    monitor: Any
    belief: Any
    planner: Any
    foresight: Any
    job: Any
    room: Any
    learned: Any
    text: str
    digest: str


def shipped() -> dict[str, pathlib.Path]:
    """Return the names of the shipped cases and where they are."""
    folder = pathlib.Path(str(importlib.resources.files("services.configs")))
    return {path.stem: path for path in sorted(folder.glob("*.toml"))}


def load_case(name: str, changes: dict[str, Any] | None = None) -> Case:
    """Return a shipped case, or the one in a TOML file.

    Parameters
    ----------
    name
        Name of a shipped case or path of a file.
    changes
        Values that replace those of the file, as `{"case.seed": 3}`.

    Raises
    ------
    InputError
        Naming the key, its value and the rule that it breaks.
    """
    return _case(name, _resolve(name, ()), changes or {})


def case_from_text(name: str, text: str, changes: dict[str, Any] | None = None) -> Case:
    """Return a case from its resolved tables, as `Case.text` holds them: no file is needed.

    Parameters
    ----------
    name
        Of the case.
    text
        Its tables as JSON.
    changes
        As in `load_case`.
    """
    return _case(name, json.loads(text), changes or {})


def _case(name: str, tables: dict[str, Any], changes: dict[str, Any]) -> Case:
    for key, value in changes.items():
        *path, last = key.split(".")
        table = tables
        for part in path:
            table = table[part]
        table[last] = value
    text = json.dumps(tables, indent=1)
    return Case(
        name=pathlib.Path(name).stem, text=text, digest=hashlib.sha256(text.encode()).hexdigest(), **build(tables)
    )


def _resolve(name: str, below: tuple[str, ...]) -> dict[str, Any]:
    """Read a file and lay it over the one that it extends."""
    known = shipped()
    path = known.get(name) or pathlib.Path(name)
    if name in below:
        raise InputError("extends", name, f"a case that does not extend itself ({' -> '.join((*below, name))})")
    if not path.is_file():
        hint = closest(name, list(known))
        raise InputError("case", name, f"one of {', '.join(known)}, or the path of a TOML file{hint}")
    try:
        tables = tomllib.loads(path.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InputError("case", str(path), f"a readable TOML file ({error})") from error
    parent = tables.pop("extends", None)
    if parent is None:
        return tables
    if not isinstance(parent, str):
        raise InputError("extends", parent, "the name of a case in quotes")
    beside = path.parent / parent
    return _overlay(_resolve(str(beside) if beside.is_file() else parent, (*below, name)), tables)


def _overlay(base: dict[str, Any], top: dict[str, Any]) -> dict[str, Any]:
    merged = dict(base)
    for key, value in top.items():
        both = isinstance(value, dict) and isinstance(base.get(key), dict)
        merged[key] = _overlay(base[key], value) if both else value
    return merged


def replaced(case: Case, **parts: Any) -> Case:
    """Return the case with some of its objects exchanged; tests use it to make belief and truth differ."""
    return dataclasses.replace(case, **parts)
