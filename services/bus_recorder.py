"""Records what is said about a machine on the bus, and what was run; every gap is counted.

It only listens. What it has to say (a gap, a full disk) is an event on the bus and in the file; who comes and goes is
an event in the file alone.
"""

from __future__ import annotations

import hashlib
import json
from collections import Counter
from collections.abc import Callable
from typing import Any

from services.bus import Received
from services.clock import Clock
from services.config import load_case, shipped
from services.gaps import Gaps
from services.messages import Event, Message, SampleBlock
from services.node import Say
from services.process import Stopped, StopSignal
from services.recording_writer import McapRecorder
from services.wire import DecodeError
from services.zenoh_bus import ZenohBus

SERVICE = "recorder"
LOOK_S = 0.004
ASK_S = 1.0
"""How long an answer about the configuration is waited for, before asking again."""
Show = Callable[[str], None]


class BusRecorder:
    """Puts everything on the bus of one machine into a recording.

    Parameters
    ----------
    bus
        An open bus.
    recorder
        Open recorder; whoever opened it closes it.
    known
        What the recording began with, see `run_metadata`; what is told later is added.
    clock
        Monotonic.
    say
        Told in words what happens.

    Attributes
    ----------
    runs
        Identifiers of the runs that were heard, in order.
    topics
        Messages by topic.
    undecodable
        Payloads that are recorded although they are no message.
    """

    def __init__(self, bus: ZenohBus, recorder: McapRecorder, known: dict[str, str], *, clock: Clock, say: Say) -> None:
        self._bus, self._recorder, self._known, self._clock, self._say = bus, recorder, known, clock, say
        self._begun = clock.now()
        self._sample = self._events = 0
        self._answer: Callable[[], str | None] | None = None
        self._asked = 0.0
        self._told: dict[str, tuple[float, int]] = {}
        self._cases = {load_case(name).digest: name for name in shipped()}
        self.gaps, self.topics = Gaps(), Counter[str]()
        self.runs: list[str] = []
        self.undecodable = 0
        self.config_known = False
        self._inbox, self._presence = bus.subscribe(), bus.presence()
        bus.announce(SERVICE)

    def run(self, stop: StopSignal, until_s: float, show: Show) -> None:
        """Record until stopped, for so long (s), or until the disk takes no more; what came until then is kept."""
        try:
            while self._clock.now() - self._begun < until_s and not self._recorder.failure:
                self.look()
                show(self.line())
                with stop.waiting():
                    self._clock.sleep_until(self._clock.now() + LOOK_S)
        except Stopped:
            pass
        self.look()
        if self._recorder.failure:
            self._tell("recording_stopped", self._recorder.failure)

    def look(self) -> None:
        """Take what has come."""
        for received in self._inbox.take():
            self.topics[received.topic] += 1
            self._recorder.write(received.topic, received.payload, received.encoding, self._now_ns())
            self._see(received)
        for who, came in self._presence.changes():
            if who != SERVICE:
                self._note("alive" if came else "gone", f"{who} {'is alive' if came else 'is gone'}")
        self._ask()
        if self._recorder.lost and not self._recorder.failure:
            self._tell_new("recording_lossy", self._recorder.lost, "messages come faster than they can be written")

    def line(self) -> str:
        """Return how it stands in one line."""
        size, gaps = 1e-6 * self._recorder.bytes_written, sum(self.gaps.missing().values())
        return f"{self.topics.total()} messages, {size:.1f} MB, {gaps} missing"

    def answer(self) -> dict[str, Any]:
        """Return what there is to count, for JSON."""
        return {
            "service": SERVICE, "machine": self._bus.machine, "file": self._recorder.path,
            "parts": self._recorder.parts, "runs": self.runs,
            "config_known": self.config_known, "duration_s": self._clock.now() - self._begun,
            "messages": self.topics.total(), "topics": dict(self.topics), "written": self._recorder.written,
            "bytes": self._recorder.bytes_written, "missing": sum(self.gaps.missing().values()),
            "missing_topics": self.gaps.missing(), "lost": self._recorder.lost, "undecodable": self.undecodable,
            "unknown_topics": self._inbox.unknown, "failure": self._recorder.failure or None,
        }  # fmt: skip

    def _see(self, received: Received) -> None:
        try:
            message: Message = received.message()
        except DecodeError as error:
            self.undecodable += 1
            self._tell_new("decode_error", self.undecodable, f"{received.topic}: {error} (recorded as it came)")
            return
        if isinstance(message, SampleBlock):
            self._sample = message.first_sample
            if message.run not in self.runs:
                self._begin(message.run)
        skipped = self.gaps.see(message)
        if skipped:
            text = f"{skipped} messages of {received.topic} from {message.source} are missing before {message.sequence}"
            self._tell_new("recording_gap", sum(self.gaps.missing().values()), text)

    def _begin(self, run: str) -> None:
        """Note a run that was not heard before; only the first one tells what the recording is of."""
        self.runs.append(run)
        self._say(f"run {run}" + (" begins in the same file" if len(self.runs) > 1 else ""))
        if len(self.runs) == 1:
            self._known["run"] = run
            self._recorder.describe(self._known)
        else:
            self._note("run", f"another run in the same recording: {run}")

    def _ask(self) -> None:
        """Ask for the configuration of the first run, again and again until it is told."""
        if self.config_known or len(self.runs) != 1:
            return
        text = self._answer() if self._answer is not None else None
        if text is not None:
            self.config_known = True
            self._known |= self._told_by(text)
            self._recorder.describe(self._known)
            self._say(f"configuration {self._known['sha256'][:12]} ({self._known['case']})")
        elif self._answer is None or self._clock.now() - self._asked > ASK_S:
            self._answer, self._asked = self._bus.ask_config(ASK_S), self._clock.now()

    def _tell_new(self, kind: str, count: int, text: str) -> None:
        """Tell something of which there is more than before, each kind at most once a second."""
        when, before = self._told.get(kind, (-1.0, 0))
        if count > before and self._clock.now() - when > 1.0:
            self._told[kind] = self._clock.now(), count
            self._tell(kind, f"{text} ({count} in all)")

    def _tell(self, kind: str, text: str) -> None:
        self._say(text)
        self._bus.publish(self._note(kind, text))

    def _note(self, kind: str, text: str) -> Event:
        self._events += 1
        event = Event(
            run=self.runs[-1] if self.runs else "", source=SERVICE, sequence=self._events, sample=self._sample,
            kind=kind, text=text[:500],
        )  # fmt: skip
        self._recorder.record(event, self._now_ns())
        return event

    def _now_ns(self) -> int:
        return round(1e9 * (self._clock.now() - self._begun))

    def _told_by(self, text: str) -> dict[str, str]:
        """Return what a configuration tells of a run: itself, its digest, and its name or title."""
        digest = hashlib.sha256(text.encode()).hexdigest()
        return {"case": self._cases.get(digest) or _title(text), "config": text, "sha256": digest}


def _title(text: str) -> str:
    try:
        return str(json.loads(text)["case"]["title"])
    except (ValueError, TypeError, KeyError):
        return ""
