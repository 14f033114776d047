"""What was found in a recording: for programs, for people, and as files."""

from __future__ import annotations

import csv
import json
import pathlib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from chatter.recording import Event, RecordingVerdict
from services.importers.recording import Recording
from services.importers.vocabulary import words

_RPM = ("rpm", "1/min", "min-1", "u/min")
_LIKELY_RPM = (60.0, 60000.0)
_COLUMNS = ("start_s", "end_s", "frequency_hz", "kind", "confidence")
_SURE = 0.5
"""Confidence below which a found line is called less sure: half of what is not forced is something else."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Detected:
    """A recording and its verdict.

    Attributes
    ----------
    recording
        The channels that were judged.
    verdict
        Of all of them together.
    notes
        What a reader should know.
    """

    recording: Recording
    verdict: RecordingVerdict
    notes: tuple[str, ...] = ()

    def as_dict(self) -> dict[str, Any]:
        """Return the keys of the command line."""
        return {
            "file": self.recording.source,
            "channel": ", ".join(self.recording.names),
            "channels": list(self.recording.names),
            "rate_hz": self.recording.rate_hz,
            "duration_s": self.recording.duration_s,
            "verdict": self.verdict.verdict,
            "confidence": self.verdict.confidence if self.verdict.verdict else None,
            "doubt": self.verdict.doubt,
            "events": [_event(event) for event in self.verdict.events],
            "notes": list(self.notes),
        }

    def _sure(self) -> str:
        """Return how sure the verdict is, in words."""
        events = [e for e in self.verdict.events if e.kind == "regenerative"]
        return _sure(max((e.confidence for e in events), default=1.0), self.verdict.doubt)

    def words(self) -> str:
        """Return what was found, as one would say it."""
        recording = self.recording
        lines = [sentence(event, self.verdict.doubt) for event in self.verdict.events]
        if self.verdict.verdict == "stable":
            lines.append(f"no chatter in {recording.duration_s:.1f} s, {self._sure()}")
        channels = f"channel{'s' if len(recording.names) > 1 else ''} {', '.join(recording.names)}"
        return "\n".join((*lines, f"({recording.source}, {channels}, {recording.rate_hz:g} Hz)"))

    def write(
        self, out: pathlib.Path, *, title: str, band_hz: tuple[float, float] | None, spindle_hz: float | None,
        tools: int | None,
    ) -> list[pathlib.Path]:  # fmt: skip
        """Write a figure, the events as a table, and everything as JSON; returns where."""
        from services.figures import detection_figure, write_detection_figure

        recording = self.recording
        units = set(recording.units)
        figure = detection_figure(
            recording.samples, recording.rate_hz, verdict=self.verdict.verdict or "unknown",
            events=[Drawn.of(event) for event in self.verdict.events], band_hz=band_hz, title=title,
            said=self._sure(), unit=units.pop() if len(units) == 1 else "", spindle_hz=spindle_hz, tools=tools,
        )  # fmt: skip
        table, answer = out / "events.csv", out / "detect.json"
        with table.open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow(_COLUMNS)
            writer.writerows(_event(event).values() for event in self.verdict.events)
        answer.write_text(json.dumps(self.as_dict(), indent=2) + "\n", encoding="utf-8")
        return [write_detection_figure(figure, out / "detect.png"), table, answer]


@dataclass(frozen=True, slots=True)
class Drawn:
    """An episode as the figure wants it."""

    start_s: float
    end_s: float
    frequency_hz: float
    kind: str
    confidence: float

    @classmethod
    def of(cls, event: Event) -> Drawn:
        """Return an event with the units in its names."""
        return cls(event.start, event.end, event.frequency_hz, event.kind, event.confidence)


def _event(event: Event) -> dict[str, Any]:
    values = (event.start, event.end, event.frequency_hz, event.kind, event.confidence)
    return dict(zip(_COLUMNS, values, strict=True))


def sentence(event: Event, doubt: str | None = None) -> str:
    """Return one event as one would say it, with what makes it less sure."""
    what = "forced vibration" if event.kind == "forced" else "chatter"
    how = (
        _sure(event.confidence, doubt) if event.kind == "forced" else f"regenerative, {_sure(event.confidence, doubt)}"
    )
    return f"{what} from {event.start:.1f} s to {event.end:.1f} s at {event.frequency_hz:.0f} Hz, {how}"


def _sure(confidence: float, doubt: str | None) -> str:
    if doubt is None and confidence >= _SURE:
        return "sure"
    return f"less sure: {doubt or 'other vibration is nearly as strong'}"


def speed_told(whole: Recording) -> list[str]:
    """Say what a channel of spindle speed tells, if the file has one."""
    for k, (name, unit) in enumerate(zip(whole.names, whole.units, strict=True)):
        values = whole.samples[:, k][np.isfinite(whole.samples[:, k])]
        if unit.lower() not in _RPM and not {"rpm", "drehzahl"} & set(words(name)) or not values.size:
            continue
        speed = float(np.median(values))
        if _LIKELY_RPM[0] <= speed <= _LIKELY_RPM[1]:
            return [f"{name} is {speed:.0f} 1/min in the median: --speed-rpm {speed:.0f} tells forced lines better"]
    return []


def left_out(all_names: Sequence[str], used: Sequence[str]) -> list[str]:
    """Say which channels were not judged."""
    others = [name for name in all_names if name not in used]
    if not others:
        return []
    how = "--channel NAME takes another, --channel all every one that varies"
    return [f"judged {', '.join(used)}; not {', '.join(others)} ({how})"]
