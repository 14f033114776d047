"""Tries every right of every role with a real message, because Zenoh refuses without a word."""

from __future__ import annotations

import pathlib
from collections.abc import Generator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass

from services.clock import Clock, utc_now
from services.errors import RefusalError
from services.messages import TOPICS
from services.security.identity import Identity, load_identity
from services.security.rights import RIGHTS, ROLES, ROUTER
from services.zenoh_bus import ZenohBus, open_router

MACHINE = "doctor-probe"
"""Nobody's machine: what is put there is obeyed by nobody."""
LISTENER = "recorder"
_SETTLE_S = 0.3


@dataclass(frozen=True, slots=True, kw_only=True)
class Probe:
    """What came through of what a role said.

    Attributes
    ----------
    role
        Whose certificate.
    open
        Topics that arrived.
    expected
        Topics that should.
    """

    role: str
    open: tuple[str, ...]
    expected: tuple[str, ...]

    @property
    def ok(self) -> bool:
        """Whether it has its rights and no others."""
        return set(self.open) == set(self.expected)

    def describe(self) -> str:
        """Return one line for people."""
        wrong = sorted(set(self.open) - set(self.expected))
        missing = sorted(set(self.expected) - set(self.open))
        words = f"may put {', '.join(self.open) or 'nothing'}; {len(TOPICS) - len(self.open)} topics refused"
        if wrong:
            words += f"; MUST NOT put {', '.join(wrong)}: does the router run with --identity?"
        return words + (f"; should but cannot put {', '.join(missing)}" if missing else "")


@contextmanager
def open_probe(folder: pathlib.Path, endpoint: str | None) -> Generator[str]:
    """Give the router to be probed, or one of our own with the router's certificate for as long as it takes.

    Parameters
    ----------
    folder
        What `antiphase certs` makes.
    endpoint
        Of a router, None for one of our own.
    """
    if endpoint is not None:
        yield endpoint
        return
    session, where = open_router("tls/127.0.0.1:0", load_identity(folder, ROUTER, utc_now()))
    try:
        yield where
    finally:
        session.close()


def probe(folder: pathlib.Path, endpoint: str, clock: Clock) -> list[Probe]:
    """Put on every topic as every role that has a certificate in a folder, and see what arrives.

    Parameters
    ----------
    folder
        What `antiphase certs` makes; the recorder's certificate must be in it, to listen.
    endpoint
        Of the router.
    clock
        Monotonic.

    Raises
    ------
    InputError, RefusalError
        For a certificate that is not valid, and a router that is not there or does not let us in.
    """
    now = utc_now()
    listener = load_identity(folder, LISTENER, now)
    roles = [role for role in ROLES if (folder / f"{role}.pem").is_file()]
    with ExitStack() as stack:
        ear = stack.enter_context(ZenohBus.client(MACHINE, endpoint, None, listener))
        inbox = ear.subscribe()
        mouths = {
            role: stack.enter_context(ZenohBus.client(MACHINE, endpoint, None, load_identity(folder, role, now)))
            for role in roles
        }
        for bus in mouths.values():
            bus.offer(*TOPICS.values())
        clock.sleep_until(clock.now() + _SETTLE_S)
        for role, bus in mouths.items():
            for kind in TOPICS.values():
                bus.publish_payload(kind, role.encode())
        clock.sleep_until(clock.now() + _SETTLE_S)
        heard = {(received.payload.decode(errors="replace"), received.topic) for received in inbox.take()}
    return [
        Probe(role=role, open=tuple(topic for topic in TOPICS if (role, topic) in heard), expected=RIGHTS[role].says)
        for role in roles
    ]


def stranger_is_refused(folder: pathlib.Path, endpoint: str) -> bool:
    """Whether a router refuses a controller's certificate that its authority did not sign.

    Parameters
    ----------
    folder
        The rogue's certificate and key, with the authority that the router has (so that the rogue trusts it).
    endpoint
        Of the router.
    """
    rogue = Identity(folder=folder, role="controller", expires=utc_now())
    try:
        ZenohBus.client(MACHINE, endpoint, None, rogue).close()
    except RefusalError:
        return True
    return False
