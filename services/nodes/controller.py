"""The controller: one absolute target of the shift for each verdict.

With `advise_only` it decides in the same way and says what it would command (`Event` of kind `advice`); no command
leaves it. That is another thing than the dry run of the guard (ARMED): there commands are sent, judged and counted by
the guard, and nothing moves; here there is nothing to judge, and the guard may stay OFF. Each advice is the first move
from where turret 1 stands, since none that came before was carried out.
"""

from __future__ import annotations

import math
from dataclasses import replace

from pitch import Decision, Planner, Situation, advise
from services.config import Case
from services.messages import ADVICE, ADVICE_OVER, BLOCK_S, MODE, ChatterReport, Event, Message, TurretCommand

SOURCE = "controller"


class ControllerNode:
    """Hands each report to the planner and words its decision as a command.

    Without a guard that listens (OFF or FAULT) there is no session to command in, and nothing is sent.

    Parameters
    ----------
    case
        The case; only its planner, its belief about the process and its timing of commands are read.
    run
        Identifier of the run.
    advise_only
        Whether it only says what it would command; so it is too when the case says so.
    """

    subscribes = (ChatterReport,)

    def __init__(self, case: Case, run: str, advise_only: bool = False) -> None:
        self._run = run
        self._planner = Planner(case.planner, belief=case.foresight)
        block = round(BLOCK_S * case.settings.sample_rate_hz)
        self._apply, self._expire = case.settings.apply_after_blocks * block, case.settings.expires_after_blocks * block
        self._events = 0
        self._advises = advise_only or (case.job is not None and bool(case.job.advise_only))
        self._advised: tuple[Decision, float | None] | None = None
        self._quiet_from: int | None = None
        self._over = round(case.planner.settle_time * case.settings.sample_rate_hz)
        self._same = math.degrees(case.planner.arrival_tolerance)

    def prepare(self) -> None:
        """Compile what the planner needs."""
        self._planner.prepare()

    def handle(self, message: ChatterReport) -> list[Message]:
        """Return the command that follows from the report, and an event when it is more than a hold."""
        if self._advises:
            return self._advise(message)
        decision = self._planner.decide(self._situation(message))
        out = self._event(message, decision)
        if message.guard_state in ("OFF", "FAULT"):
            return out
        command = TurretCommand(
            run=self._run,
            source=SOURCE,
            sequence=message.sequence,
            cause=message.sequence,
            session=message.session,
            shift_deg=math.degrees(decision.target_shift),
            order=decision.order,
            action=decision.action,
            issued_sample=message.first_sample + message.samples,
            apply_at_sample=message.first_sample + self._apply,
            expires_at_sample=message.first_sample + self._expire,
            reason=decision.reason,
        )
        return [command, *out]

    def _situation(self, report: ChatterReport) -> Situation:
        return Situation(
            sample=report.first_sample + report.samples - 1,
            chatter=report.state == "chatter",
            frequency_hz=report.frequency_hz,
            kind=report.kind,
            spindle_hz=report.spindle_speed_rpm / 60.0,
            diameter=report.diameter_mm * 1e-3,
            shift=math.radians(report.shift_applied_deg),
            requested=math.radians(report.shift_requested_deg),
            in_cut=report.in_cut,
            valid=report.state not in ("gap", "invalid"),
            moving=report.moving,
            armed=self._advises or report.guard_state not in ("OFF", "FAULT"),
            loudness=report.indicator / report.limit if report.limit > 0.0 else None,
        )

    def _advise(self, report: ChatterReport) -> list[Message]:
        """Return what it would command, when that is new or no longer so; the planner is told that nothing was done."""
        out: list[Message] = []
        if not self._events:
            out.append(self._said(report, MODE, "advise only: decisions are said, none is commanded"))
        before, seen = self._planner.snapshot(), self._situation(report)
        decision = self._planner.decide(seen)
        if decision.action != "hold":
            self._planner.restore(replace(before, sample=seen.sample, moved_at=seen.sample))
            self._quiet_from = None
            shift = math.degrees(decision.target_shift) if decision.action == "move" else None
            if self._is_new(decision, shift):
                self._advised = decision, shift
                out.append(self._said(report, ADVICE, f"not commanded: {advise(decision)}", shift))
        elif report.state == "chatter" or self._advised is None:
            self._quiet_from = None
        elif self._quiet_from is None:
            self._quiet_from = seen.sample
        elif seen.sample - self._quiet_from >= self._over:
            self._advised = None
            out.append(self._said(report, ADVICE_OVER, "the chatter has gone; nothing was commanded"))
        return out

    def _is_new(self, decision: Decision, shift_deg: float | None) -> bool:
        """Whether an advice is another one than the last."""
        if self._advised is None:
            return True
        last, before = self._advised
        if shift_deg is None or before is None:
            return (decision.action, decision.cause) != (last.action, last.cause)
        return abs(shift_deg - before) > self._same

    def _event(self, report: ChatterReport, decision: Decision) -> list[Message]:
        if decision.action == "hold":
            return []
        said = [self._said(report, decision.action, decision.reason)]
        if decision.feed_hold:
            said.append(self._said(report, "feed_hold_request", advise(decision)))
        return said

    def _said(self, report: ChatterReport, kind: str, text: str, shift_deg: float | None = None) -> Message:
        self._events += 1
        return Event(
            run=self._run,
            source=SOURCE,
            sequence=self._events,
            cause=report.sequence,
            sample=report.first_sample + report.samples,
            kind=kind,
            text=text,
            shift_deg=shift_deg,
        )
