"""Links between the nodes that lose, double, swap and keep messages, block by block."""

from __future__ import annotations

from typing import Any

import numpy as np

from services.faults.schedule import ON_LINKS, Fault


class FaultyLink:
    """Carries messages from one node to the next.

    Parameters
    ----------
    name
        One of `LINKS`.
    faults
        Of the day.
    rng
        Decides which messages are hit.
    """

    def __init__(self, name: str, faults: tuple[Fault, ...], rng: np.random.Generator) -> None:
        own = [fault for fault in faults if fault.kind in ON_LINKS and fault.link == name]
        self._faults = [*own, *(fault for fault in faults if fault.kind in ("router restart", "CPU starvation"))]
        self._rng = rng
        self._waiting: list[tuple[int, int, Any]] = []
        self._count = 0

    def put(self, message: Any, block: int) -> None:
        """Take a message that is sent in a block."""
        due, copies = block, 1
        for fault in self._faults:
            if not fault.acts(block):
                continue
            hit = self._rng.random() < fault.share
            if fault.kind == "router restart" or (fault.kind == "lost" and hit):
                copies = 0
            elif fault.kind == "CPU starvation":  # everything comes at once when it is over, or after a while
                due = max(due, min(fault.last, block + fault.delay))
            elif fault.kind == "duplicated" and hit:
                copies += 1
            elif fault.kind == "reordered" and hit:
                due += int(self._rng.integers(2, 6))  # behind the next one at least
            elif fault.kind == "delayed" and hit:
                due += fault.delay
        for copy in range(copies):
            self._count += 1
            self._waiting.append((due + copy, self._count, message))

    def take(self, block: int) -> list[Any]:
        """Return what arrives in a block, in the order in which it arrives."""
        arrived = sorted((item for item in self._waiting if item[0] <= block), key=lambda item: item[:2])
        self._waiting = [item for item in self._waiting if item[0] > block]
        return [message for _, _, message in arrived]
