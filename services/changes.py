"""Everything that changed in a run, in one list: states, limits and events."""

from __future__ import annotations

from typing import NamedTuple

from services.messages import BLOCK_S, ChatterReport, MachineState
from services.record import RunRecord
from services.sentences import limit_source
from services.tape import Tape

GUARD_EVENT, MONITOR_EVENT = "guard_state", "monitor_state"
"""Kinds of event by which guard and monitor tell their own changes: the guard's may be several within one block, the
monitor's say less than its reports."""


class Change(NamedTuple):
    """Something that is from a moment on (s since the record began) otherwise than before."""

    time_s: float
    who: str
    what: str


def changes_of(tape: Tape, record: RunRecord) -> tuple[Change, ...]:
    """Return all changes on a tape, in order."""
    found = [*_of_machine(tape, record), *_of_monitor(tape, record), *_events(record)]
    return tuple(sorted(found, key=lambda change: change.time_s))


def _of_machine(tape: Tape, record: RunRecord) -> list[Change]:
    states: list[MachineState] = sorted(tape.of(MachineState), key=lambda state: state.sample)
    rate, found = record.sample_rate_hz, list[Change]()
    told = any(event.kind == GUARD_EVENT for event in record.events)
    for before, state in zip(states[:1] + states, states, strict=False):
        time_s = state.sample / rate - record.origin_s
        first = state is states[0]
        if first or (before.guard_state != state.guard_state and not told):
            why = f" ({state.reason})" if state.reason else ""
            found.append(Change(time_s, "guard", _turn(first, before.guard_state, state.guard_state) + why))
        if before.in_cut != state.in_cut or (first and state.in_cut):
            found.append(Change(time_s, "machine", "tools in the cut" if state.in_cut else "tools out of the cut"))
        if before.feed_hold != state.feed_hold or (first and state.feed_hold):
            found.append(Change(time_s, "machine", "feed hold" if state.feed_hold else "feed goes on"))
        if before.spindle_speed_rpm != state.spindle_speed_rpm:
            found.append(Change(time_s, "machine", f"spindle at {state.spindle_speed_rpm:.0f} min⁻¹"))
    return found


def _of_monitor(tape: Tape, record: RunRecord) -> list[Change]:
    reports: list[ChatterReport] = sorted(tape.of(ChatterReport), key=lambda report: report.first_sample)
    rate, found = record.sample_rate_hz, list[Change]()
    for before, report in zip(reports[:1] + reports, reports, strict=False):
        time_s = report.first_sample / rate - record.origin_s + BLOCK_S
        first = report is reports[0]
        if first or before.state != report.state:
            at = "" if report.frequency_hz is None else f" at {report.frequency_hz:.1f} Hz"
            kind = f", {report.kind}" if report.kind else ""
            level = f" ({report.indicator:.3g} of {report.limit:.3g} N)" if report.limit > 0.0 else ""
            found.append(Change(time_s, "monitor", _turn(first, before.state, report.state) + at + kind + level))
        if first or before.limit_source != report.limit_source:
            found.append(Change(time_s, "limit", f"{limit_source(report.limit_source)}: {report.limit:.3g} N"))
        if report.gap_samples:
            found.append(Change(time_s, "monitor", f"a gap of {report.gap_samples} samples"))
    return found


def _turn(first: bool, before: str, after: str) -> str:
    return after if first else f"{before} → {after}"


def _events(record: RunRecord) -> list[Change]:
    rate = record.sample_rate_hz
    said = [e for e in record.events if e.kind != MONITOR_EVENT]
    return [Change(e.sample / rate, e.source, f"{e.kind.replace('_', ' ')}: {e.text}") for e in said]
