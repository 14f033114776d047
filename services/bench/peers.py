"""Peers of the benchmarks that need not be installed."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from importlib import import_module
from importlib.util import find_spec
from typing import Any, NamedTuple

from services.bench.rounds import Row, interleaved, row
from services.clock import CpuClock

CLOCK = CpuClock()
TURN_S = 0.01
"""How long a way is at work in each turn, if a single call does not last longer."""


class Way(NamedTuple):
    """One way of doing something: what is called, and how many units a call does."""

    call: Callable[[], Any]
    units: float


def installed(module: str) -> Any:
    """Return a module, or None if it is not there."""
    return import_module(module) if find_spec(module) is not None else None


def repeated(call: Callable[[], Any], units: float = 1.0) -> Way:
    """Return a way that makes a call so often that its tables and its memory are at hand most of the time."""
    times, took = 1, 0.0
    while took < TURN_S:
        times *= 2
        begin = CLOCK.now()
        _repeat(call, times)
        took = CLOCK.now() - begin
    return Way(partial(_repeat, call, times), times * units)


def _repeat(call: Callable[[], Any], times: int) -> Any:
    found = None
    for _ in range(times):
        found = call()
    return found


def beside(case: str, ours: Way, peers: dict[str, Way | None], rounds: int, scale: float, unit: str) -> list[Row]:
    """Return a row for each peer: time of a unit of ours and of the peer's, in one run.

    Parameters
    ----------
    case
        What is done.
    ours, peers
        The ways; None for what is not installed.
    rounds
        How often each is timed.
    scale
        Units of time in a second.
    unit
        What is written for it.
    """
    ways = {"": ours} | {name: way for name, way in peers.items() if way is not None}
    taken, _ = interleaved({name: way.call for name, way in ways.items()}, rounds, CLOCK)
    each = {name: scale * taken[name] / way.units for name, way in ways.items()}
    return [
        row(f"{case}, beside {name}", each[""], each[name], unit)
        if way is not None
        else row(f"{case}, beside {name} (not installed)", each[""], None, unit)
        for name, way in peers.items()
    ]
