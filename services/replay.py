"""A recording through monitor and controller again, and what they say now beside what they said then."""

from __future__ import annotations

import hashlib
import json
import math
import pathlib
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from services.bus import InMemoryBus, Node
from services.clock import Clock
from services.config import Case
from services.errors import InputError
from services.messages import Event, Message, SampleBlock, Truth, TurretCommand
from services.nodes import controller, monitor
from services.recording_file import RecordingReader, read_messages, read_metadata
from services.sections import build
from services.tape import Tap, Tape

SOURCES = (monitor.SOURCE, controller.SOURCE)
"""Who speaks anew in a replay; everybody else is quoted."""
MOST_EXAMPLES = 20
FORMAT = ("version", "minor")
"""Fields that tell the version of a message and not what it says."""
LAG_S = 1.0
"""What was said of a block stands in the file at most so far behind it."""


@dataclass(slots=True)
class Comparison:
    """What monitor and controller said in the recording and say in the replay, message by message.

    Attributes
    ----------
    compared, different
        Messages of each type that are in both, and those of them that are not equal to the bit.
    unrecorded, unexpected
        Messages of each type only in the replay, before the recording of that type ends, and only in the recording.
    examples
        The first differences, in words.
    """

    compared: Counter[str] = field(default_factory=Counter[str])
    different: Counter[str] = field(default_factory=Counter[str])
    unrecorded: Counter[str] = field(default_factory=Counter[str])
    unexpected: Counter[str] = field(default_factory=Counter[str])
    examples: list[str] = field(default_factory=list[str])

    @property
    def same(self) -> bool:
        """Whether there was something to compare, and all of it is equal."""
        return self.compared.total() > 0 and not self.different + self.unrecorded + self.unexpected


@dataclass(frozen=True, slots=True, kw_only=True)
class Replay:
    """A recording as it was, and what monitor and controller say of it now.

    Attributes
    ----------
    case, seed, run
        What was run.
    tape
        Up to the stop: what the others said then, and monitor and controller now. Latencies are those of the
        recording, unless it was made in lockstep; the wall time is that of monitor and controller alone.
    comparison
        Of what was said from start to stop.
    metadata
        What the recording says of itself.
    notes
        What the file lacks.
    """

    case: Case
    seed: int
    metadata: dict[str, str]
    run: str
    tape: Tape
    comparison: Comparison
    notes: tuple[str, ...]


def case_of(path: pathlib.Path) -> Case:
    """Return the case with which a recording begins.

    Raises
    ------
    InputError
        If the recording does not tell, or tells what this version does not understand.
    """
    metadata = read_metadata(path)
    text = metadata.get("config", "")
    digest = hashlib.sha256(text.encode()).hexdigest()
    if digest != metadata.get("sha256"):
        rule = "a recording that begins with its configuration" + (", undamaged" if text else "")
        raise InputError("file", str(path), rule)
    try:
        tables = dict(json.loads(text))
    except (ValueError, TypeError) as error:
        raise InputError("file", str(path), f"a recording whose configuration can be read ({error})") from error
    return Case(name=metadata.get("case", path.stem), text=text, digest=digest, **build(tables))


def run_of(path: pathlib.Path) -> str:
    """Return the identifier of the run in a recording, empty when it holds no block."""
    blocks = (message.run for _, message in read_messages(path) if isinstance(message, SampleBlock))
    return read_metadata(path).get("run") or next(blocks, "")


def replay_into(messages: Iterable[Message], nodes: Sequence[Node], tap: Callable[[Any], None]) -> None:
    """Publish recorded messages to nodes, one after the other; the tap sees them and all that follows."""
    bus = InMemoryBus(nodes, tap=tap)
    for message in messages:
        bus.publish(message)


def replay(
    path: pathlib.Path,
    clock: Clock,
    case: Case | None = None,
    *,
    start_s: float = 0.0,
    stop_s: float = math.inf,
    pace: float | None = None,
) -> Replay:
    """Feed the blocks of a recording to a fresh monitor and a fresh controller.

    Parameters
    ----------
    path
        Recording.
    clock
        For pace, latency and speed; nothing else depends on it.
    case
        Another configuration than the one in the file.
    start_s, stop_s
        Stretch that is paced and compared (s of the machine's samples). What lies before it is fed all the same, as
        fast as possible: the monitor learns its limits there.
    pace
        Times real time; None: as fast as it goes.
    """
    used, run = case or case_of(path), run_of(path)
    reader = RecordingReader(path)
    nodes = (monitor.MonitorNode(used, run), controller.ControllerNode(used, run))
    for node in nodes:
        node.prepare()
    player = _Player(reader, run, used.settings.sample_rate_hz, (start_s, stop_s))
    taker = _Taker(clock)
    replay_into(_paced(player.inputs(), clock, used.settings.sample_rate_hz, start_s, pace, taker), nodes, taker)
    tape = taker.tape
    tape.blocks_lost = nodes[0].blocks_lost
    if reader.metadata.get("clock") == "wall":
        tape.latency_ms = player.latency_ms
    now = [message for message in taker.said if player.within(message)]
    return Replay(
        case=used,
        seed=int(seed) if (seed := reader.metadata.get("seed", "")).isdecimal() else used.settings.seed,
        metadata=reader.metadata,
        run=run,
        tape=tape,
        comparison=compare(player.then, now),
        notes=tuple(reader.notes),
    )


