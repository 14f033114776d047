"""The bus as the nodes see it, and the one that lives in memory."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable
from typing import Any, Protocol

import msgspec

from services.messages import TOPICS


class Node(Protocol):
    """A message in, messages out: no bus, no clock, no loop."""

    @property
    def subscribes(self) -> tuple[type[msgspec.Struct], ...]:
        """Types of message that the node wants."""
        ...

    def prepare(self) -> None:
        """Compile and warm up; no state changes."""
        ...

    def handle(self, message: Any, /) -> Iterable[msgspec.Struct]:
        """Return what follows from `message`."""
        ...


class InMemoryBus:
    """Hands each message to every node that subscribes to its type, in the order of publishing."""

    def __init__(self, nodes: Iterable[Node], tap: Callable[[msgspec.Struct], None] | None = None) -> None:
        self._routes: dict[type[msgspec.Struct], list[Node]] = {kind: [] for kind in TOPICS.values()}
        self._tap = tap
        self._queue: deque[msgspec.Struct] = deque()
        for node in nodes:
            for kind in node.subscribes:
                self._routes.setdefault(kind, []).append(node)

    def publish(self, message: msgspec.Struct) -> None:
        """Deliver `message` and everything that follows from it before returning."""
        self._queue.append(message)
        while self._queue:
            head = self._queue.popleft()
            if self._tap is not None:
                self._tap(head)
            for node in self._routes.get(type(head), ()):
                self._queue.extend(node.handle(head))
