"""Which plant the observations are computed with: the only file of this package that knows there are several."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Literal

from services.config import Case, load_case, replaced

PlantName = Literal["lumped", "surface"]
MODELS: dict[PlantName, dict[str, Any]] = {
    "lumped": {"process.cut": "linear", "process.directions": 1},
    "surface": {"process.cut": "surface", "process.directions": 2},
}
Progress = Callable[[float], None]


def prepared_case(
    plant: PlantName, name: str, changes: dict[str, Any] | None = None, directions: int | None = None
) -> Case:
    """Return a shipped case, with values changed, on the wanted plant.

    Parameters
    ----------
    plant
        `lumped`: one mode and a law linearised about the cut. `surface`: the surface as a map that each tool cuts.
    name
        Of the case.
    changes
        Values that replace those of the file.
    directions
        In which the bar bends; None for those that the plant has.
    """
    bends: dict[str, Any] = {} if directions is None else {"process.directions": directions}
    case = load_case(name, (changes or {}) | MODELS[plant] | bends)
    return replaced(case, foresight=None)  # the publication answers one frequency and believes nothing


def hertz(root: complex) -> float:
    """Return the frequency of a root (Hz)."""
    return abs(root.imag) / (2.0 * math.pi)


def feed_speed(case: Case) -> float:
    """Return how fast both tools travel along the bar (m/s)."""
    return case.cutting.feed_per_rev * case.cutting.spindle_hz
