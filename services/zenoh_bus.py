"""The bus on Zenoh; the only file that knows Zenoh.

One session per process, on 127.0.0.1 unless told otherwise, without multicast and gossip: who belongs to it says so.
A router lives inside the process that opens one; everybody else is its client. Publishing never blocks: what a slow
receiver cannot take is dropped for it alone, and fetched again from the cache of the publisher (up to 200 ms late).
Received payloads wait in bounded FIFOs that the thread of the node drains; there are no callbacks.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator
from datetime import timedelta
from typing import Any, Self

import zenoh
from zenoh import ext

from services.bus import Received
from services.bus_settings import session_settings
from services.clock import WallClock
from services.errors import InputError, RefusalError
from services.messages import TOPICS, Event, Message, SampleBlock
from services.process import Stopped
from services.security.endpoints import check_private, check_proof, refuse_stranger
from services.security.identity import Identity
from services.wire import encode, encoding_of, topic_of

DEFAULT_ENDPOINT = "tcp/127.0.0.1:7447"
SECURE_ENDPOINT = "tls/127.0.0.1:7447"
DEPTH = 4096
"""Messages that wait for a node at most: over 10 s of all topics."""
CACHE: dict[type[Message], int] = {SampleBlock: 400, Event: 100}
"""Messages that a publisher keeps for those who missed them."""
FEW = 200
NEVER: Any = timedelta(days=1)
"""A gap is seen by the message behind it. Asking on a schedule, or by heartbeats, would bring a newcomer the past."""
_ENDPOINT = re.compile(r"(tcp|udp|tls|quic|ws|unixsock-stream)/[^#?,;\s]+")
_RETRY = "#retry_period_init_ms=100;retry_period_max_ms=200"
start_log = zenoh.init_log_from_env_or
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,63}")


def check_machine(name: str) -> str:
    """Return a name that can be a part of a key."""
    if not _NAME.fullmatch(name):
        raise InputError("machine", name, "1 to 64 letters, digits, '-', '_' or '.', beginning with a letter or digit")
    return name


def check_endpoint(field: str, endpoint: str) -> str:
    """Return an endpoint of Zenoh."""
    if not _ENDPOINT.fullmatch(endpoint):
        raise InputError(field, endpoint, f"an endpoint such as {DEFAULT_ENDPOINT}")
    return endpoint


def open_router(endpoint: str, identity: Identity | None = None) -> tuple[zenoh.Session, str]:
    """Return a session that routes for others, and where it listens (port 0: one that was free).

    Parameters
    ----------
    endpoint
        Where to listen: on this computer alone, or anywhere with an identity.
    identity
        Who this is; then nobody gets in without a certificate, and each has the rights of its role only.
    """
    check_private(check_endpoint("listen", endpoint), identity)
    try:
        session = zenoh.open(_config("router", listen=[endpoint], identity=identity))
    except zenoh.ZError as error:
        rule = "a free endpoint" if "in use" in str(error) else "an endpoint to listen on"
        raise InputError("listen", endpoint, f"{rule} ({_short(error)})") from error
    return session, _locator(session) if endpoint.endswith(":0") else endpoint


def open_client(
    endpoint: str, patience: Callable[[], None] | None = None, identity: Identity | None = None
) -> zenoh.Session:
    """Return a session behind a router.

    Parameters
    ----------
    endpoint
        Where the router listens.
    patience
        Called whenever nobody answers, at most every 100 ms; raises when it is time to give up. Without it, nobody
        is waited for longer than a second.
    identity
        Who this is, for an endpoint that asks for it.
    """
    check_proof("connect", check_endpoint("connect", endpoint), identity)
    clock = WallClock()
    until = clock.now() + 1.0
    while True:
        try:
            return zenoh.open(_config("client", connect=[endpoint + _RETRY], identity=identity))
        except zenoh.ZError as error:
            if "Unable to connect" not in str(error):
                raise InputError("connect", endpoint, f"an endpoint to connect to ({_short(error)})") from error
            if identity is not None:
                refuse_stranger(endpoint, identity)
            if patience is not None:
                patience()
            elif clock.now() > until:
                raise RefusalError(f"nobody listens at {endpoint}") from error
            clock.sleep_until(clock.now() + 0.1)


def fifo(depth: int = DEPTH) -> Any:
    """Return a bounded channel for a subscriber."""
    return zenoh.handlers.FifoChannel(depth)


def _config(mode: str, **given: Any) -> zenoh.Config:
    config = zenoh.Config()
    for name, value in session_settings(mode, **given).items():
        config.insert_json5(name, json.dumps(value))
    return config


def _locator(session: zenoh.Session) -> str:
    for reply in session.get(f"@/{session.zid()}/router", timeout=2.0):
        if reply.ok is not None:
            return str(json.loads(reply.ok.payload.to_string())["locators"][0])
    raise RuntimeError("the router does not say where it listens")


def _short(error: Exception) -> str:
    return str(error).split(" at /")[0].strip(" !.[")


class Inbox:
    """Bounded FIFOs of what one node subscribes to; only the thread of the node may take from them.

    Parameters
    ----------
    prefix
        Of the keys of the machine.
    subscribers
        Each with the one type of message that it gives, or None if it gives all.
    """

    def __init__(self, prefix: str, subscribers: list[tuple[Any, type[Message] | None]]) -> None:
        self._start = len(prefix)
        self._subscribers = [
            (subscriber, kind and topic_of(kind), kind and encoding_of(kind)) for subscriber, kind in subscribers
        ]
        self.unknown = 0

    def wait(self) -> Received:
        """Return the next message of the only subscription, as soon as there is one; a signal may interrupt it.

        Raises
        ------
        Stopped
            When the inbox is closed by another thread.
        """
        subscriber, topic, encoding = self._subscribers[0]
        while True:
            try:
                sample = subscriber.handler.recv()
            except zenoh.ZError as error:
                raise Stopped from error
            received = self._received(sample, topic, encoding)
            if received is not None:
                return received

    def take(self, most: int = DEPTH) -> Iterator[Received]:
        """Yield what has come, and do not wait."""
        for subscriber, topic, encoding in self._subscribers:
            for _ in range(most):
                sample = subscriber.try_recv()
                if sample is None:
                    break
                received = self._received(sample, topic, encoding)
                if received is not None:
                    yield received

    def _received(self, sample: Any, topic: str | None, encoding: str | None) -> Received | None:
        if topic is not None and encoding is not None:
            return Received(topic, sample.payload.to_bytes(), encoding, sample.timestamp)
        topic = str(sample.key_expr)[self._start :]
        if topic not in TOPICS:
            self.unknown += 1
            return None
        return Received(topic, sample.payload.to_bytes(), str(sample.encoding), sample.timestamp)

    def close(self) -> None:
        """Undeclare the subscriptions."""
        while self._subscribers:
            self._subscribers.pop()[0].undeclare()


class Presence:
    """Who is alive on the bus, by liveliness tokens."""

    def __init__(self, session: zenoh.Session, prefix: str) -> None:
        self._start = len(prefix)
        self._subscriber = session.liveliness().declare_subscriber(f"{prefix}*", fifo(256), history=True)
        self._handler = self._subscriber.handler
        self._closed = False
        self.alive: set[str] = set()

    def changes(self) -> list[tuple[str, bool]]:
        """Return who came or went since the last call."""
        found: list[tuple[str, bool]] = []
        while (sample := self._handler.try_recv()) is not None:
            found.append(self._note(sample))
        return found

    def wait(self) -> tuple[str, bool] | None:
        """Return who comes or goes next; None once the bus is closed. For a thread of its own."""
        try:
            return self._note(self._handler.recv())
        except zenoh.ZError:
            return None

    def _note(self, sample: Any) -> tuple[str, bool]:
        service, came = str(sample.key_expr)[self._start :], sample.kind == zenoh.SampleKind.PUT
        (self.alive.add if came else self.alive.discard)(service)
        return service, came

    def close(self) -> None:
        """Undeclare the subscription; whoever waits is told."""
        if not self._closed:
            self._closed = True
            self._subscriber.undeclare()


class ZenohBus:
    """What one process says and hears about one machine.

    Parameters
    ----------
    session
        From `open_router` or `open_client`; closed with the bus.
    machine
        Name of the machine.
    endpoint
        Where the router is, for messages to people.
    """

    def __init__(self, session: zenoh.Session, machine: str, endpoint: str) -> None:
        self.machine, self.endpoint = check_machine(machine), endpoint
        self._session = session
        self._prefix = f"antiphase/{machine}/"
        self._publishers: dict[type[Message], Any] = {}
        self._open: list[Any] = []
        self._tokens: dict[str, Any] = {}
        self._config: Any = None

    @classmethod
    def router(cls, machine: str, endpoint: str, identity: Identity | None = None) -> Self:
        """Return a bus whose session routes for others."""
        check_machine(machine)
        session, locator = open_router(endpoint, identity)
        return cls(session, machine, locator)

    @classmethod
    def client(
        cls, machine: str, endpoint: str, patience: Callable[[], None] | None = None, identity: Identity | None = None
    ) -> Self:
        """Return a bus behind a router; `patience` and `identity` as in `open_client`."""
        check_machine(machine)
        return cls(open_client(endpoint, patience, identity), machine, endpoint)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def offer(self, *kinds: type[Message]) -> None:
        """Declare what will be published, so that the first message is as fast as the others."""
        for kind in kinds:
            if kind not in self._publishers:
                self._publishers[kind] = self._publisher(kind)

    def _publisher(self, kind: type[Message]) -> Any:
        return ext.declare_advanced_publisher(
            self._session,
            self._prefix + topic_of(kind),
            encoding=encoding_of(kind),
            congestion_control=zenoh.CongestionControl.DROP,
            cache=ext.CacheConfig(CACHE.get(kind, FEW)),
            sample_miss_detection=ext.MissDetectionConfig(heartbeat=None, sporadic_heartbeat=None),
        )

    def publish(self, message: Message) -> None:
        """Send a message to whoever wants it; never waits for anyone."""
        self.publish_payload(type(message), encode(message))

    def publish_payload(self, kind: type[Message], payload: bytes) -> None:
        """Send what `encode` made of a message of a type."""
        if kind not in self._publishers:
            self.offer(kind)
        self._publishers[kind].put(payload)

    def subscribe(self, *kinds: type[Any], depth: int = DEPTH) -> Inbox:
        """Return the inbox of what others publish: some types, or everything about the machine without types."""
        wanted = [(self._prefix + topic_of(kind), kind) for kind in kinds] or [(self._prefix + "**", None)]
        recovery = ext.RecoveryConfig(periodic_queries=NEVER, heartbeat=None)
        return self._inbox([(self._subscriber(key, fifo(depth), recovery=recovery), kind) for key, kind in wanted])

    def follow(self, *kinds: type[Any], depth: int) -> Inbox:
        """Return an inbox in which the newest win, for those who only look on; events that were before come too."""
        history = {Event: ext.HistoryConfig(detect_late_publishers=True)}
        wanted = [(self._prefix + topic_of(kind), zenoh.handlers.RingChannel(depth), kind) for kind in kinds]
        return self._inbox(
            [(self._subscriber(key, ring, history=history.get(kind)), kind) for key, ring, kind in wanted]
        )

    def _inbox(self, subscribers: list[tuple[Any, type[Message] | None]]) -> Inbox:
        self._open.append(inbox := Inbox(self._prefix, subscribers))
        return inbox

    def _subscriber(self, key: str, channel: Any, **how: Any) -> Any:
        return ext.declare_advanced_subscriber(self._session, key, channel, allowed_origin=zenoh.Locality.REMOTE, **how)

    def announce(self, service: str) -> None:
        """Show that a service is alive until `close`, or until the process ends in whatever way."""
        self._tokens[service] = self._session.liveliness().declare_token(f"{self._prefix}alive/{service}")

    def withdraw(self) -> None:
        """Take all own signs of life back."""
        for token in self._tokens.values():
            token.undeclare()
        self._tokens.clear()

    def linked(self) -> bool:
        """Whether a router is in reach; for a client."""
        return bool(self._session.info.routers_zid())

    def alive(self) -> set[str]:
        """Ask who is alive at this moment."""
        prefix = f"{self._prefix}alive/"
        replies = self._session.liveliness().get(f"{prefix}*", timeout=1.0)
        return {str(reply.ok.key_expr)[len(prefix) :] for reply in replies if reply.ok is not None}

    def presence(self) -> Presence:
        """Follow who is alive."""
        presence = Presence(self._session, f"{self._prefix}alive/")
        self._open.append(presence)
        return presence

    def ask_config(self, timeout_s: float) -> Callable[[], str | None]:
        """Ask the machine for its configuration; what is returned gives the answer once it has come, else None."""
        replies = self._session.get(self._prefix + "config", fifo(4), timeout=timeout_s)

        def answer() -> str | None:
            try:
                reply = replies.try_recv()
            except zenoh.ZError:  # every answer has been taken, or none came in time
                return None
            return None if reply is None or reply.ok is None else reply.ok.payload.to_string()

        return answer

    def serve_config(self, text: str) -> None:
        """Answer whoever asks for `config` with a JSON text; `answer` must be called now and then."""
        queryable = self._session.declare_queryable(self._prefix + "config", fifo(64))
        self._config = (queryable, text)

    def answer(self) -> None:
        """Answer what was asked since the last call."""
        if self._config is None:
            return
        queryable, text = self._config
        for _ in range(16):
            query = queryable.try_recv()
            if query is None:
                return
            with query:
                query.reply(self._prefix + "config", text, encoding="application/json")

    def hush(self) -> None:
        """Undeclare the subscriptions: who waits for a message is told that there will be none."""
        while self._open:
            self._open.pop().close()

    def close(self) -> None:
        """Undeclare everything and close the session; closing twice does no harm."""
        if self._session.is_closed():
            return
        self.withdraw()
        self.hush()
        for publisher in self._publishers.values():
            publisher.undeclare()
        if self._config is not None:
            self._config[0].undeclare()
        self._session.close()