def _paced(
    messages: Iterable[Message], clock: Clock, rate_hz: float, start_s: float, pace: float | None, taker: _Taker
) -> Iterator[Message]:
    """Hand on each block when it is due, and measure how long the nodes take for it."""
    begin: float | None = None
    for message in messages:
        if pace is not None and isinstance(message, SampleBlock):
            ahead = message.first_sample / rate_hz - start_s
            if ahead >= 0.0:
                begin = clock.now() - ahead / pace if begin is None else begin
                clock.sleep_until(begin + ahead / pace)
        since = clock.now()
        yield message
        taker.tape.wall_s += clock.now() - since


class _Player:
    """Sorts a recording into what is fed again and what is compared."""

    def __init__(self, reader: RecordingReader, run: str, rate_hz: float, stretch_s: tuple[float, float]) -> None:
        self._reader, self._run, self._rate, self._stretch = reader, run, rate_hz, stretch_s
        self._sent: dict[int, int] = {}
        self.then: list[Message] = []
        self.latency_ms: list[float] = []

    def inputs(self) -> Iterator[Message]:
        """Yield what the nodes did not say themselves, up to the stop; keep the rest to compare."""
        over = False
        for _, message, log_time_ns in self._reader.messages():
            if message.run != self._run:
                continue
            if isinstance(message, SampleBlock):
                time_s = message.first_sample / self._rate
                if time_s > self._stretch[1] + LAG_S:
                    return
                over = over or time_s >= self._stretch[1]
                self._sent[message.sequence] = log_time_ns
            if message.source not in SOURCES:
                if not over:
                    yield message
            elif self.within(message):
                self.then.append(message)
                if isinstance(message, TurretCommand) and message.cause in self._sent:
                    self.latency_ms.append(1e-6 * (log_time_ns - self._sent[message.cause]))

    def within(self, message: Message) -> bool:
        """Whether a message speaks of a block in the stretch."""
        names = ("first_sample", "issued_sample", "sample")
        sample: int = next((getattr(message, name) for name in names if hasattr(message, name)), 0)
        end_of_block = isinstance(message, TurretCommand | Event)
        return self._stretch[0] <= (sample - end_of_block) / self._rate < self._stretch[1]


class _Taker(Tap):
    """Keeps everything that is on the bus, and what the nodes say apart."""

    def __init__(self, clock: Clock) -> None:
        super().__init__(clock)
        self.said = list[Message]()

    def __call__(self, message: Any) -> None:
        super().__call__(message)
        if message.source in SOURCES:
            self.said.append(message)


def repeatable(again: Replay) -> bool:
    """Whether the cut can be repeated without control: recorded from its first sample on, with truth and seed."""
    blocks = again.tape.of(SampleBlock)
    return bool(again.metadata.get("seed") and again.tape.of(Truth) and blocks and blocks[0].first_sample == 0)


def compare(then: Iterable[Message], now: Iterable[Message]) -> Comparison:
    """Compare what was said then and now; messages with the same source, type and sequence belong together."""
    old, new = _numbered(then), _numbered(now)
    found = Comparison()
    last: dict[tuple[str, type[Message]], int] = {}
    for source, kind, number in old:
        last[source, kind] = max(number, last.get((source, kind), -1))
    for key, message in new.items():
        name = key[1].__name__
        if key in old:
            _see(found, name, old[key], message)
        elif key[2] <= last.get(key[:2], -1):
            found.unrecorded[name] += 1
    found.unexpected.update(key[1].__name__ for key in old if key not in new)
    return found


def _see(found: Comparison, name: str, then: Message, now: Message) -> None:
    found.compared[name] += 1
    pairs = {key: (getattr(then, key), getattr(now, key)) for key in now.__struct_fields__ if key not in FORMAT}
    words = [f"{key} {_short(a)} then, {_short(b)} now" for key, (a, b) in pairs.items() if not _equal(a, b)]
    if words:
        found.different[name] += 1
        if len(found.examples) < MOST_EXAMPLES:
            found.examples.append(f"{name} {now.sequence}: {'; '.join(words)}")


def _numbered(messages: Iterable[Message]) -> dict[tuple[str, type[Message], int], Message]:
    return {(message.source, type(message), message.sequence): message for message in messages}


def _equal(a: Any, b: Any) -> bool:
    if isinstance(a, np.ndarray):
        return np.array_equal(a, b, equal_nan=True)
    return bool(a == b)


def _short(value: Any) -> str:
    return f"{value.size} samples" if isinstance(value, np.ndarray) else f"{value!r:.60}"
