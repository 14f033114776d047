"""What a picture is fed from: the bus, opened in the background, so that a page is there before any machine is."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable
from typing import Protocol

from services.bus import Received
from services.dashboard.view import View
from services.errors import RefusalError
from services.messages import Event, Message
from services.security.identity import Identity
from services.wire import DecodeError
from services.zenoh_bus import Inbox, Presence, ZenohBus

WAITING = 512
"""Messages of each topic that wait at most; of more, the newest win."""
ANSWER_S = 1.0
"""How long the machine has to tell its configuration."""


class Feed(Protocol):
    """Where messages come from; nothing here waits."""

    @property
    def where(self) -> str:
        """Return where that is, for people."""
        ...

    def linked(self) -> bool:
        """Whether the bus is in reach."""
        ...

    def take(self) -> Iterable[Received]:
        """Return what has come."""
        ...

    def changes(self) -> Iterable[tuple[str, bool]]:
        """Return who came or went."""
        ...

    def ask(self) -> None:
        """Ask the machine for its configuration."""
        ...

    def told(self) -> str | None:
        """Return the configuration once it has come, else None."""
        ...

    def publish(self, message: Message) -> None:
        """Send a message."""
        ...


def pump(feed: Feed, view: View) -> None:
    """Show a picture all that has come; events last, in the order of their time, from whomever they are."""
    for service, came in feed.changes():
        view.peer(service, came)
    events: list[Event] = []
    for received in feed.take():
        try:
            message = received.message()
        except DecodeError as error:
            view.sieve.refuse("unreadable", f"{received.topic}: {error}")
            continue
        if isinstance(message, Event):
            events.append(message)
        else:
            _show(view, message)
    for event in sorted(events, key=lambda event: event.sample):
        _show(view, event)
    if view.curious():
        feed.ask()
    text = feed.told()
    if text is not None:
        view.learn(text)


def _show(view: View, message: Message) -> None:
    try:
        view.handle(message)
    except Exception as error:  # whatever it was: the picture goes on, and says so
        view.sieve.refuse("unexpected", f"{type(message).__name__}: {type(error).__name__}: {error}")


class _Ended(Exception):  # noqa: N818  (nobody waits for the bus any more)
    """The feed was closed before there was a bus."""


class BusFeed:
    """The bus of one machine; its router may come later, go and come again.

    Parameters
    ----------
    machine
        Name of the machine.
    endpoint
        Where its router is.
    identity
        Who looks on, when the router asks for certificates.
    operator
        Who asks of the guard, when that needs another one.
    """

    def __init__(
        self, machine: str, endpoint: str, identity: Identity | None = None, operator: Identity | None = None
    ) -> None:
        self.where, self._machine = endpoint, machine
        self._identity, self._operator = identity, operator
        self._speaker: ZenohBus | None = None
        self._answer: Callable[[], str | None] | None = None
        self._bus: ZenohBus | None = None
        self._inbox: Inbox | None = None
        self._presence: Presence | None = None
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._open, name="bus", daemon=True)
        self._thread.start()

    def _open(self) -> None:
        try:
            bus = ZenohBus.client(self._machine, self.where, self._patience, self._identity)
            self._speaker = bus
            if self._operator is not None:
                self._speaker = ZenohBus.client(self._machine, self.where, self._patience, self._operator)
        except _Ended:
            return
        self._inbox = bus.follow(*View.subscribes, depth=WAITING)
        self._presence, self._bus = bus.presence(), bus

    def _patience(self) -> None:
        if self._ended.is_set():
            raise _Ended

    def linked(self) -> bool:
        """Whether the router is in reach."""
        return self._bus is not None and self._bus.linked()

    def take(self) -> Iterable[Received]:
        """Return what has come."""
        return () if self._bus is None or self._inbox is None else self._inbox.take(2 * WAITING)

    def changes(self) -> Iterable[tuple[str, bool]]:
        """Return who came or went."""
        return () if self._bus is None or self._presence is None else self._presence.changes()

    def ask(self) -> None:
        """Ask the machine for its configuration."""
        self._answer = None if self._bus is None else self._bus.ask_config(ANSWER_S)

    def told(self) -> str | None:
        """Return the configuration once it has come, else None."""
        text = None if self._answer is None else self._answer()
        if text is not None:
            self._answer = None
        return text

    def publish(self, message: Message) -> None:
        """Send a message, never waiting for anyone."""
        if self._speaker is None or not self._speaker.linked():
            raise RefusalError(f"the bus at {self.where} is not in reach")
        self._speaker.publish(message)

    def close(self) -> None:
        """Leave the bus."""
        self._ended.set()
        self._thread.join(2.0)
        for bus in (self._speaker, self._bus):
            if bus is not None:
                bus.close()
