"""The recorder of a lockstep run: everything on the bus, stamped with the time of the machine's samples."""

from __future__ import annotations

from services.messages import TOPICS, Event, Message
from services.recording_writer import McapRecorder

SOURCE = "recorder"
_INDICES = ("first_sample", "sample", "issued_sample")


class RecorderNode:
    """Hands every message to a recorder; says once when the recording ends early, and when messages are lost.

    Parameters
    ----------
    recorder
        Open recorder; whoever opened it closes it.
    run
        Identifier of the run.
    sample_rate_hz
        Of the machine.
    wait
        Wait for room rather than lose a message: for a loop without a schedule.
    """

    subscribes = tuple(TOPICS.values())

    def __init__(self, recorder: McapRecorder, run: str, sample_rate_hz: float, *, wait: bool = True) -> None:
        self._recorder, self._run, self._rate, self._wait = recorder, run, sample_rate_hz, wait
        self._sample = self._events = 0
        self._said: set[str] = set()

    def prepare(self) -> None:
        """Nothing to compile."""

    def handle(self, message: Message) -> list[Message]:
        """Record a message; an event follows when that begins to fail."""
        self._sample = max(self._sample, *(getattr(message, name, 0) for name in _INDICES))
        if self._recorder.record(message, round(1e9 * self._sample / self._rate), wait=self._wait):
            return []
        kind = "recording_stopped" if self._recorder.failure else "recording_lossy"
        if kind in self._said:
            return []
        self._said.add(kind)
        self._events += 1
        return [
            Event(
                run=self._run,
                source=SOURCE,
                sequence=self._events,
                cause=message.sequence,
                sample=self._sample,
                kind=kind,
                text=self._recorder.failure or "messages come faster than they can be written",
            )  # fmt: skip
        ]
