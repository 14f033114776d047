"""Runs one node on the bus: what comes is decoded, handed to the node, and what follows is published.

One thread does all of that. The runner, not the node, knows the bus, the clock and who else is alive; it says what it
notices as an `Event` of its own and in words. A node that fails ends its process, and its sign of life with it.
"""

from __future__ import annotations

import threading
from collections import Counter
from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import Any, Protocol

from services.bus import Node, Received
from services.clock import Clock
from services.errors import RefusalError
from services.messages import ChatterReport, Event, Message
from services.process import Stopped
from services.shelf import Shelf
from services.wire import DecodeError
from services.zenoh_bus import Inbox, Presence, ZenohBus

SILENCE_S = 1.0
"""A run that said nothing for so long gives way to another one."""
SAVE_BLOCKS = 100
Say = Callable[[str], None]


class Waits(Protocol):
    """What may interrupt the waiting for a message; `StopSignal` in the main thread."""

    def waiting(self) -> AbstractContextManager[None]:
        """Give the time in which waiting may be interrupted by raising `Stopped`."""
        ...


class Learner(Protocol):
    """A node whose knowledge can be handed to its successor."""

    def snapshot(self) -> dict[str, Any]:
        """Return what was learned, as plain values."""
        ...

    def restore(self, saved: dict[str, Any]) -> None:
        """Take over what a predecessor learned."""
        ...


class Herald:
    """Says what the runner of a service notices, each kind at most once a second, and counts all of it."""

    def __init__(self, service: str, bus: ZenohBus, clock: Clock, say: Say) -> None:
        self.run = ""
        self.sample = 0
        self.counts: Counter[str] = Counter()
        self._source, self._bus, self._clock, self._say = f"{service}-runner", bus, clock, say
        self._said: dict[str, float] = {}
        self._unsaid: Counter[str] = Counter()
        self._missed: set[str] = set()
        self._events = 0

    def note(self, kind: str, text: str) -> None:
        """Count something, and say it unless the same kind was said within the last second."""
        self.counts[kind] += 1
        now = self._clock.now()
        if now - self._said.get(kind, -1.0) < 1.0:
            self._unsaid[kind] += 1
            return
        self._said[kind] = now
        more = self._unsaid.pop(kind, 0)
        self.tell(kind, text + (f" ({more} more before)" if more else ""))

    def tell(self, kind: str, text: str) -> None:
        """Publish an event and say it."""
        self._say(text)
        self._events += 1
        self._bus.publish(
            Event(
                run=self.run, source=self._source, sequence=self._events,
                sample=self.sample, kind=kind, text=text[:500],
            )  # fmt: skip
        )

    def peer(self, service: str, who: str, came: bool) -> None:
        """Say who came or went; only who is missed, or comes back, is worth an event."""
        text = f"{service} sees that {who} {'is alive' if came else 'is gone'}"
        if came and who not in self._missed:
            self._say(text)
            return
        (self._missed.discard if came else self._missed.add)(who)
        self.tell("peer", text)

    def read(self, received: Received) -> Any:
        """Return the message in a payload, None (noted) when there is none."""
        try:
            return received.message()
        except DecodeError as error:
            self.note("decode_error", f"{received.topic}: {error}")
            return None


