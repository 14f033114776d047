"""What has been done of a commissioning, in one JSON file that is there whole or not at all, and the case it makes."""

from __future__ import annotations

import json
import os
import pathlib
from dataclasses import dataclass, field
from typing import Any

from services.config import Case, shipped
from services.errors import InputError

FORMAT = 1
STATE, MACHINE = "commission.json", "machine.toml"
Values = dict[str, tuple[Any, str]]
"""Key of a case with its table -> value and origin."""


@dataclass(slots=True, kw_only=True)
class Done:
    """A step that was carried out.

    Attributes
    ----------
    good
        Whether the next one may follow.
    words
        One line for each thing found.
    values
        What it changes in the case.
    """

    good: bool
    words: list[str]
    values: Values = field(default_factory=dict[str, tuple[Any, str]])


@dataclass(slots=True, kw_only=True)
class State:
    """Steps done, by name, and the one that was under way when everything ended."""

    case: str
    digest: str
    steps: dict[str, Done] = field(default_factory=dict[str, Done])
    running: str = ""


def load_state(folder: pathlib.Path, name: str, case: Case) -> State:
    """Return what was done in a folder, or a beginning.

    Parameters
    ----------
    folder
        Where the file is.
    name
        The case as on the command line.
    case
        The same case.

    Raises
    ------
    InputError
        If the file cannot be read, or belongs to another case.
    """
    path = folder / STATE
    if not path.exists():
        return State(case=name, digest=case.digest)
    try:
        kept = json.loads(path.read_text(encoding="utf-8"))
        if kept["format"] != FORMAT:
            raise ValueError(f"format {kept['format']!r:.20}")
        steps = {str(step): _done(done) for step, done in kept["steps"].items()}
        state = State(case=str(kept["case"]), digest=str(kept["digest"]), steps=steps, running=str(kept["running"]))
    except (OSError, ValueError, LookupError, TypeError, AttributeError) as error:
        rule = f"a folder whose {STATE} can be read, or has none ({type(error).__name__}: {error})"
        raise InputError("out", str(folder), rule) from error
    if state.digest != case.digest:
        rule = f"as it was when {path} was begun ({state.case}); choose another --out for a new one"
        raise InputError("case", name, rule)
    return state


def _done(kept: dict[str, Any]) -> Done:
    values = {str(key): (value, str(origin)) for key, (value, origin) in kept["values"].items()}
    return Done(good=bool(kept["good"]), words=[str(word) for word in kept["words"]], values=values)


def save_state(folder: pathlib.Path, state: State) -> None:
    """Replace the file."""
    steps = {
        name: {"good": done.good, "words": done.words, "values": {key: list(one) for key, one in done.values.items()}}
        for name, done in state.steps.items()
    }
    kept = {
        "format": FORMAT, "case": state.case, "digest": state.digest, "running": state.running, "steps": steps,
    }  # fmt: skip
    replace_file(folder / STATE, json.dumps(kept, indent=1, allow_nan=False) + "\n")


def replace_file(path: pathlib.Path, text: str) -> None:
    """Write a file that is the old one or the new one, whenever the power fails."""
    draft = path.with_name(path.name + ".draft")
    with draft.open("w", encoding="utf-8") as file:
        file.write(text)
        file.flush()
        os.fsync(file.fileno())
    draft.replace(path)


def write_machine(folder: pathlib.Path, state: State) -> pathlib.Path:
    """Write the case that the steps make of the one that was begun with; every value says where it is from."""
    tables: dict[str, list[str]] = {}
    for done in state.steps.values():
        for key, (value, origin) in done.values.items():
            table, _, last = key.rpartition(".")
            tables.setdefault(table, []).append(f"{last} = {json.dumps(value)}  # {_line(origin)}")
    base = state.case if state.case in shipped() else str(pathlib.Path(state.case).resolve())
    lines = [f"# The machine of {_line(state.case)} as commissioned: what is not here is as there.",
             f"extends = {json.dumps(base)}"]  # fmt: skip
    for table, rows in tables.items():
        lines += ["", f"[{table}]", *rows]
    path = folder / MACHINE
    replace_file(path, "\n".join(lines) + "\n")
    return path


def _line(text: str) -> str:
    return " ".join(text.split())
