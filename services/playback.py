"""A recording back onto a bus, at any pace: for dashboards, monitors and subscribers, never for a machine.

Each message is as it was recorded but for two fields: its run is a new one for each playback, and its source says that
it is replayed. The guard of a machine takes commands of its own run and from its own controller only, so either field
alone keeps a replayed command from moving anything.
"""

from __future__ import annotations

import math
import pathlib
import uuid
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import msgspec

from services.clock import Clock
from services.errors import InputError, RefusalError
from services.messages import TOPICS, Message, SampleBlock
from services.process import Stopped, StopSignal
from services.recording_file import RecordingReader, read_metadata
from services.wire import topic_of
from services.zenoh_bus import ZenohBus

SERVICE = "replay"
MARK = "-replay"
LOOK_S = 0.2
"""How often the configuration is told to whoever asked for it, at least."""


class Disguise:
    """Gives each run of a recording a new identifier, and each source a mark."""

    def __init__(self) -> None:
        self._runs: dict[str, str] = {}

    def __call__(self, message: Message) -> Message:
        """Return the message as it may go onto a bus."""
        run = self._runs.get(message.run)
        if run is None:
            run = self._runs[message.run] = f"replay-{uuid.uuid4()}"
        return msgspec.structs.replace(message, run=run, source=message.source + MARK)


@dataclass(slots=True)
class Played:
    """What there is to count in a playback.

    Attributes
    ----------
    topics
        Messages published, by topic.
    behind_s
        How far it fell behind its schedule at most (s).
    played_s, wall_s
        Time of the recording that was played, and how long that took (s).
    """

    topics: Counter[str] = field(default_factory=Counter[str])
    behind_s: float = 0.0
    played_s: float = 0.0
    wall_s: float = 0.0
    stopped: bool = False

    def as_dict(self) -> dict[str, Any]:
        """Return it for JSON."""
        pace = self.played_s / self.wall_s if self.wall_s > 0.0 else None
        return {
            "published": self.topics.total(), "topics": dict(self.topics), "played_s": self.played_s,
            "wall_s": self.wall_s, "pace": pace, "behind_max_ms": 1e3 * self.behind_s, "stopped": self.stopped,
        }  # fmt: skip


def stretch(
    path: pathlib.Path, start_s: float = 0.0, stop_s: float = math.inf, topics: frozenset[str] = frozenset()
) -> tuple[RecordingReader, Iterator[tuple[float, Message]]]:
    """Return the reader of a recording and what lies in a stretch of it, each with when it was received (s).

    Parameters
    ----------
    path
        Recording.
    start_s, stop_s
        Stretch (s of the machine's samples; a recording without blocks of samples: since its first message).
    topics
        Which; none: all.
    """
    reader = RecordingReader(path)

    def messages() -> Iterator[tuple[float, Message]]:
        now, first_ns, sampled = 0.0, None, False
        for topic, message, time_ns in reader.messages():
            first_ns = time_ns if first_ns is None else first_ns
            if isinstance(message, SampleBlock):
                now, sampled = message.first_sample / message.sample_rate_hz, True
            elif not sampled:
                now = max(now, 1e-9 * (time_ns - first_ns))
            if now >= stop_s:
                return
            if now >= start_s and (not topics or topic in topics):
                yield 1e-9 * time_ns, message

    return reader, messages()


def check_topics(wanted: list[str] | None) -> frozenset[str]:
    """Return topics that exist."""
    for topic in wanted or ():
        if topic not in TOPICS:
            raise InputError("topic", topic, f"one of {', '.join(TOPICS)}")
    return frozenset(wanted or ())


def publish(
    messages: Iterator[tuple[float, Message]], bus: ZenohBus, clock: Clock, stop: StopSignal, pace: float,
    progress: Callable[[float], None] = lambda _: None,
) -> Played:  # fmt: skip
    """Put messages on a bus when they are due, and return what there was to count.

    Parameters
    ----------
    messages
        Each with when it was received (s).
    bus
        An open bus.
    clock
        Monotonic.
    stop
        Ends it.
    pace
        Times real time.
    progress
        Told how much of the recording was played (s).

    Raises
    ------
    RefusalError
        If a machine of that name is alive there.
    """
    if "machine" in bus.alive():
        raise RefusalError(
            f"a machine {bus.machine} is alive at {bus.endpoint}: a recording among its messages would confuse "
            "everybody; choose another --machine",
            {"machine": bus.machine, **Played().as_dict()},
        )
    bus.announce(SERVICE)
    disguise, played = Disguise(), Played()
    begin = begun = clock.now()
    first: float | None = None
    try:
        for time_s, message in messages:
            first = time_s if first is None else first
            played.played_s = max(played.played_s, time_s - first)
            due = begin + played.played_s / pace
            _wait(clock, stop, due, bus)
            played.behind_s = max(played.behind_s, clock.now() - due)
            bus.publish(disguise(message))
            played.topics[topic_of(type(message))] += 1
            progress(played.played_s)
    except Stopped:
        played.stopped = True
    played.wall_s = clock.now() - begun
    return played


def _wait(clock: Clock, stop: StopSignal, due: float, bus: ZenohBus) -> None:
    """Wait until it is time, answering who asks for the configuration meanwhile."""
    stop.check()
    while (now := clock.now()) < due:
        bus.answer()
        with stop.waiting():
            clock.sleep_until(min(due, now + LOOK_S))


def serve_recorded_config(path: pathlib.Path, bus: ZenohBus) -> None:
    """Answer on `config` with what the recording began with, if it tells."""
    text = read_metadata(path).get("config")
    if text:
        bus.serve_config(text)