class Tenancy:
    """Which run a service works for: the first that it hears, until that one's machine is gone or silent."""

    def __init__(self, make: Callable[[str], Node], herald: Herald, clock: Clock, shelf: Shelf | None) -> None:
        self._make, self._herald, self._clock, self._shelf = make, herald, clock, shelf
        self._heard = 0.0
        self._since_save = 0
        self._source = ""
        self.node: Node | None = None
        self.run = ""
        self.vacant = True
        self.runs = self.handled = 0

    def handle(self, message: Message) -> list[Message]:
        """Return what follows from a message; nothing does from one of another run."""
        now = self._clock.now()
        if self.node is None or message.run != self.run:
            if not self.vacant and now - self._heard < SILENCE_S:
                self._herald.note("foreign_run", f"a second run, {message.run:.40}, is ignored: {self.run} goes on")
                return []
            self._move_in(message.run)
        self._heard, self.vacant = now, False
        self._herald.sample = getattr(message, "first_sample", self._herald.sample)
        if self.node is None:
            return []
        self.handled += 1
        return [answer for answer in self.node.handle(message) if isinstance(answer, Message)]

    def _move_in(self, run: str) -> None:
        self.node, self.run, self.vacant = self._make(run), run, False
        self.runs += 1
        self._herald.run, self._since_save, self._source = run, 0, ""
        kept = self._shelf.load(run) if self._shelf is not None else None
        if kept is None:
            return
        try:
            self.node.restore(kept)  # pyright: ignore[reportAttributeAccessIssue]
            self._herald.tell("limits_restored", "goes on with the limits learned before")
        except ValueError as error:
            self._herald.tell("limits_lost", f"cannot use the limits learned before: {error}")

    def save(self, answers: list[Message]) -> None:
        """Keep what was learned, once a second and when the limits have another source."""
        if self._shelf is None or self.node is None:
            return
        sources = {answer.limit_source for answer in answers if isinstance(answer, ChatterReport)}
        self._since_save += 1
        if self._since_save < SAVE_BLOCKS and sources <= {self._source}:
            return
        self._since_save, self._source = 0, max(sources, default=self._source)
        self._shelf.save(self.run, self.node.snapshot())  # pyright: ignore[reportAttributeAccessIssue]


def run_node(
    service: str,
    make: Callable[[str], Node],
    bus: ZenohBus,
    *,
    clock: Clock,
    stop: Waits,
    say: Say,
    shelf: Shelf | None = None,
) -> dict[str, Any]:
    """Serve whatever run is on the bus until stopped, and return what there was to count.

    Parameters
    ----------
    service
        Name of the sign of life; refused when somebody shows it already.
    make
        Makes the node of a run; it subscribes to one type of message.
    bus
        An open bus.
    clock
        Monotonic.
    stop
        Ends it.
    say
        Told in words what happens.
    shelf
        Where what was learned is kept; the node must then be a `Learner`.
    """
    refuse_second(bus, service)
    model = make("")
    model.prepare()
    herald = Herald(service, bus, clock, say)
    tenancy = Tenancy(make, herald, clock, shelf)
    inbox, presence = bus.subscribe(*model.subscribes), bus.presence()
    watcher = threading.Thread(target=_watch, args=(presence, tenancy, herald, service), daemon=True)
    watcher.start()
    bus.announce(service)
    say(f"{service} of {bus.machine} at {bus.endpoint}: ready")
    try:
        _serve(inbox, bus, stop, herald, tenancy)
    except Stopped:
        pass
    finally:
        bus.withdraw()
        presence.close()
        watcher.join(1.0)
    return {
        "service": service, "machine": bus.machine, "run": tenancy.run or None, "runs": tenancy.runs,
        "handled": tenancy.handled, "blocks_lost": getattr(tenancy.node, "blocks_lost", 0),
        "decode_errors": herald.counts["decode_error"], "foreign": herald.counts["foreign_run"],
    }  # fmt: skip


def refuse_second(bus: ZenohBus, service: str) -> None:
    """Refuse to be the second of a kind."""
    if service in bus.alive():
        raise RefusalError(
            f"a {service} of {bus.machine} is alive already at {bus.endpoint}; stop it, or choose another --machine",
            {"service": service, "machine": bus.machine},
        )


def _serve(inbox: Inbox, bus: ZenohBus, stop: Waits, herald: Herald, tenancy: Tenancy) -> None:
    while True:
        with stop.waiting():
            received = inbox.wait()
        message = herald.read(received)
        if message is None:
            continue
        answers = tenancy.handle(message)
        for answer in answers:
            bus.publish(answer)
        tenancy.save(answers)


def _watch(presence: Presence, tenancy: Tenancy, herald: Herald, service: str) -> None:
    """Say who comes and goes; a run whose machine is gone may be followed by another."""
    while (change := presence.wait()) is not None:
        who, came = change
        if who == service:
            continue
        if who == "machine":
            tenancy.vacant = tenancy.vacant or not came
        herald.peer(service, who, came)
