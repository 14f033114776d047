"""The bus as the nodes see it, and the one that lives in memory."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable
from datetime import datetime
from typing import Any, NamedTuple, Protocol

import msgspec

from services.messages import TOPICS, Message
from services.wire import decode


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


class Received(NamedTuple):
    """A payload as it came, with the type that its topic promises."""

    topic: str
    payload: bytes
    encoding: str
    stamp: Any = None
    """When it was sent, as Zenoh's timestamp."""

    def message(self) -> Message:
        """Return what it says, or raise `DecodeError`."""
        return decode(TOPICS[self.topic], self.payload)

    def age_s(self, now: datetime) -> float:
        """Return how long ago it was sent (s), by the time of day (UTC) of one computer."""
        return (now - self.stamp.get_time()).total_seconds()


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
