"""A run in the words of the people who stand at the machine."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from services.messages import ADVICE, MODE
from services.metrics import GIVE_UP_EVENT, Summary, forced_block
from services.record import RunRecord

Tone = Literal["good", "warn", "bad", "neutral"]
NOTHING = "–"
NO_TWIN = "There is no cut without control to compare it with: this is what was recorded, and no more."


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """What is said first: how it stands, in one line, and what lies behind it."""

    tone: Tone
    title: str
    sentences: tuple[str, ...]


LIMIT_SOURCES = {
    "air": "learned in air",
    "floor": "from the noise of the present cut",
    "configured": "configured, until learned",
    "cutting": "learned in quiet cutting",
    "reference": "learned from a reference",
    "spectrum": "from the spectrum itself",
    "none": "not learned yet",
}


def limit_source(source: str | None) -> str:
    """Say where a limit comes from."""
    return LIMIT_SOURCES.get(source or "none", source or "none")


def noise_passes(per_h: float | None) -> str:
    """Say how often stationary noise passes a limit; nothing when nobody knows."""
    if per_h is None:
        return ""
    if per_h > 1.0:
        return f"noise alone passes it {per_h:.2g} times an hour"
    often = "less than once in a million hours" if per_h < 1e-6 else f"about once in {1.0 / per_h:.3g} hours"
    return f"noise alone passes it {often}"


def number(value: float | None, digits: int, unit: str = "") -> str:
    """Format a number with its unit for reading, a dash when there is none."""
    if value is None or not math.isfinite(value):
        return NOTHING
    text = f"{value:.{digits}f}"
    text = text.removeprefix("-") if float(text) == 0.0 else text.replace("-", "−")
    return text + unit if unit == "°" else f"{text} {unit}".rstrip()


def arc_mm(record: RunRecord, summary: Summary) -> float | None:
    """Length of the first commanded move along the surface of the bar (mm)."""
    return None if summary.shift_deg is None else 0.5 * record.diameter_mm * math.radians(abs(summary.shift_deg))


def headline(record: RunRecord, summary: Summary) -> str:
    """Tell the run in one line."""
    return verdict(record, summary).title


def verdict(record: RunRecord, summary: Summary) -> Verdict:
    """Judge the run: tone, one line, and the sentences that explain it."""
    tone, title, sentences = _TELLERS[summary.outcome](record, summary)
    if summary.interrupted:
        sentences = [
            *sentences,
            f"The run was stopped by hand after {number(summary.simulated_s, 2, 's')}; "
            "this report covers what was seen until then.",
        ]
    sentences = [*sentences, _advised(record)]
    tone = "warn" if summary.interrupted and tone == "good" else tone
    return Verdict(tone=tone, title=title, sentences=tuple(s for s in sentences if s))


def _advised(record: RunRecord) -> str:
    """Tell what a controller that only advises would have done first; nothing of any other one."""
    if not any(event.kind == MODE for event in record.events):
        return ""
    first = next((event for event in record.events if event.kind == ADVICE), None)
    if first is None:
        return "Advise only: the controller would have commanded nothing."
    at = number(first.sample / record.sample_rate_hz, 2, "s")
    if first.shift_deg is None:
        return f"Advise only, nothing was commanded; at {at}: {first.text.split(': ', 1)[-1]}"
    return (
        f"Advise only: at {at} the controller would have moved turret 1 to {number(first.shift_deg, 2, '°')}; "
        "nothing was commanded."
    )


Told = tuple[Tone, str, list[str]]


def _found(record: RunRecord, summary: Summary) -> str:
    del record
    line, latency = number(summary.chatter_hz, 0, "Hz"), summary.detection_latency_s
    if latency is None:
        return f"Chatter at {line} was reported {number(summary.detected_s, 2, 's')} after the start."
    if latency < 0.0:
        return f"Chatter at {line} was found {number(-latency, 3, 's')} before it would have marked the part."
    return f"Chatter at {line} was found {number(latency, 3, 's')} after it began."


def _moved(record: RunRecord, summary: Summary) -> str:
    if summary.shift_deg is None:
        return "Turret 1 was not moved."
    waited = (summary.first_command_s or 0.0) - (summary.detected_s or 0.0)
    delayed = summary.detected_s is not None and waited > 0.05
    late = f" The command came {number(waited, 2, 's')} after the alarm." if delayed else ""
    more = "" if summary.moves == 1 else f" It moved {summary.moves} times in all."
    arc = number(arc_mm(record, summary), 2, "mm")
    return (
        f"Turret 1 moved {arc} ({number(summary.shift_deg, 2, '°')}) round the bar, "
        f"so that the waves left by the two tools cancel.{late}{more}"
    )


def _marked(summary: Summary) -> str:
    if summary.marked_length_mm is None:
        return ""
    if not summary.marked_length_mm:
        return "No part of the surface was marked."
    return f"{number(summary.marked_length_mm, 2, 'mm')} of part was marked."


def _rough(summary: Summary) -> str:
    before, after = summary.ra_before_um, summary.ra_after_um
    if before is None or after is None:
        return ""
    times = f", {number(before / after, 1)} times smoother" if after > 0.0 and before > after else ""
    return f"Roughness Ra {number(before, 1, 'µm')} without control, {number(after, 1, 'µm')} with it{times}."


def _suppressed(record: RunRecord, summary: Summary) -> Told:
    since = None
    if summary.suppressed_s is not None and summary.first_command_s is not None:
        since = summary.suppressed_s - summary.first_command_s
    gone = f"The vibration was gone {number(since, 2, 's')} after the command." if since is not None else ""
    title = f"Chatter at {number(summary.chatter_hz, 0, 'Hz')} found and stopped"
    return "good", title, [
        _found(record, summary), _moved(record, summary), gone, _marked(summary), _rough(summary),
    ]  # fmt: skip


def _prevented(record: RunRecord, summary: Summary) -> Told:
    title = f"Chatter at {number(summary.chatter_hz, 0, 'Hz')} stopped before it marked the part"
    return "good", title, [_found(record, summary), _moved(record, summary), _marked(summary), _rough(summary)]


def _stable(record: RunRecord, summary: Summary) -> Told:
    return "good", "No chatter", [
        f"The vibration stayed at or below {number(summary.peak_vibration_um, 2, 'µm')}; "
        f"chatter would be {number(record.threshold_um, 2, 'µm')} or more.",
        "No alarm was raised and turret 1 stayed where it was.",
    ]  # fmt: skip


def _forced(record: RunRecord, summary: Summary) -> Told:
    block = forced_block(record)
    at = None if block is None else float(record.reports.frequency_hz[block])
    return "warn", f"Forced vibration at {number(at, 0, 'Hz')}, no chatter", [
        "The vibration follows the rotation of the spindle: it is driven from outside and does not feed itself.",
        "Moving turret 1 would not help, so it stayed where it was. Look for run-out, a bearing, a belt or a gear.",
        _marked(summary),
    ]  # fmt: skip


def _missed(record: RunRecord, summary: Summary) -> Told:
    del record
    return "bad", "Chatter was not found", [
        f"The cut began to chatter {number(summary.chatter_onset_s, 2, 's')} after the start and no alarm was raised.",
        _marked(summary),
    ]  # fmt: skip


def _not_moved(record: RunRecord, summary: Summary) -> Told:
    return "bad", f"Chatter at {number(summary.chatter_hz, 0, 'Hz')} found, but not acted on", [
        _found(record, summary),
        "" if _advised(record) else "Turret 1 was not moved: see the event log for what held it.",
        _marked(summary),
    ]  # fmt: skip


def _gave_up(record: RunRecord, summary: Summary) -> Told:
    reason = (summary.gave_up_reason or "no reason given").rstrip(".")
    given_up = next((e.sample for e in record.events if e.kind == GIVE_UP_EVENT), 0) / record.sample_rate_hz
    later = ""
    if summary.suppressed_s is not None and summary.suppressed_s > given_up:
        later = f"The vibration faded {number(summary.suppressed_s - given_up, 1, 's')} after that."
    what = "the controller gave up" if later else "could not be stopped"
    return "bad", f"Chatter at {number(summary.chatter_hz, 0, 'Hz')}{': ' if later else ' '}{what}", [
        f"The controller gave up {number(given_up, 2, 's')} after the start: {reason}.", later,
        _found(record, summary), _moved(record, summary), _marked(summary),
        "Cut shallower, support the bar, or change the spindle speed.",
    ]  # fmt: skip


def _not_suppressed(record: RunRecord, summary: Summary) -> Told:
    return "bad", f"Chatter at {number(summary.chatter_hz, 0, 'Hz')} found, but not stopped", [
        _found(record, summary), _moved(record, summary),
        "The vibration did not stay below the threshold for half a second afterwards.", _marked(summary),
    ]  # fmt: skip


def _false_alarm(record: RunRecord, summary: Summary) -> Told:
    return "warn", "Alarm without marking chatter", [
        _found(record, summary), _moved(record, summary),
        "The same cut without control did not pass the threshold either: the alarm was false, or very early.",
    ]  # fmt: skip


def _undecided(record: RunRecord, summary: Summary) -> Told:
    found = summary.detected_s is not None
    title = f"Chatter at {number(summary.chatter_hz, 0, 'Hz')} found; the run ended before the outcome was known"
    return "warn", title if found else "The run ended before chatter could be judged", [
        _found(record, summary) if found else "", _moved(record, summary), _marked(summary),
    ]  # fmt: skip


def _no_cut(record: RunRecord, summary: Summary) -> Told:
    del record
    return "neutral", "The tools never reached the part", [
        f"{number(summary.simulated_s, 2, 's')} of air cutting was recorded; there is nothing to judge.",
    ]  # fmt: skip


def _no_alarm(record: RunRecord, summary: Summary) -> Told:
    del record
    return "neutral", "No alarm was raised", [
        f"{number(summary.simulated_s, 2, 's')} were recorded.", _marked(summary), NO_TWIN,
    ]  # fmt: skip


def _alarm_ended(record: RunRecord, summary: Summary) -> Told:
    return "good", f"Chatter at {number(summary.chatter_hz, 0, 'Hz')} found, and the alarm ended after the move", [
        _found(record, summary), _moved(record, summary), _marked(summary), NO_TWIN,
    ]  # fmt: skip


def _alarm_lasts(record: RunRecord, summary: Summary) -> Told:
    return "bad", f"Chatter at {number(summary.chatter_hz, 0, 'Hz')} found, and the alarm lasts", [
        _found(record, summary), _moved(record, summary),
        "The monitor still said chatter within the last half second.", _marked(summary), NO_TWIN,
    ]  # fmt: skip


_TELLERS = {
    "suppressed": _suppressed, "prevented": _prevented, "stable": _stable, "forced": _forced, "missed": _missed,
    "not_moved": _not_moved, "gave_up": _gave_up, "not_suppressed": _not_suppressed, "false_alarm": _false_alarm,
    "undecided": _undecided, "no_cut": _no_cut, "no_alarm": _no_alarm, "alarm_ended": _alarm_ended,
    "alarm_lasts": _alarm_lasts,
}  # fmt: skip


def tiles(record: RunRecord, summary: Summary) -> list[tuple[str, str]]:
    """List the few numbers that matter, each with what it is."""
    latency, arc = summary.detection_latency_s, arc_mm(record, summary)
    early = latency is not None and latency < 0.0
    when = "before it passed the threshold" if early else "from onset to detection"
    shown = [
        (summary.chatter_hz, number(summary.chatter_hz, 0, "Hz"), "chatter frequency"),
        (latency, number(None if latency is None else 1e3 * abs(latency), 0, "ms"), when),
        (arc, number(arc, 2, "mm"), f"turret 1 moved ({number(summary.shift_deg, 2, '°')})"),
        (summary.marked_length_mm, number(summary.marked_length_mm, 2, "mm"), "of part marked"),
    ]  # fmt: skip
    if summary.ra_before_um is None:
        shown.append((summary.ra_after_um, number(summary.ra_after_um, 1, "µm"), "roughness Ra, once calm"))
    else:
        both = f"{number(summary.ra_before_um, 1)} → {number(summary.ra_after_um, 1, 'µm')}"
        shown.append((summary.ra_after_um, both, "roughness Ra, without → with"))
    if summary.detected_s is None:
        shown.append((summary.peak_vibration_um, number(summary.peak_vibration_um, 2, "µm"), "largest vibration"))
    return [(text, caption) for value, text, caption in shown if value is not None]
