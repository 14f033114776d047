"""A process that does nothing but route; light, so that it is back soon after a fall."""

from __future__ import annotations

import contextlib
import json
import pathlib
import sys
from collections.abc import Callable
from typing import TextIO

from services.clock import WallClock, utc_now
from services.errors import InputError
from services.process import Parent, Stopped, StopSignal, end_within
from services.security.audit import Audit, listen_to_zenoh
from services.security.identity import Identity, load_identity
from services.security.rights import ROUTER
from services.zenoh_bus import open_router, start_log

CLOSING_S = 2.0
"""How long closing may take; a router has nothing that could get lost."""


def hold(
    endpoint: str, stop: StopSignal, *, child: bool, ready: Callable[[str], None], identity: Identity | None = None
) -> None:
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
    identity
        Who this is; then it lets nobody in without a certificate.
    """
    session, where = open_router(endpoint, identity)
    try:
        if child:
            Parent()
        ready(where)
        stop.wait()
    finally:
        deadline = end_within(CLOSING_S, 0)  # a link that is about to be let in can hold Zenoh's close up
        session.close()
        deadline.cancel()


def guarded(folder: pathlib.Path | None, tell: Callable[[str], None]) -> tuple[Identity | None, TextIO]:
    """Return the identity of a router, and where its own words go; with an identity, refusals are told.

    Parameters
    ----------
    folder
        What `antiphase certs` makes, None for a router that only this computer reaches.
    tell
        Told in words whom the router refused what.
    """
    if folder is None:
        return None, sys.stdout
    identity = load_identity(folder, ROUTER, utc_now())
    return identity, listen_to_zenoh(Audit(tell, WallClock()), start_log)


def main(endpoint: str, folder: str = "") -> int:
    """Route as a child: the endpoint, or what is wrong with it, is one line of JSON on standard output."""
    out = sys.stdout
    with StopSignal() as stop, contextlib.suppress(Stopped):
        try:
            identity, out = guarded(pathlib.Path(folder) if folder else None, _tell)
            hold(endpoint, stop, child=True, ready=lambda where: _print({"endpoint": where}, out), identity=identity)
        except InputError as error:
            _print({"error": error.as_dict()}, out)
            return 2
    return 0


def _tell(text: str) -> None:
    sys.stderr.write(f"router: refused: {text}\n")
    sys.stderr.flush()


def _print(answer: dict[str, object], out: TextIO) -> None:
    out.write(json.dumps(answer) + "\n")
    out.flush()
