"""What must hold on every day, worked out from what left the guard and was told to it, not from its own words.

Nothing here uses the code of the guard: limits are numbers, motion is finite differences, time is samples.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from services.guard_conditions import Conditions
from services.guard_limits import GuardLimits
from services.messages import Event, Floats

LIVE = ("ACTIVE", "HOLDING", "RETURNING")
REST_S = 2.0
"""No stop takes longer."""


@dataclass(slots=True)
class Ladder:
    """Keeps the time since the last valid command beside the guard's state.

    Attributes
    ----------
    limits
        T1, T2, T3 and what the job wants.
    longest
        Longest time without a valid command in which the guard stayed ACTIVE, or until it answered (samples).
    broken
        What should not have been.
    """

    limits: GuardLimits
    longest: int = 0
    broken: list[str] = field(default_factory=list[str])
    _alive: int = 0
    _state: str = "OFF"

    def valid(self, now: int) -> None:
        """Note that the guard heard a command that counts as a sign of life, before sample `now`."""
        self._alive = now

    def block(self, first: int, state: str, told: Conditions) -> None:
        """Judge the state in a block.

        Parameters
        ----------
        first
            First sample of the block.
        state
            Of the guard after it judged the machine.
        told
            What it was told of the machine.
        """
        before, self._state = self._state, state
        if state in LIVE and before not in LIVE:
            self._alive = first
        age = first - self._alive
        if before == "ACTIVE" and state in ("ACTIVE", "HOLDING", "FAULT"):
            self.longest = max(self.longest, age)
        hold, back, fault = (
            self.limits.samples(t) for t in (self.limits.loss_hold, self.limits.loss_return, self.limits.loss_fault)
        )
        if state == "ACTIVE" and age >= hold:
            self._say(first, f"ACTIVE {age} samples after the last valid command")
        if state in LIVE and age >= fault:
            self._say(first, f"{state} {age} samples after the last valid command")
        calm = not forbidden(told, self.limits)
        if state == "HOLDING" and age >= back and self.limits.on_loss == "return" and calm:
            self._say(first, "HOLDING although the job wants a return")
        if state == "RETURNING" and (self.limits.on_loss == "hold" or not calm):
            self._say(first, "RETURNING against the job or the machine")
        if state in LIVE and not told.homed:
            self._say(first, f"{state} although not homed")

    def _say(self, first: int, text: str) -> None:
        if len(self.broken) < 5:
            self.broken.append(f"{first / self.limits.sample_rate_hz:.2f} s: {text}")


def forbidden(told: Conditions, limits: GuardLimits) -> bool:
    """Whether nothing may move under some conditions."""
    fits = limits.spindle_hz_min <= told.spindle_hz <= limits.spindle_hz_max
    return told.feed_hold or bool(told.blocked) or not fits


def excursions(points: Floats, limits: GuardLimits) -> dict[str, float]:
    """Return the largest value of everything that is limited, over its limit; not finite counts as infinite.

    Parameters
    ----------
    points : ndarray, shape (3, n)
        Set points: shift (rad), x1, y1 (m).
    limits
        Of the guard.
    """
    if not np.isfinite(points).all():
        return {"set points that are numbers": math.inf}
    rate, psi = limits.sample_rate_hz, limits.axis_angle
    offsets = points[1] + points[2] * math.cos(psi), points[2] * math.sin(psi)
    found = {
        name: float(np.abs(values).max()) / getattr(limits, name)
        for name, values in zip(("shift", "x1", "y1", "dx", "dy"), (*points, *offsets), strict=True)
    }
    for axis, row in zip(("shift", "slide", "slide"), points, strict=True):
        for order, name in enumerate(("speed", "acceleration", "jerk"), start=1):
            most = float(np.abs(np.diff(row, n=order)).max(initial=0.0)) * rate**order
            key = f"{axis}_{name}"
            found[key] = max(found.get(key, 0.0), most / getattr(limits, key))
        lag = limits.samples(limits.interval)
        step = float(np.abs(row[lag:] - row[:-lag]).max(initial=0.0))
        found[f"{axis}_step"] = max(found.get(f"{axis}_step", 0.0), step / getattr(limits, f"{axis}_step"))
    return found


def strayed(issued: Floats, stood: Floats, limits: GuardLimits) -> float:
    """Return the largest distance of the stage from its set points over the stated following error, shape (3, n)."""
    allowed = np.array([[limits.shift_following], [limits.slide_following], [limits.slide_following]])
    return float((np.abs(stood - issued) / allowed).max(initial=0.0))


def restless(points: Floats, states: list[str], samples: int, limits: GuardLimits) -> str:
    """Say where set points still move long after the guard left the states that move.

    Parameters
    ----------
    points : ndarray, shape (3, n)
        Set points.
    states
        Of each block.
    samples
        In a block.
    limits
        For the rate.
    """
    blocks = math.ceil(REST_S * limits.sample_rate_hz / samples)
    still = 0
    for number, state in enumerate(states):
        still = still + 1 if state in ("OFF", "ARMED", "HOLDING", "FAULT") else 0
        piece = points[:, number * samples : (number + 1) * samples]
        if still > blocks and np.ptp(piece, axis=1).any():
            return f"set points still move in {state}, {still} blocks after it began"
    return ""


def unlogged(states: list[str], events: list[Event]) -> str:
    """Say which change of state has no event of its own, empty if each has.

    Parameters
    ----------
    states
        Of each block.
    events
        Of the machine, in order.
    """
    told = [event.text.split(":")[0].split(" -> ") for event in events if event.kind == "guard_state"]
    now = "OFF"
    for change in told:
        if change[0] != now:
            return f"the log says {' -> '.join(change)} when it was {now}"
        now = change[1]
    reached = {change[1] for change in told} | {"OFF"}
    missing = set(states) - reached
    if missing or (states and states[-1] != now):
        return f"states {sorted(missing) or [states[-1]]} are not in the log"
    return ""
