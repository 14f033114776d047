"""The alarms of many recordings in one table: when, at what frequency, and what became of them."""

# SciPy has no complete type stubs.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false, reportUnknownArgumentType=false

from __future__ import annotations

import csv
import math
import pathlib
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass, fields
from datetime import UTC, datetime
from typing import Any

import numpy as np
from scipy import signal

from services.config import Case
from services.errors import InputError
from services.messages import BLOCK_S, TOPICS, ChatterReport, Floats, MachineState, Truth, TurretCommand
from services.metrics import CHATTER_STATE, ENVELOPE_S
from services.recording_file import RecordingReader, first_part
from services.replay import case_of
from services.wire import DecodeError, decode

NEEDED = (ChatterReport, TurretCommand, MachineState, Truth)
CALM_S = 0.5
"""An alarm that comes back sooner is the same one (s)."""


@dataclass(slots=True, kw_only=True)
class Alarm:
    """A line of the history; None for what did not happen or is not known.

    `onset_s` is when the vibration passed the threshold and `marked_mm` how much was cut above it: both need the truth
    of a simulated machine. `suppressed_s` is when the alarm ended for good.
    """

    file: str
    begun_utc: str
    machine: str | None
    case: str | None
    run: str
    alarm_s: float
    onset_s: float | None = None
    frequency_hz: float | None = None
    kind: str | None = None
    shift_deg: float | None = None
    moved_s: float | None = None
    suppressed_s: float | None = None
    marked_mm: float | None = None


COLUMNS = tuple(field.name for field in fields(Alarm))


def recordings_in(places: Iterable[pathlib.Path]) -> list[pathlib.Path]:
    """Return the recordings named, and those in the folders named, each once: later parts come with the first."""
    found: list[pathlib.Path] = []
    for place in places:
        if not place.exists():
            raise InputError("file", str(place), "an existing recording or folder")
        found += sorted(place.rglob("*.mcap")) if place.is_dir() else [place]
    if not found:
        raise InputError("file", ", ".join(map(str, places)), "recordings (.mcap), or folders that hold some")
    firsts = {path for path in found if first_part(path) == path}
    return [path for path in dict.fromkeys(found) if path in firsts or first_part(path) not in firsts]


def alarms_of(path: pathlib.Path) -> tuple[list[Alarm], list[str]]:
    """Return the alarms in a recording, and what it lacks; nothing is held in memory but the alarms.

    Raises
    ------
    InputError
        If it is no recording.
    """
    reader = RecordingReader(path)
    seen: _Alarms | None = None
    broken = 0
    topics = {topic: kind for topic, kind in TOPICS.items() if kind in NEEDED}
    for recorded in reader:
        kind = topics.get(recorded.topic)
        if kind is None:
            continue
        try:
            message = decode(kind, recorded.payload)
        except DecodeError:
            broken += 1
            continue
        seen = seen or _Alarms(path)
        seen.see(message)
    alarms = seen.close(reader.metadata) if seen else []
    return alarms, reader.notes + ([f"{path.name}: {broken} messages cannot be decoded"] if broken else [])


class _Alarms:
    """Follows one recording, message by message."""

    def __init__(self, path: pathlib.Path) -> None:
        self.path, self.alarms = path, list[Alarm]()
        self._case = _case(path)
        self._rate = self._case.settings.sample_rate_hz if self._case else math.nan
        self._marks = _Marks(self._case) if self._case else None
        self._last = -math.inf
        self._pending: tuple[float, float] | None = None

    def see(self, message: Any) -> None:
        """Take a message."""
        if isinstance(message, ChatterReport):
            self._report(message)
        elif isinstance(message, TurretCommand):
            self._command(message)
        elif isinstance(message, Truth) and self._marks is not None:
            for time_s, length_mm in self._marks.above(message):
                self._mark(time_s, length_mm)
        elif isinstance(message, MachineState) and self._marks is not None:
            self._marks.state(message)

    def _report(self, report: ChatterReport) -> None:
        self._rate = report.samples / BLOCK_S if math.isnan(self._rate) else self._rate
        end_s = report.first_sample / self._rate + BLOCK_S
        if report.state != CHATTER_STATE:
            if self.alarms and self.alarms[-1].suppressed_s is None:
                self.alarms[-1].suppressed_s = end_s
            return
        if not self.alarms or self.alarms[-1].run != report.run or end_s - self._last > CALM_S:
            self._begin(report, end_s)
        alarm, self._last = self.alarms[-1], end_s
        alarm.suppressed_s = None
        alarm.frequency_hz = report.frequency_hz if alarm.frequency_hz is None else alarm.frequency_hz
        alarm.kind = report.kind if alarm.kind is None else alarm.kind

    def _begin(self, report: ChatterReport, end_s: float) -> None:
        alarm = Alarm(file=str(self.path), begun_utc="", machine=None, case=None, run=report.run, alarm_s=end_s)
        if self._pending is not None:
            alarm.onset_s, alarm.marked_mm = self._pending
            self._pending = None
        elif self._marks is not None and self._marks.known:
            alarm.marked_mm = 0.0
        self.alarms.append(alarm)

    def _command(self, command: TurretCommand) -> None:
        if command.action == "move" and self.alarms and self.alarms[-1].shift_deg is None:
            alarm = self.alarms[-1]
            alarm.shift_deg, alarm.moved_s = command.shift_deg, command.issued_sample / self._rate

    def _mark(self, time_s: float, length_mm: float) -> None:
        """Note what was cut above the threshold: to the alarm that lasts, or to the one that follows."""
        alarm = self.alarms[-1] if self.alarms else None
        if alarm is not None and (alarm.suppressed_s is None or time_s - self._last < CALM_S):
            alarm.onset_s = time_s if alarm.onset_s is None else alarm.onset_s
            alarm.marked_mm = (alarm.marked_mm or 0.0) + length_mm
            return
        begun, length = self._pending or (time_s, 0.0)
        self._pending = begun, length + length_mm

    def close(self, metadata: dict[str, str]) -> list[Alarm]:
        """Return the alarms, with what the recording says of itself."""
        begun = metadata.get("begun_utc") or _written(self.path)
        for alarm in self.alarms:
            alarm.begun_utc, alarm.case = begun, metadata.get("case") or None
            alarm.machine = metadata.get("machine") or (self._case.settings.machine if self._case else None)
        return self.alarms


