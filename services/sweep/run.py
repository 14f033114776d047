"""Computing cells: here, in processes of this machine, or wherever a dask scheduler sends them."""

from __future__ import annotations

import math
import multiprocessing
from collections.abc import Callable, Generator, Iterable, Sequence
from concurrent.futures import CancelledError, ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from typing import Any

from services.clock import WallClock
from services.errors import InputError, RefusalError
from services.sweep.cell import Job, Result, Task, run_batch

BATCH_S = 0.3
"""Work that one batch should hold: sending it costs a few milliseconds."""
CONNECT_S = 5.0
Done = Callable[[Iterable[tuple[int, Result]]], None]


def run_jobs(task: Task, jobs: Sequence[Job], *, workers: int, scheduler: str | None, done: Done) -> None:
    """Compute every job and hand its result to `done` as it comes; the results do not depend on where.

    Parameters
    ----------
    task
        What all cells share.
    jobs
        The cells.
    workers
        Processes of this machine; 1 computes in this one.
    scheduler
        Address of a dask scheduler, such as `tcp://127.0.0.1:8786`, or None.
    done
        Told the results of each batch.
    """
    if not jobs:
        return
    clock = WallClock()
    run_batch(task, list(jobs[:1])) if scheduler is None else None  # compiles, or loads what is compiled
    begin = clock.now()
    first = [] if scheduler is not None else list(jobs[:1])
    if first:
        done(run_batch(task, first))
    each = max(clock.now() - begin, 1e-4) if first else BATCH_S
    rest = list(jobs[len(first) :])
    size = max(1, min(math.ceil(BATCH_S / each), math.ceil(len(rest) / (4 * workers)) or 1))
    batches = [rest[k : k + size] for k in range(0, len(rest), size)]
    if scheduler is not None:
        _on_dask(task, batches, scheduler, done)
    elif workers == 1:
        for batch in batches:
            done(run_batch(task, batch))
    else:
        _in_processes(task, batches, workers, done)


def _in_processes(task: Task, batches: list[list[Job]], workers: int, done: Done) -> None:
    spawn = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(workers, mp_context=spawn) as pool:
        futures = [pool.submit(run_batch, task, batch) for batch in batches]
        try:
            for future in as_completed(futures):
                done(future.result())
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def _on_dask(task: Task, batches: list[list[Job]], scheduler: str, done: Done) -> None:
    from distributed import as_completed as as_finished

    with _client(scheduler) as client, client.as_current():
        futures = client.map(_batch_of, batches, task=task, pure=False, retries=2)
        try:
            for future in as_finished(futures):
                done(future.result())
        except (OSError, TimeoutError, RuntimeError, CancelledError) as error:
            raise RefusalError(
                f"the scheduler {scheduler} was lost ({type(error).__name__}); the finished cells are kept, run the"
                " same command again to go on",
                {},
            ) from error


def _batch_of(batch: list[Job], task: Task) -> list[tuple[int, Result]]:
    return run_batch(task, batch)


@contextmanager
def _client(scheduler: str) -> Generator[Any]:
    try:
        from distributed import Client
    except ImportError as error:
        raise InputError("scheduler", scheduler, "left out, or install antiphase[dask]") from error
    try:
        client = Client(scheduler, timeout=CONNECT_S, set_as_default=False)
    except (OSError, TimeoutError, ValueError) as error:
        raise InputError("scheduler", scheduler, f"the address of a dask scheduler that answers ({error})") from error
    try:
        yield client
    finally:
        client.close(timeout=2)
