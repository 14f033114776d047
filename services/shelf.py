"""Where a monitor leaves what it has learned, so that the next one in the same run can go on with it."""

from __future__ import annotations

import hashlib
import json
import os
import pathlib
from typing import Any


class Shelf:
    """One JSON file for each run in a private folder; a file is there whole or not at all.

    Parameters
    ----------
    folder
        Made by whoever starts the monitors, and removed by him.
    """

    def __init__(self, folder: pathlib.Path) -> None:
        self._folder = folder

    def _path(self, run: str) -> pathlib.Path:
        return self._folder / f"{hashlib.sha256(run.encode()).hexdigest()[:32]}.json"

    def save(self, run: str, state: dict[str, Any]) -> None:
        """Replace what is kept of a run."""
        path = self._path(run)
        draft = path.with_suffix(".draft")
        draft.write_text(json.dumps({"run": run, "state": state}, allow_nan=False), encoding="utf-8")
        os.replace(draft, path)

    def load(self, run: str) -> dict[str, Any] | None:
        """Return what is kept of a run, None if nothing is or it cannot be read."""
        try:
            kept = json.loads(self._path(run).read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return None
        fits = isinstance(kept, dict) and kept.get("run") == run and isinstance(kept.get("state"), dict)
        return kept["state"] if fits else None
