"""The only clock: wall time for pacing and for measuring latency; physics counts samples."""

from __future__ import annotations

import time
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
