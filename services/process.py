"""What every service process needs besides its node: how it is stopped, whom it follows, and how it surely ends."""

from __future__ import annotations

import os
import pathlib
import signal
import sys
import threading
import time
from collections.abc import Generator
from contextlib import contextmanager
from types import FrameType
from typing import Any, Self

GO = "go"
"""Line on which a process in reserve begins to work."""

WAKE_S = 0.1
"""Longest that the main thread sleeps in one go, so that a signal which another thread took is seen."""


class Stopped(Exception):  # noqa: N818  (not an error: somebody asked for it)
    """SIGINT or SIGTERM came, or the parent ended."""


class StopSignal:
    """Turns SIGINT and SIGTERM into an end between two messages; only waiting is interrupted, work is not.

    A second signal ends the process at once.
    """

    def __init__(self) -> None:
        self.is_set = False
        self._waiting = False
        self._before: dict[int, Any] = {}

    def __enter__(self) -> Self:
        for number in (signal.SIGINT, signal.SIGTERM):
            self._before[number] = signal.signal(number, self._handle)
        return self

    def __exit__(self, *_: object) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def _handle(self, number: int, _: FrameType | None) -> None:
        if self.is_set and not self._waiting:
            os._exit(128 + number)
        self.is_set = True
        if self._waiting:
            raise Stopped

    @contextmanager
    def waiting(self) -> Generator[None]:
        """Let a signal interrupt what happens inside by raising `Stopped`."""
        self._waiting = True
        try:
            self.check()
            yield
        finally:
            self._waiting = False

    def wait(self) -> None:
        """Do nothing until it is time, then raise `Stopped`.

        Never one long wait: the kernel may hand a signal to any thread, those of Zenoh too, and then the main thread,
        which alone runs Python's handler, is not woken.
        """
        with self.waiting():
            while True:
                time.sleep(WAKE_S)

    def check(self) -> None:
        """Raise `Stopped` if it is time."""
        if self.is_set:
            raise Stopped


class Parent:
    """Follows standard input, which the parent holds open: at its end the process is stopped like by SIGTERM.

    So no child outlives its parent, however that ended; a line `go` lets a process in reserve begin.
    """

    def __init__(self) -> None:
        self._go = threading.Event()
        threading.Thread(target=self._follow, name="parent", daemon=True).start()

    def _follow(self) -> None:
        for line in sys.stdin:
            if line.strip() == GO:
                self._go.set()
        end_within(5.0, 1)
        os.kill(os.getpid(), signal.SIGTERM)

    def told(self) -> bool:
        """Whether the parent has said `go`."""
        return self._go.is_set()

    def wait(self) -> None:
        """Return when the parent says `go`; signals may interrupt it."""
        while not self._go.wait(0.2):
            pass


@contextmanager
def term_interrupts() -> Generator[None]:
    """Let SIGTERM do what Ctrl-C does."""
    before = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


def end_within(seconds: float, code: int) -> threading.Timer:
    """End the process by force if it is still there after `seconds`, unless the timer is cancelled."""
    timer = threading.Timer(seconds, os._exit, (code,))
    timer.daemon = True
    timer.start()
    return timer


def command_line(*arguments: str) -> list[str]:
    """Return how to start `antiphase` in a new process, from the same code and interpreter as this one."""
    return python_line("from services.cli.app import main; main()", *arguments)


def router_line(endpoint: str, identity: str = "") -> list[str]:
    """Return how to start a process that routes; quicker than `antiphase router`.

    Parameters
    ----------
    endpoint
        Where it listens.
    identity
        Folder of certificates, empty without.
    """
    return python_line("from services.router import main; sys.exit(main(*sys.argv[1:]))", endpoint, identity)


def python_line(code: str, *arguments: str) -> list[str]:
    """Return how to run a line of Python that may import this code in a new process."""
    root = str(pathlib.Path(__file__).resolve().parent.parent)
    return [sys.executable, "-c", f"import sys; sys.path.insert(0, {root!r}); {code}", *arguments]
