"""The machine side's last check of every command: the single way to the drives.

Pure: no clock, no file, no bus; time is the index of a servo sample. It knows neither estimator nor planner and
trusts no one: not who commands, not the path, not the machine's own measurement. Angles are in rad and lengths in m.

Per block the machine node does::

    guard.request(op); guard.command(cmd, now)       # whatever came; now = first sample of the block to come
    plan = guard.begin_block(now, n, conditions)
    if plan.target is None:                          # the guard stops or stands by itself:
        path = path at rest at guard.shift
    else:
        path.retarget(plan.target)                   # at most at plan.speed, if that is given
    checked = guard.check(shift, x1, y1)             # from the path in either case, (n,) each; goes to the drives
    guard.notices()                                  # what happened, for `event`

It begins to follow a path only after a whole block at rest. Then it takes out whatever (small) distance is left between
where its own stop ended and the arc, over a second. `plan.speed` is given only when returning, which begins at rest.

States. OFF: holds, takes no command. ARMED: dry run, commands are judged and counted, nothing moves. ACTIVE: follows.
HOLDING: no valid command for T1. RETURNING: none for T2, the job says so and the cutting permits. FAULT: latched.
Boots OFF. `dry_run` leads to ARMED, `arm` through ARMED to ACTIVE with a new session, both judged with the conditions
of the next block; `disarm` and `stop` to OFF, decelerating at once; `reset` from FAULT at rest to OFF. A valid command
leads from HOLDING and RETURNING back to ACTIVE; the target stays until a command says otherwise.

A command that fails a check of form, origin, time or limits is *rejected* and does not count as a sign of life. One
that only cannot be done now (frozen, dwell, moves, travel) is rejected too, but keeps the guard from HOLDING.

This is a process-control function, not a safety function: emergency stop, covers and drive limits stay in the machine.
"""

import math
from collections import Counter, deque
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from services.guard_commands import MOST_SAMPLES, Doorkeeper
from services.guard_conditions import Conditions, Spindle
from services.guard_limits import GuardLimits
from services.guard_motion import Envelope, Floats, Way, arc
from services.messages import GuardState, OperatorRequest, TurretCommand

LIVE: tuple[GuardState, ...] = ("ACTIVE", "HOLDING", "RETURNING")
RETURN_SHARE = 0.99
"""Share of the return speed that is asked of the path, so that rounding is no fault."""
MOST_NOTICES = 1000
SAME = 1e-12
"""Targets nearer than this are the same (rad): more than a conversion to degrees and back costs."""


class Verdict(NamedTuple):
    """What became of a command; `reason` is empty when it was accepted."""

    accepted: bool
    reason: str
    late: bool


class Plan(NamedTuple):
    """Where the path shall go (rad) and how fast at most (rad/s); without a target the guard stands by itself."""

    target: float | None
    speed: float | None


class Checked(NamedTuple):
    """Set points for the drives, (n,) each: shift (rad), x1, y1 (m); `followed` if they are those of the path."""

    shift: Floats
    x1: Floats
    y1: Floats
    followed: bool


class Notice(NamedTuple):
    """A change worth an event."""

    sample: int
    kind: str
    text: str


