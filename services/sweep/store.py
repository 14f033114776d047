"""Finished cells in a file that survives a kill: one line each, appended as they come."""

from __future__ import annotations

import json
import math
import os
import pathlib
from collections.abc import Iterable
from typing import Any

from services.errors import InputError
from services.sweep.cell import Result

FILE = "cells.jsonl"


class Store:
    """Results by the number of their cell.

    Parameters
    ----------
    path
        Folder of the sweep, or None to keep results in memory alone.
    header
        What makes the sweep what it is: case, axes, mode, seed. Another one in the folder is refused.
    fresh
        Begin anew even if there is one.
    """

    def __init__(self, path: pathlib.Path | None, header: dict[str, Any], *, fresh: bool = False) -> None:
        self.results: dict[int, Result] = {}
        self.damaged = 0
        self._file = None
        if path is None:
            return
        file = path / FILE
        if file.exists() and not fresh:
            self._read(file, header)
        part = file.with_suffix(".part")
        with part.open("w", encoding="utf-8") as out:  # what can be read is written anew, the rest is computed again
            out.write(json.dumps(header) + "\n")
            out.writelines(_line(number, result) for number, result in self.results.items())
            out.flush()
            os.fsync(out.fileno())
        part.replace(file)
        self._file = file.open("a", encoding="utf-8")

    def _read(self, file: pathlib.Path, header: dict[str, Any]) -> None:
        lines = file.read_bytes().split(b"\n")
        try:
            known = json.loads(lines[0])
        except ValueError as error:
            raise InputError("out", str(file), "a sweep that can be read, or use --fresh") from error
        if known != json.loads(json.dumps(header)):
            different = [key for key in header if not isinstance(known, dict) or known.get(key) != header[key]]
            raise InputError(
                "out",
                str(file),
                f"a folder without another sweep (it differs in {', '.join(different)}), or use --fresh",
            )
        cells = math.prod(len(values) for _, values in header.get("axes", ()))
        for line in lines[1:]:
            if not line.strip():
                continue
            try:
                entry = json.loads(line)
                number, result = int(entry["cell"]), dict(entry["result"])
            except (ValueError, KeyError, TypeError):
                self.damaged += 1
                continue
            if 0 <= number < cells and _sound(result):
                self.results[number] = result
            else:
                self.damaged += 1

    def add(self, results: Iterable[tuple[int, Result]]) -> None:
        """Keep results; they are on the disk when this returns."""
        for number, result in results:
            self.results[number] = result
            if self._file is not None:
                self._file.write(_line(number, result))
        if self._file is not None:
            self._file.flush()

    def close(self) -> None:
        """Close the file."""
        if self._file is not None:
            self._file.close()
            self._file = None


def _sound(result: Result) -> bool:
    """Whether a result holds what a cell says: numbers or nothing, the reason why it failed, and doubts."""
    words: dict[str, type] = {"failed": str, "doubts": list}
    return all(
        value is None or isinstance(value, words[name] if name in words else bool | int | float)
        for name, value in result.items()
    )


def _line(number: int, result: Result) -> str:
    return json.dumps({"cell": number, "result": result}) + "\n"
