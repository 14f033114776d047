"""Many trials on all cores; what was done is kept, and the result does not depend on how many work."""

from __future__ import annotations

import hashlib
import importlib
import json
import multiprocessing
import os
import pathlib
import signal
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from typing import NamedTuple

from services.bench.detector.trial import Result, onset_trial, pair_trial, stable_trial

SOURCES = ("chatter", "turning_sim", "pitch", "services.bench.detector", "services.configs")
"""Packages on which results depend: after a change nothing that was kept counts."""
ONE_THREAD = {name: "1" for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")}


class Job(NamedTuple):
    """One trial: population, seed, number, time in the cut (s, stable cuts), whether to sweep, and the turrets."""

    population: str
    seed: int
    number: int
    cut_s: float
    sweep: bool
    turrets: tuple[str, ...]

    @property
    def name(self) -> str:
        """What it is called in the file of results."""
        return f"{self.population} {self.number}"

    @property
    def weight(self) -> float:
        """About how long it takes, in simulated seconds."""
        return 4.0 + (10.0 if self.population == "pair" else self.cut_s)


def perform(job: Job) -> Result:
    """Do one trial."""
    if job.population == "stable":
        return stable_trial(job.seed, job.number, job.cut_s, job.turrets, sweep=job.sweep)
    trial = onset_trial if job.population == "onset" else pair_trial
    return trial(job.seed, job.number, job.turrets)


def perform_all(
    jobs: Sequence[Job], *, workers: int, kept: pathlib.Path | None, progress: Callable[[float], None]
) -> dict[str, Result]:
    """Do all trials and return them by name, in the order of the jobs.

    Parameters
    ----------
    jobs
        The trials.
    workers
        Processes.
    kept
        File in which each result is kept as soon as it is there; what it holds of the same code is not done again.
    progress
        Told the share that is done, 0...1.
    """
    mark = _mark()
    done = {} if kept is None else _read(kept, mark)
    done = {job.name: done[_key(job)] for job in jobs if _key(job) in done}
    left = sorted((job for job in jobs if job.name not in done), key=lambda job: -job.weight)
    total, finished = sum(job.weight for job in jobs), sum(job.weight for job in jobs if job.name in done)
    with _pool(min(workers, len(left))) as pool, _keeper(kept, mark) as keep:
        waiting = {pool.submit(perform, job): job for job in left}
        for future in as_completed(waiting):
            job = waiting[future]
            done[job.name] = future.result()
            keep(_key(job), done[job.name])
            finished += job.weight
            progress(finished / total)
    return {job.name: done[job.name] for job in jobs}


@contextmanager
def _pool(workers: int) -> Generator[ProcessPoolExecutor]:
    """Give processes started afresh, each with one thread for linear algebra: with more they wait for each other."""
    before = {name: os.environ.get(name) for name in ONE_THREAD}
    os.environ.update(ONE_THREAD)
    pool = ProcessPoolExecutor(
        max(workers, 1), mp_context=multiprocessing.get_context("spawn"), initializer=_leave_interrupts
    )
    try:
        yield pool
    finally:
        pool.shutdown(wait=True, cancel_futures=True)
        for name, value in before.items():
            if value is None:
                os.environ.pop(name)
            else:
                os.environ[name] = value


def _leave_interrupts() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)


@contextmanager
def _keeper(kept: pathlib.Path | None, mark: str) -> Generator[Callable[[str, Result], None]]:
    if kept is None:
        yield lambda _key, _result: None
        return
    fresh = not _read(kept, mark)
    with kept.open("w" if fresh else "a", encoding="utf-8") as file:
        if fresh:
            file.write(json.dumps({"code": mark}) + "\n")

        def keep(key: str, result: Result) -> None:
            file.write(json.dumps([key, result]) + "\n")
            file.flush()

        yield keep


def _read(kept: pathlib.Path, mark: str) -> dict[str, Result]:
    """Return what a file holds of this code; a last line that was cut off is left out."""
    try:
        first, *lines = kept.read_text(encoding="utf-8").splitlines()
    except (FileNotFoundError, ValueError):
        return {}
    if first != json.dumps({"code": mark}):
        return {}
    found: dict[str, Result] = {}
    for line in lines:
        try:
            key, result = json.loads(line)
        except ValueError:
            continue
        found[key] = result
    return found


def _key(job: Job) -> str:
    return json.dumps(job)


def _mark() -> str:
    digest = hashlib.sha256()
    for name in SOURCES:
        folder = pathlib.Path(str(importlib.import_module(name).__file__)).parent
        for path in sorted([*folder.rglob("*.py"), *folder.glob("*.toml")]):
            digest.update(path.name.encode() + path.read_bytes())
    return digest.hexdigest()


def workers_or_all(workers: int | None) -> int:
    """Return how many processes to use: as many as cores unless told otherwise."""
    return workers or os.cpu_count() or 1