class Guard:
    """Judges requests and commands, keeps the loss ladder, and lets only checked set points through.

    Parameters
    ----------
    limits : GuardLimits
        All limits; print `limits.describe()` at start.
    run : str
        Identifier of the run.
    controller, operator : str
        The only sources of commands and of requests.
    token : callable
        Makes a new session token.
    start : sequence of float
        Where the machine stands: shift (rad), x1, y1 (m).
    """

    def __init__(
        self,
        limits: GuardLimits,
        *,
        run: str,
        controller: str,
        operator: str,
        token: Callable[[], str],
        start: Sequence[float] = (0.0, 0.0, 0.0),
    ) -> None:
        self.limits = limits
        self._door, self._token = Doorkeeper(limits, run, controller, operator), token
        self._envelope, self._spindle = Envelope(limits, start), Spindle(limits)
        self._returns = limits.on_loss == "return"
        s = limits.samples
        self._t1, self._t2, self._t3 = s(limits.loss_hold), s(limits.loss_return), s(limits.loss_fault)
        self.state: GuardState = "OFF"
        self.reason = ""
        self.accepted = self.late = 0
        self.rejected: Counter[str] = Counter()
        self.feed_hold_requested = False
        self._notices: deque[Notice] = deque()
        self._unlisted = 0
        self._wish = ""
        self._now = self._alive = 0
        self._next: int | None = None
        self._samples = 0
        self._radius = 0.0
        self._frozen = ""
        self._way = self.shift, self.shift
        self._begin_session("")

    @property
    def shift(self) -> float:
        """Last issued shift (rad)."""
        return float(self._envelope.position[0])

    @property
    def position(self) -> Floats:
        """Last issued shift (rad), x1 and y1 (m)."""
        return self._envelope.position

    @property
    def target(self) -> float:
        """Target in force (rad); in dry run the one that would be."""
        return self._target

    @property
    def session(self) -> str:
        """Token of the session, empty unless there is one."""
        return self._door.session

    @property
    def requested(self) -> float:
        """Target of the last accepted command (rad), in force or still to come."""
        return self._wanted

    @property
    def moving(self) -> bool:
        """Whether it would take a stop to come to rest."""
        return self._envelope.moving

    @property
    def feed_inhibit_requested(self) -> bool:
        """Whether the feed must not run: in FAULT, until the operator resets it."""
        return self.state == "FAULT"

    @property
    def commands_rejected(self) -> int:
        """Rejected commands so far, all reasons together."""
        return self.rejected.total()

    def stand(self, position: Sequence[float]) -> None:
        """Take it that the machine was moved while the guard was OFF, and stands at shift (rad), x1, y1 (m)."""
        if self.state != "OFF" or self.moving:
            raise RuntimeError(f"stand must be said while OFF and at rest, not in {self.state}")
        self._envelope = Envelope(self.limits, position)
        self._halt()

    def notices(self) -> list[Notice]:
        """Hand out and forget what happened since the last call; a flood is cut short, but counted."""
        listed = list(self._notices)
        if self._unlisted:
            listed.append(Notice(self._now, "flood", f"{self._unlisted} more not listed"))
        self._notices.clear()
        self._unlisted = 0
        return listed

    def request(self, op: OperatorRequest) -> str:
        """Take a request of the operator; returns why not, empty if taken.

        `stop` is refused only as a repetition: it works whatever run, source and version it carries.
        """
        why = self._door.unheard(op) or self._do(op.request)
        if why:
            self._note("request_rejected", f"{op.request!r:.20}: {why}")
        return why

    def command(self, cmd: TurretCommand, now: int) -> Verdict:
        """Judge a command that arrived before sample `now`; what it says applies at a later `begin_block`."""
        self._now = now
        why = "state" if self.state in ("OFF", "FAULT") else self._door.untrue(cmd, now)
        shift = math.radians(cmd.shift_deg) if not why and abs(cmd.shift_deg) < 360.0 else math.inf
        why = why or self._beyond(shift)
        if not why:
            self._alive = now
            self._door.heard(cmd)
            if self.state in ("HOLDING", "RETURNING"):
                self._go("ACTIVE", "valid commands again")
            why = self._accept(shift, cmd.apply_at_sample, now)
        if why:
            self.rejected[why] += 1
            self._note(
                "command_rejected", f"command {min(max(cmd.sequence, -1), MOST_SAMPLES)} of {cmd.source!r:.40}: {why}"
            )
            return Verdict(False, why, False)
        self.accepted += 1
        late = cmd.apply_at_sample < now
        if late:
            self.late += 1
            self._note("command_late", f"command {cmd.sequence} by {now - cmd.apply_at_sample} samples")
        return Verdict(True, "", late)

    def begin_block(self, first_sample: int, samples: int, conditions: Conditions) -> Plan:
        """Judge the machine, keep the loss ladder, apply what is due; says where the path shall go in this block."""
        if samples < 1:
            raise ValueError(f"samples must be at least 1, got {samples}")
        gap = self._next is not None and self._next != first_sample
        self._now, self._next, self._samples = first_sample, first_sample + samples, samples
        self._radius = conditions.radius
        unfit = "samples are not contiguous" if gap else conditions.unfit or self._envelope.lags(conditions.measured)
        if unfit and self.state not in ("OFF", "FAULT"):
            self._go("FAULT", unfit)
        interlock = conditions.interlock(self.limits)
        unsettled = self._spindle.unsettled(conditions.spindle_hz, samples)
        self._grant(unfit or interlock or unsettled, unfit)
        out = "out of cut" if self.limits.freeze_out_of_cut and not conditions.in_cut else ""
        self._freeze(interlock or unsettled or out)
        self._climb(conditions, interlock)
        self._plan = self._make_plan()
        return self._plan

    def check(self, shift: object, x1: object, y1: object) -> Checked:
        """Let a block of the path through if it and a stop after it keep every limit; else stop and latch FAULT."""
        samples, self._samples = self._samples, 0
        if not samples:
            raise RuntimeError("check must follow begin_block, once")
        request = (shift, x1, y1)
        if self._plan.target is not None:
            speed = self.limits.return_speed if self.state == "RETURNING" else math.inf
            why = self._envelope.follow(request, samples, Way(*self._way, self._radius, speed))
            if not why:
                return Checked(*self._envelope.issued(samples), followed=True)
            self._go("FAULT", why)
        self._envelope.hold(request, samples)
        return Checked(*self._envelope.issued(samples), followed=False)

    def _do(self, request: str) -> str:
        """Carry out a request; why not, empty if done."""
        if request in ("stop", "disarm"):
            self._wish = ""
            if self.state not in ("OFF", "FAULT"):
                self._go("OFF", f"operator: {request}")
            return ""
        if request == "reset":
            if self.state != "FAULT" or self.moving:
                return "not in FAULT" if self.state != "FAULT" else "still stopping"
            self._go("OFF", "operator: reset")
            return ""
        if request not in ("arm", "dry_run"):
            return "unknown request"
        allowed: tuple[GuardState, ...] = ("OFF", "ARMED") if request == "arm" else ("OFF", *LIVE)
        if self.state not in allowed:
            return f"not in {self.state}"
        self._wish = request
        return ""

    def _grant(self, unready: str, unfit: str) -> None:
        """Carry out `arm` or `dry_run` with the conditions of this block."""
        wish, self._wish = self._wish, ""
        if not wish:
            return
        why = unready if wish == "arm" else unfit
        if wish == "arm" and self.moving:
            why = "still moving"
        if why or self.state == "FAULT":
            self._note("request_rejected", f"'{wish}': {why or 'not in FAULT'}")
            return
        if self.state != "ARMED":
            self._go("ARMED", f"operator: {wish}")
        if wish == "arm":
            self._go("ACTIVE", "operator: arm")

    def _beyond(self, shift: float) -> str:
        """Why a target cannot be meant, empty if it can."""
        change = abs(shift - self._wanted)
        if change <= SAME:
            return ""
        if abs(shift) > self.limits.target or change > self.limits.target_step:
            return "limit"
        return "limit" if self._envelope.beyond(self._place(shift)) else ""

    def _accept(self, shift: float, due: int, now: int) -> str:
        """Take over the target of a valid command; why it cannot be done now, empty if done or unchanged."""
        if abs(shift - self._wanted) <= SAME:
            return ""
        why = "frozen" if self._frozen else self._door.hurried(now)
        if why:
            return why
        rest, place = self._envelope.rest[:, None], self._place(shift)
        ahead = np.abs(rest - self._envelope.position[:, None]) + np.abs(place - rest) + np.abs(place)
        if not self._envelope.affords(ahead):
            return "travel"
        self._door.moved(now)
        self._wanted = shift
        self._pending.append((due, shift))
        return ""

    def _place(self, shift: float) -> Floats:
        """Shift and slides of a target at the present diameter, shape (3, 1)."""
        return arc(shift, self._radius, self.limits.axis_angle)[:, None]

    def _note(self, kind: str, text: str) -> None:
        """Keep a notice and make it the last reason; beyond `MOST_NOTICES` only count it."""
        self.reason = text
        if len(self._notices) < MOST_NOTICES:
            self._notices.append(Notice(self._now, kind, text))
        else:
            self._unlisted += 1

    def _go(self, state: GuardState, why: str) -> None:
        """Change the state; the session lives from ARMED -> ACTIVE to OFF, ARMED or FAULT."""
        before, self.state = self.state, state
        self._note("guard_state", f"{before} -> {state}: {why}")
        if state not in LIVE:
            self._begin_session("")
        elif before == "ARMED":
            self._begin_session(self._token())
        elif state == "HOLDING":
            self._halt()

    def _begin_session(self, token: str) -> None:
        """Forget all commands; what was travelled, and what comes next, counts from here."""
        self._door.begin_session(token)
        self._alive = self._now
        self._envelope.travel *= 0.0
        self._halt()

    def _halt(self) -> None:
        """Drop the target: decelerate at once and stay."""
        self._plan = Plan(None, None)
        self._pending: deque[tuple[int, float]] = deque()
        self._target = self._wanted = float(self._envelope.rest[0])

    def _freeze(self, why: str) -> None:
        """Stay where the shift is while something forbids to move; it stays there afterwards until commanded."""
        if why and not self._frozen:
            self._note("frozen", why)
        self._frozen = why
        if why and self.state == "ACTIVE":
            self._halt()

    def _climb(self, conditions: Conditions, interlock: str) -> None:
        """Loss ladder: without a valid command for T1 hold, for T2 return if the job says so, for T3 give up."""
        age = self._now - self._alive
        if self.state in LIVE and age >= self._t3:
            self._go("FAULT", f"no valid command for {self.limits.loss_fault} s")
        elif self.state == "RETURNING" and interlock:
            self._go("HOLDING", interlock)
        elif self.state == "HOLDING" and age >= self._t2 and self._returns and not interlock:
            self._go("RETURNING", f"no valid command for {self.limits.loss_return} s")
            self._target = self._wanted = 0.0
        elif self.state == "ACTIVE" and age >= self._t1:
            self._go("HOLDING", f"no valid command for {self.limits.loss_hold} s")
        late = age >= self._t2 or not self._returns
        self.feed_hold_requested = self.state == "HOLDING" and conditions.in_cut and late

    def _make_plan(self) -> Plan:
        """Let what is due apply; widen the way to it, or narrow it to here when there is none or it is done."""
        while self._pending and self._pending[0][0] <= self._now:
            self._target = self._pending.popleft()[1]
        here = float(self._envelope.position[0])
        if not self._envelope.moving:
            self._way = here, here
        returning = self.state == "RETURNING"
        if not returning and (self.state != "ACTIVE" or self._frozen) or not self._envelope.settled:
            return Plan(None, None)
        self._way = min(self._way[0], self._target), max(self._way[1], self._target)
        return Plan(self._target, RETURN_SHARE * self.limits.return_speed if returning else None)
