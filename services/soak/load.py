"""Other work on the computer, and how much memory a process holds."""

from __future__ import annotations

import os
import pathlib
import subprocess
from collections.abc import Generator
from contextlib import contextmanager

from services.process import python_line

BUSY = "exec('while True: pass')"
_PAGE_MB = os.sysconf("SC_PAGE_SIZE") / 1e6


@contextmanager
def busy(times: float) -> Generator[int]:
    """Keep every core so many times over with other work; gives the number of processes.

    Parameters
    ----------
    times
        Busy processes for each core; 0 for none.
    """
    count = round(times * len(os.sched_getaffinity(0)))
    others = [subprocess.Popen(python_line(BUSY), stdin=subprocess.DEVNULL) for _ in range(count)]
    try:
        yield count
    finally:
        for other in others:
            other.kill()
        for other in others:
            other.wait()


def memory_mb(pid: int) -> float:
    """Return the resident memory of a process (MB), NaN when it is gone.

    Parameters
    ----------
    pid
        Of the process.
    """
    try:
        return int(pathlib.Path(f"/proc/{pid}/statm").read_text(encoding="ascii").split()[1]) * _PAGE_MB
    except (OSError, IndexError):
        return float("nan")
