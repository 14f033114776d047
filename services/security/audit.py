"""What the router refuses, read from the log of Zenoh: it tells nobody else.

Zenoh writes its log to standard output. The process that routes therefore gives that to a pipe, keeps the original
for itself, and looks through what comes for two patterns: a message that access control stopped, and a link that was
not let in. Everything else is thrown away.
"""

from __future__ import annotations

import os
import re
import sys
import threading
from collections import Counter
from collections.abc import Callable
from typing import Any, TextIO

from services.clock import Clock

LOG = "zenoh::net::routing::interceptor=trace,zenoh_link_tls=warn,zenoh_link_quic=warn"
_COLOUR = re.compile(rb"\x1b\[[0-9;]*m")
_DENIED = re.compile(
    rb"([0-9a-f]+)(?: on \S+)? is unauthorized to (Put|Delete|Query|Declare Subscriber|Declare Queryable) "
    rb"\(ingress\) on (antiphase/\S+)[^\n]*\n[^\n]*Msg intercepted"
)
_NAME = re.compile(rb"([0-9a-f]+) on \S*CertCommonName\(([^)]*)\)")
_STRANGER = re.compile(rb"zenoh_link_(?:tls|quic)::unicast: (.*?)\. Hint:")
_CACHE = b"/@adv/"
MOST_KNOWN = 1000
"""Sessions, and refusals, that are remembered: a router runs for weeks, and whoever is refused chooses what is told."""


class Audit:
    """Finds refusals in the log of Zenoh, and tells each kind at most once a second.

    Parameters
    ----------
    tell
        Told in words what was refused.
    clock
        Monotonic.
    """

    def __init__(self, tell: Callable[[str], None], clock: Clock) -> None:
        self._tell, self._clock = tell, clock
        self._names: dict[bytes, str] = {}
        self._told: dict[str, float] = {}
        self._rest = b""
        self.counts: Counter[str] = Counter()

    def feed(self, data: bytes) -> None:
        """Take a piece of the log, cut anywhere."""
        text = self._rest + _COLOUR.sub(b"", data)
        end = text.rfind(b"\n") + 1
        last = text.rfind(b"\n", 0, max(0, end - 1)) + 1
        keep = last if b"unauthorized" in text[last:end] else end  # its second line has not come yet
        text, self._rest = text[:keep], text[keep:]
        for who, name in _NAME.findall(text):
            _remember(self._names, who, name.decode(errors="replace"))
        for who, what, key in _DENIED.findall(text):
            if _CACHE in key and what != b"Query":
                continue  # the cache of a publisher that may not publish: its put is told
            self._note(f"{self._names.get(who, 'somebody')} may not {what.decode().lower()} {key.decode()}")
        for why in _STRANGER.findall(text):
            self._note(f"somebody without a valid certificate is not let in ({why.decode(errors='replace')})")

    def _note(self, text: str) -> None:
        _remember(self.counts, text, self.counts[text] + 1)
        now = self._clock.now()
        if now - self._told.get(text, -1.0) >= 1.0:
            _remember(self._told, text, now)
            self._tell(text)


def _remember(known: dict[Any, Any], key: Any, value: Any) -> None:
    """Note something, and forget what was noted longest ago when there is too much."""
    known.pop(key, None)
    known[key] = value
    if len(known) > MOST_KNOWN:
        del known[next(iter(known))]


def listen_to_zenoh(audit: Audit, start: Callable[[str], None]) -> TextIO:
    """Let an audit read the log of Zenoh from now on; return what standard output was, for this process's own words.

    Parameters
    ----------
    audit
        Fed by a thread of its own.
    start
        Starts the log at the levels given.
    """
    sys.stdout.flush()
    own = os.fdopen(os.dup(1), "w", buffering=1, encoding="utf-8")
    reading, writing = os.pipe()
    os.dup2(writing, 1)
    os.close(writing)
    threading.Thread(target=_read, args=(reading, audit), name="audit", daemon=True).start()
    start(LOG)
    return own


def _read(reading: int, audit: Audit) -> None:
    while data := os.read(reading, 1 << 16):
        audit.feed(data)
