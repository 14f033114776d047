"""A process that does nothing but route; light, so that it is back soon after a fall."""

from __future__ import annotations

import contextlib
import json
import sys
import threading
from collections.abc import Callable

from services.errors import InputError
from services.process import Parent, Stopped, StopSignal
from services.zenoh_bus import open_router


def hold(endpoint: str, stop: StopSignal, *, child: bool, ready: Callable[[str], None]) -> None:
    """Route until stopped; `ready` is told where.

    Parameters
    ----------
    endpoint
        Where to listen.
    stop
        Ends it.
    child
        Whether the end of standard input ends it too.
    ready
        Called once, with the endpoint that others connect to.
    """
    session, where = open_router(endpoint)
    try:
        if child:
            Parent()
        ready(where)
        with stop.waiting():
            threading.Event().wait()
    finally:
        session.close()


def main(endpoint: str) -> int:
    """Route as a child: the endpoint, or what is wrong with it, is one line of JSON on standard output."""
    with StopSignal() as stop, contextlib.suppress(Stopped):
        try:
            hold(endpoint, stop, child=True, ready=lambda where: _print({"endpoint": where}))
        except InputError as error:
            _print({"error": error.as_dict()})
            return 2
    return 0


def _print(answer: dict[str, object]) -> None:
    sys.stdout.write(json.dumps(answer) + "\n")
    sys.stdout.flush()
