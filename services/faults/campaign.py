"""Many bad days, side by side on all cores, and the table of what came of them."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from typing import Any

from services.config import load_case
from services.faults.day import Day, live
from services.faults.schedule import FAULTS, draw

BATCH = 25


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """What came of all days that began with one kind of fault.

    Attributes
    ----------
    fault
        The kind.
    runs
        Days.
    worst_reaction_ms
        Longest time without a valid command until the guard answered.
    worst_excursion
        Largest set point, speed, acceleration, jerk or step over its limit.
    worst_following
        Largest distance of the stage from its set point over the stated following error.
    violations
        Days on which something was as it must not be.
    """

    fault: str
    runs: int
    worst_reaction_ms: float
    worst_excursion: float
    worst_following: float
    violations: int


def days(case: str, seeds: range, workers: int) -> Iterator[Day]:
    """Live through days, in the order of their seeds.

    Parameters
    ----------
    case
        Name of a shipped case, or path of a file.
    seeds
        Of the days.
    workers
        Processes; 1 stays in this one.
    """
    batches = [seeds[k : k + BATCH] for k in range(0, len(seeds), BATCH)]
    if workers == 1:
        for batch in batches:
            yield from _batch(case, batch)
        return
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        for lived in pool.map(_batch, [case] * len(batches), batches):
            yield from lived


def _batch(case: str, seeds: range) -> list[Day]:
    known = load_case(case)
    return [live(known, draw(seed)) for seed in seeds]


def rows(lived: list[Day]) -> list[Row]:
    """Return the table, a row for each kind of fault that occurred, in the order of `FAULTS`."""
    found: list[Row] = []
    for fault in FAULTS:
        own = [day for day in lived if day.schedule.faults[0].kind == fault]
        if own:
            found.append(
                Row(
                    fault=fault,
                    runs=len(own),
                    worst_reaction_ms=max(day.reaction_ms for day in own),
                    worst_excursion=max(day.excursion for day in own),
                    worst_following=max(day.following for day in own),
                    violations=sum(bool(day.violations) for day in own),
                )  # fmt: skip
            )
    return found


def answer(lived: list[Day]) -> dict[str, Any]:
    """Return the campaign for JSON: `runs`, `violations`, `rows`, and every day that failed, to be had again."""
    failed = [day for day in lived if day.violations]
    return {
        "runs": len(lived),
        "violations": len(failed),
        "rows": [dataclasses.asdict(row) for row in rows(lived)],
        "failed": [
            {
                "seed": day.schedule.seed, "violations": list(day.violations),
                "faults": [fault.describe() for fault in day.schedule.faults],
            }
            for day in failed
        ],
    }  # fmt: skip


def campaign(case: str, seeds: range, workers: int, show: Callable[[int, int], None]) -> list[Day]:
    """Live through days and tell how many are done and how many failed.

    Parameters
    ----------
    case, seeds, workers
        As for `days`.
    show
        Called with days done and days failed.
    """
    lived: list[Day] = []
    failed = 0
    for day in days(case, seeds, workers):
        lived.append(day)
        failed += bool(day.violations)
        show(len(lived), failed)
    return lived


def words(found: dict[str, Any]) -> str:
    """Return an answer as a table, and the days that failed.

    Parameters
    ----------
    found
        From `answer`.
    """
    lines = [
        "| fault | days | answer within (ms) | worst set point / limit | following / limit | failed |",
        "|---|---:|---:|---:|---:|---:|",
    ]
    for row in found["rows"]:
        lines.append(
            f"| {row['fault']} | {row['runs']} | {row['worst_reaction_ms']:.0f} | {row['worst_excursion']:.3f} "
            f"| {row['worst_following']:.3f} | {row['violations']} |"
        )
    lines += ["", f"{found['runs']} days, {found['violations']} failed"]
    for day in found["failed"]:
        lines.append(f"seed {day['seed']}: {'; '.join(day['violations'])} ({'; '.join(day['faults'])})")
    return "\n".join(lines)
