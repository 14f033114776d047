"""One picture for many browsers: fed at each tick, cut into frames for each of them."""

from __future__ import annotations

import asyncio
from collections import deque
from typing import Any

from services.clock import Clock
from services.dashboard.feed import Feed, pump
from services.dashboard.frame import Seen, encode_frame
from services.dashboard.view import View

FRAMES_PER_S = 24.0
IN_FLIGHT = 4
"""Frames that a browser may be behind; it says the number of each frame that it has read."""
PATIENCE_S = 5.0
"""A browser that reads nothing for so long is dropped."""
MOST_BROWSERS = 32


class Browser:
    """What one browser was sent and what it has read."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self.due = asyncio.Event()
        self.seen = Seen()
        self.gone = False
        self._unread: deque[int] = deque()
        self._behind_since: float | None = None

    def heard(self, text: str) -> None:
        """Take in the number of a frame that was read; anything else says nothing."""
        number = int(text) if text.isascii() and text.isdigit() and len(text) < 16 else -1
        while self._unread and self._unread[0] <= number <= self._unread[-1]:
            self._unread.popleft()
            self._behind_since = None

    def told(self, number: int, seen: Seen) -> None:
        """Note that a frame is on its way."""
        self.seen = seen
        self._unread.append(number)

    def ready(self) -> bool:
        """Whether another frame may be sent; notes since when not."""
        if len(self._unread) < IN_FLIGHT:
            return True
        if self._behind_since is None:
            self._behind_since = self._clock.now()
        return False

    def waits(self) -> bool:
        """Whether it is behind."""
        return self._behind_since is not None

    def hopeless(self) -> bool:
        """Whether it has not read anything for too long."""
        return self._behind_since is not None and self._clock.now() - self._behind_since > PATIENCE_S


class Hub:
    """Owns the picture; used from one thread.

    Parameters
    ----------
    view
        The picture.
    feed
        What it is fed from.
    clock
        Monotonic.
    """

    def __init__(self, view: View, feed: Feed, clock: Clock) -> None:
        self.view, self.feed, self.clock = view, feed, clock
        self.browsers: set[Browser] = set()
        self.dropped = 0
        self.controls: tuple[str, ...] = ()
        self._frames: dict[Seen, tuple[bytes, Seen]] = {}
        self._number = 0
        self._state: dict[str, Any] | None = None

    def tick(self) -> None:
        """Take in what has come and let every browser have a frame."""
        pump(self.feed, self.view)
        self._number += 1
        self._frames.clear()
        self._state = None
        for browser in self.browsers:
            browser.due.set()

    def state(self) -> dict[str, Any]:
        """Return the latest state as plain values."""
        if self._state is None:
            self._state = self.view.state() | {
                "bus": self.feed.where, "linked": self.feed.linked(), "browsers": len(self.browsers),
                "browsers_dropped": self.dropped, "controls": self.controls,
            }  # fmt: skip
        return self._state

    def frame(self, browser: Browser) -> bytes:
        """Return the next frame of a browser."""
        key = browser.seen
        if key not in self._frames:
            self._frames[key] = encode_frame(self.view, key, self._number, self.state())
        data, seen = self._frames[key]
        browser.told(self._number, seen)
        return data
