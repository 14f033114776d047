"""The controller: one absolute target of the shift for each verdict."""

from __future__ import annotations

import math

from pitch import Decision, Planner, Situation, advise
from services.config import Case
from services.messages import BLOCK_S, ChatterReport, Event, Message, TurretCommand

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
    """

    subscribes = (ChatterReport,)

    def __init__(self, case: Case, run: str) -> None:
        self._run = run
        self._planner = Planner(case.planner, belief=case.foresight)
        block = round(BLOCK_S * case.settings.sample_rate_hz)
        self._apply, self._expire = case.settings.apply_after_blocks * block, case.settings.expires_after_blocks * block
        self._events = 0

    def prepare(self) -> None:
        """Compile what the planner needs."""
        self._planner.prepare()

    def handle(self, message: ChatterReport) -> list[Message]:
        """Return the command that follows from the report, and an event when it is more than a hold."""
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
            armed=report.guard_state not in ("OFF", "FAULT"),
            loudness=report.indicator / report.limit if report.limit > 0.0 else None,
        )

    def _event(self, report: ChatterReport, decision: Decision) -> list[Message]:
        if decision.action == "hold":
            return []
        said = [self._said(report, decision.action, decision.reason)]
        if decision.feed_hold:
            said.append(self._said(report, "feed_hold_request", advise(decision)))
        return said

    def _said(self, report: ChatterReport, kind: str, text: str) -> Message:
        self._events += 1
        return Event(
            run=self._run,
            source=SOURCE,
            sequence=self._events,
            cause=report.sequence,
            sample=report.first_sample + report.samples,
            kind=kind,
            text=text,
        )