class _Marks:
    """Finds, block by block, where the vibration in the band is above the threshold."""

    def __init__(self, case: Case) -> None:
        middle, rate = case.settings.reference_chatter_hz, case.settings.sample_rate_hz
        self._sos: Floats = signal.butter(4, (0.75 * middle, 1.25 * middle), btype="bandpass", fs=rate, output="sos")  # pyright: ignore
        self._state: Floats = np.zeros((len(self._sos), 2))
        self._feed_mm_s = 1e3 * case.cutting.feed_per_rev * case.cutting.spindle_hz
        self._threshold_um = 1e6 * case.settings.threshold * 0.5 * case.cutting.feed_per_rev
        self._settle_s = 1.0 / case.cutting.spindle_hz
        self._entered: float | None = None
        self._window = round(ENVELOPE_S * rate)
        self.known = False

    def state(self, state: MachineState) -> None:
        """Follow feed and speed."""
        self._feed_mm_s = state.feed_mm_per_rev * state.spindle_speed_rpm / 60.0

    def above(self, truth: Truth) -> list[tuple[float, float]]:
        """Return when (s) and how much (mm) was cut above the threshold in a block."""
        self.known = True
        band, self._state = signal.sosfilt(self._sos, truth.vibration_um, zi=self._state)
        start_s = truth.first_sample / truth.sample_rate_hz
        if not truth.in_cut.all():
            self._entered = None
            return []
        self._entered = start_s if self._entered is None else self._entered
        found: list[tuple[float, float]] = []
        for first in range(0, band.size - self._window + 1, self._window):
            time_s = start_s + first / truth.sample_rate_hz
            power = float(np.mean(band[first : first + self._window] ** 2))
            if math.sqrt(2.0 * power) > self._threshold_um and time_s - self._entered >= self._settle_s:
                found.append((time_s, self._feed_mm_s * self._window / truth.sample_rate_hz))
        return found


def _case(path: pathlib.Path) -> Case | None:
    try:
        return case_of(path)
    except InputError:
        return None


def _written(path: pathlib.Path) -> str:
    """Return when a file was last written: later than it was begun, but near it."""
    return f"{datetime.fromtimestamp(path.stat().st_mtime, UTC):%Y-%m-%dT%H:%M:%SZ}"


def history(
    places: Iterable[pathlib.Path], progress: Callable[[float], None] = lambda _: None
) -> tuple[list[Alarm], list[pathlib.Path], list[str]]:
    """Return the alarms of all recordings in the order of time, the recordings that were read, and the notes.

    Parameters
    ----------
    places
        Recordings, and folders of recordings.
    progress
        Told the share that is done, 0...1.
    """
    paths = recordings_in(list(places))
    alarms, read, notes = list[Alarm](), list[pathlib.Path](), list[str]()
    for number, path in enumerate(paths):
        try:
            found, said = alarms_of(path)
        except InputError as error:
            notes.append(str(error))
            continue
        finally:
            progress((number + 1) / len(paths))
        alarms += found
        notes += said
        read.append(path)
    alarms.sort(key=lambda alarm: (alarm.begun_utc, alarm.file, alarm.alarm_s))
    return alarms, read, notes


def write_history(alarms: Iterable[Alarm], path: pathlib.Path) -> pathlib.Path:
    """Write the history as CSV."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w", newline="", encoding="utf-8") as file:
        rows = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        rows.writeheader()
        rows.writerows(asdict(alarm) for alarm in alarms)
    return path
