"""A closed loop without a bus behind the page: for pictures of it, its tests and its bench."""

from __future__ import annotations

import socket
import threading
from collections.abc import Generator, Iterable
from contextlib import contextmanager
from typing import Any

import uvicorn
from starlette.types import ASGIApp

from services.bus import Received
from services.clock import Clock
from services.closed_loop import Loop
from services.config import Case
from services.dashboard.server import configured, open_socket
from services.dashboard.view import View
from services.messages import BLOCK_S, Message
from services.wire import encode, encoding_of, topic_of


def rehearse(case: Case, seed: int, seconds: float, arm_after_s: float, clock: Clock) -> list[list[Message]]:
    """Return what a page hears of each block of a run in lockstep.

    Parameters
    ----------
    case, seed
        What is cut.
    seconds
        How long (s).
    arm_after_s
        When the guard is armed (s).
    clock
        Of the loop.
    """
    loop = Loop(case, seed, clock, arm_after_s)
    heard: list[list[Message]] = []
    known = dict.fromkeys(View.subscribes, 0)
    for number in range(round(seconds / BLOCK_S)):
        loop.step(number)
        heard.append([])
        for kind in View.subscribes:
            said = loop.tape.of(kind)
            heard[-1] += said[known[kind] :]
            known[kind] = len(said)
    return heard


class Rehearsal:
    """Plays what was heard in real time, from any moment on.

    Parameters
    ----------
    heard
        From `rehearse`.
    clock
        Monotonic.
    """

    where = "a rehearsal"

    def __init__(self, heard: list[list[Message]], clock: Clock) -> None:
        self._heard = [[_received(message) for message in block] for block in heard]
        self._clock, self._next = clock, 0
        self._begin: float | None = None
        self._changes = [(service, True) for service in ("machine", "monitor", "controller")]
        self.asked: list[Message] = []

    def play(self, from_s: float) -> None:
        """Let everything up to a moment of the run have happened, and go on from there."""
        self._begin = self._clock.now() - from_s

    def hold(self) -> None:
        """Say nothing any more."""
        self._begin = None

    def linked(self) -> bool:
        """Whether there is a bus: yes."""
        return True

    def take(self) -> Iterable[Received]:
        """Yield what has come."""
        if self._begin is None:
            return
        reached = min(int((self._clock.now() - self._begin) / BLOCK_S), len(self._heard))
        while self._next < reached:
            yield from self._heard[self._next]
            self._next += 1

    def changes(self) -> Iterable[tuple[str, bool]]:
        """Return who came."""
        found, self._changes = self._changes, []
        return found

    def ask(self) -> None:
        """Hear that the configuration is wanted; it is known already."""

    def told(self) -> str | None:
        """Return no other configuration."""
        return None

    def publish(self, message: Message) -> None:
        """Keep what was asked."""
        self.asked.append(message)


def _received(message: Message) -> Received:
    kind: Any = type(message)
    return Received(topic_of(kind), encode(message), encoding_of(kind))


@contextmanager
def served(app: ASGIApp, port: int = 0) -> Generator[int]:
    """Serve from a thread of this process, and give the port."""
    with open_socket("127.0.0.1", port) as listening:
        server = uvicorn.Server(configured(app))
        sockets: list[socket.socket] = [listening]
        thread = threading.Thread(target=server.run, args=(sockets,), daemon=True)
        thread.start()
        try:
            yield listening.getsockname()[1]
        finally:
            server.should_exit = True
            thread.join(10.0)
