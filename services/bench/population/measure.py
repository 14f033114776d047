"""The population under both planners, and a part of it in the full closed loop."""

from __future__ import annotations

import math
import multiprocessing
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from typing import Any

from services.bench.population.draw import Process, population_process
from services.bench.population.trial import MOST_MOVES, Trial, try_process
from services.bench.rounds import Row, row
from services.clock import WallClock
from services.closed_loop import judge, run_loop
from services.messages import Event

Progress = Callable[[float], None]
GROWN_S = 0.8
"""How long the chatter grows before the planner may act, in the harder half."""
WAYS = (("heard at its onset", 0.0), ("grown for 0.8 s", GROWN_S))


@dataclass(frozen=True, slots=True, kw_only=True)
class Size:
    """How many processes, and how many of them in the full loop."""

    processes: int
    loops: int


SHORT, LONG = Size(processes=60, loops=6), Size(processes=500, loops=40)


@dataclass(frozen=True, slots=True, kw_only=True)
class Tried:
    """What became of one process: foreseen and by the rule, for each of `WAYS`."""

    number: int
    growth: float
    trials: tuple[tuple[Trial, Trial], ...]


def try_number(number: int, seed: int) -> Tried:
    """Return all trials of one process."""
    process = population_process(seed, number)
    trials = tuple(
        (try_process(process, foresight=True, grown_s=grown), try_process(process, foresight=False, grown_s=grown))
        for _, grown in WAYS
    )
    return Tried(number=number, growth=process.growth, trials=trials)


@dataclass(frozen=True, slots=True, kw_only=True)
class Looped:
    """What became of one process in the full closed loop, detector and guard included.

    Attributes
    ----------
    silenced
        Whether the vibration fell below the threshold for good with at most two moves.
    moves, needless
        Until then, and after it: moves upon a false alarm.
    """

    silenced: bool
    moves: int
    needless: int


def loop_number(number: int, seed: int) -> Looped:
    """Run one process in the full closed loop."""
    process: Process = population_process(seed, number)
    tape, interrupted = run_loop(process.case, process.seed, WallClock())
    summary = judge(process.case, process.seed, tape, interrupted=interrupted).summary
    rate_hz = process.case.settings.sample_rate_hz
    silent = math.inf if summary.suppressed_s is None else rate_hz * summary.suppressed_s
    moves = [event.sample <= silent for event in tape.of(Event) if event.kind == "move"]
    good = summary.outcome in ("prevented", "stable") or math.isfinite(silent)
    return Looped(silenced=good and sum(moves) <= MOST_MOVES, moves=sum(moves), needless=len(moves) - sum(moves))


def measure(size: Size, *, seed: int, workers: int, progress: Progress) -> tuple[list[Row], dict[str, Any]]:
    """Return the rows of the table and the numbers behind them.

    Parameters
    ----------
    size
        How much is tried.
    seed
        Of the population.
    workers
        Processes of this machine.
    progress
        Told the share that is done, 0...1.
    """
    tried = _all(partial(try_number, seed=seed), size.processes, workers, lambda done: progress(0.7 * done))
    loops = _all(partial(loop_number, seed=seed), size.loops, workers, lambda done: progress(0.7 + 0.3 * done))
    rows = [*_rows(tried), *_loop_rows(loops)]
    failed = {
        f"{way}, {who}": [one.number for one in tried if not one.trials[k][which].suppressed]
        for k, (way, _) in enumerate(WAYS)
        for which, who in enumerate(("foresight", "rule"))
    }
    failed["full loop"] = [number for number, one in enumerate(loops) if not one.silenced]
    return rows, {"processes": len(tried), "loops": len(loops), "seed": seed, "not_silenced": failed}


def _all(task: Callable[[int], Any], count: int, workers: int, progress: Progress) -> list[Any]:
    """Return what the task says of every number, in order, however many work."""
    found: list[Any] = []
    if workers == 1 or count < 2:
        for number in range(count):
            found.append(task(number))
            progress(len(found) / count)
        return found
    with ProcessPoolExecutor(workers, mp_context=multiprocessing.get_context("spawn")) as pool:
        for one in pool.map(task, range(count), chunksize=4):
            found.append(one)
            progress(len(found) / count)
    return found


def _rows(tried: Sequence[Tried]) -> list[Row]:
    rows: list[Row] = []
    for k, (way, _) in enumerate(WAYS):
        ours, peer = ([one.trials[k][which] for one in tried] for which in (0, 1))
        what = f"chatter {way}, {len(tried)} processes"
        rows += [
            row(f"{what}: silenced with at most {MOST_MOVES} moves", _share([t.suppressed for t in ours]),
                _share([t.suppressed for t in peer]), "share (peer: half a wave at the measured frequency)"),
            row(f"{what}: with one move", _share([t.suppressed and t.moves == 1 for t in ours]),
                _share([t.suppressed and t.moves == 1 for t in peer]), "share"),
            row(f"{what}: from the command to the last moment above the threshold, mean", _time(ours), _time(peer),
                "s"),
        ]  # fmt: skip
    return rows


def _loop_rows(loops: Sequence[Looped]) -> list[Row]:
    what = f"full closed loop, {len(loops)} processes"
    return [
        row(
            f"{what}: silenced with at most {MOST_MOVES} moves", _share([one.silenced for one in loops]), None, "share"
        ),
        row(f"{what}: with one move", _share([one.silenced and one.moves <= 1 for one in loops]), None, "share"),
        row(f"{what}: moved again upon a false alarm", _share([one.needless > 0 for one in loops]), None, "share"),
    ]


def _share(good: Sequence[bool]) -> float:
    return sum(good) / len(good) if good else math.nan


def _time(trials: Sequence[Trial]) -> float:
    taken = [t.quiet_after_s for t in trials if not math.isnan(t.quiet_after_s)]
    return sum(taken) / len(taken) if taken else math.nan
