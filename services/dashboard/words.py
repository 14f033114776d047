"""One big word for what a machine does, how it is meant, and why."""

from __future__ import annotations

from typing import NamedTuple

from services.messages import ChatterReport, MachineState

STALE_S = 0.5
NAMES = {"quiet": "STABLE", "idle": "IN AIR", "learning": "LEARNING", "suspect": "SUSPECT", "chatter": "CHATTER"}
GOOD, CALM, WARN, ALARM, STALE = "good", "calm", "warn", "alarm", "stale"
TONES = {"quiet": GOOD, "idle": CALM, "learning": CALM, "suspect": WARN, "chatter": ALARM}


class Word(NamedTuple):
    """The word, its tone (`good`, `calm`, `warn`, `alarm`, `stale`) and a sentence."""

    word: str
    tone: str
    detail: str


def describe(
    machine: MachineState | None,
    report: ChatterReport | None,
    machine_age_s: float | None,
    report_age_s: float | None,
) -> Word:
    """Return the word for the last state and report and their ages (s); the graver of two comes first."""
    if machine is None and report is None:
        return Word("NO DATA", STALE, "nothing heard of this machine yet")
    if machine is None or machine_age_s is None:
        return Word("NO MACHINE", STALE, "the monitor reports, but the machine says nothing of its state")
    if machine_age_s > STALE_S:
        return Word("STALE", STALE, f"no state of the machine for {machine_age_s:.1f} s")
    if machine.guard_state == "FAULT":
        return Word("FAULT", ALARM, f"{machine.reason:.160}; latched until reset")
    if report is None or report_age_s is None:
        return Word("NO MONITOR", STALE, "the machine runs, but nobody watches for chatter")
    if report_age_s > STALE_S:
        return Word("STALE", STALE, f"no verdict of the monitor for {report_age_s:.1f} s")
    return _word_of(machine, report)


def _word_of(machine: MachineState, report: ChatterReport) -> Word:
    if report.state != "chatter":
        if report.state == "invalid":
            return Word("BAD SIGNAL", ALARM, "the servo signals cannot be right")
        if report.state == "gap":
            return Word("GAP", WARN, f"{report.gap_samples} samples were lost; the windows fill again")
        if machine.guard_state in ("HOLDING", "RETURNING"):
            return Word(machine.guard_state, WARN, f"{machine.reason:.160}")
        if report.moving and report.state != "suspect":
            return Word("MOVING", WARN, f"turret 1 goes to {machine.shift_target_deg:.2f}°")
    name = NAMES.get(report.state, report.state.upper()[:14] or "UNKNOWN")
    return Word(name, TONES.get(report.state, WARN), _detail(machine, report))


def _detail(machine: MachineState, report: ChatterReport) -> str:
    parts: list[str] = []
    if report.frequency_hz is not None:
        parts.append(f"{(report.kind or 'unknown kind')[:20]} at {report.frequency_hz:.1f} Hz")
    elif report.state == "quiet":
        parts.append("no line above its limit")
    elif report.state == "idle":
        parts.append("tools are not in the cut")
    if report.moving:
        parts.append(f"turret 1 goes to {machine.shift_target_deg:.2f}°")
    if machine.feed_hold:
        parts.append("feed hold requested")
    parts += [note.replace("_", " ")[:40] for note in report.notes[:4]]
    return ", ".join(parts)
