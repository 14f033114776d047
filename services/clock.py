"""The only clocks: wall time for pacing and latency, computing time for benchmarks; physics counts samples."""

from __future__ import annotations

import time
from datetime import UTC, datetime
from typing import Protocol


class Clock(Protocol):
    """What the runner needs of a clock; tests use a fake one."""

    def now(self) -> float:
        """Return monotonic time (s)."""
        ...

    def sleep_until(self, moment: float) -> None:
        """Wait until `moment` on the same scale (s)."""
        ...


class WallClock:
    """Monotonic wall time."""

    def now(self) -> float:
        """Return monotonic time (s)."""
        return time.perf_counter()

    def sleep_until(self, moment: float) -> None:
        """Wait until `moment` (s); return at once when it has passed."""
        time.sleep(max(0.0, moment - time.perf_counter()))


class CpuClock:
    """Time for which this process has been computing: what a benchmark reads on a machine that has other work too."""

    def now(self) -> float:
        """Return seconds of computing, all threads together."""
        return time.process_time()

    def sleep_until(self, moment: float) -> None:
        """Return at once: time that is slept through does not count."""


def utc_now() -> datetime:
    """Return the date and time of day, to name files and to check certificates; no decision rests on it."""
    return datetime.now(UTC)
