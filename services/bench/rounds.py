"""Time several ways of doing the same, in turn, so that whatever else the machine does hits all of them alike."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from statistics import median
from typing import Any, TypeVar

from services.clock import Clock

T = TypeVar("T")
Row = dict[str, Any]
Say = Callable[[str], None]


def silent(_: str) -> None:
    """Say nothing."""


def interleaved(
    ways: Mapping[str, Callable[[], T]], rounds: int, clock: Clock
) -> tuple[dict[str, float], dict[str, T]]:
    """Return the median time (s) of each way, and what each has found.

    Parameters
    ----------
    ways
        What is timed, by name; each is called once before.
    rounds
        How often each is timed.
    clock
        What times.
    """
    times: dict[str, list[float]] = {name: [] for name in ways}
    found = {name: way() for name, way in ways.items()}
    for _ in range(rounds):
        for name, way in ways.items():
            begin = clock.now()
            way()
            times[name].append(clock.now() - begin)
    return {name: median(taken) for name, taken in times.items()}, found


def row(case: str, ours: float, peer: float | None, unit: str) -> Row:
    """Return a row of a table; without a peer it says what ours does alone."""
    ratio = None if peer is None else (ours / peer if peer else math.inf)
    return {"case": case, "ours": ours, "peer": peer, "ratio": ratio, "unit": unit}
