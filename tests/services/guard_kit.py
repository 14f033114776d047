"""A guard with limits like those of the lathe, a sound path generator of its own, and a machine that obeys."""

import dataclasses
import math

import numpy as np
import pytest

from services.guard import Conditions, Guard
from services.guard_limits import GuardLimits
from services.messages import OperatorRequest, TurretCommand

RATE, BLOCK, DIAMETER, PSI = 9000.0, 90, 0.025, math.pi / 4
LIMITS = GuardLimits(
    sample_rate_hz=RATE,
    axis_angle=PSI,
    shift=math.radians(6.0),
    dx=0.15e-3,
    dy=1.4e-3,
    x1=2.0e-3,
    y1=2.0e-3,
    shift_speed=1.0,
    slide_speed=20e-3,
    shift_acceleration=20.0,
    slide_acceleration=0.4,
    shift_jerk=2000.0,
    slide_jerk=40.0,
    interval=0.010,
    shift_step=9e-3,
    slide_step=0.18e-3,
    shift_travel=2.0,
    slide_travel=0.04,
    shift_following=2e-3,
    slide_following=50e-6,
    path_shift=1e-4,
    path_slide=2e-6,
    target=math.radians(5.0),
    target_step=math.radians(8.0),
    moves_per_minute=6,
    dwell=0.0,
    command_age=0.5,
    command_lead=0.1,
    return_speed=0.25,
    spindle_hz_min=5.0,
    spindle_hz_max=60.0,
    spindle_change=0.03,
    spindle_settle=0.1,
    loss_hold=0.3,
    loss_return=1.0,
    loss_fault=2.0,
    on_loss="hold",
    freeze_out_of_cut=False,
)


def limits(**changes):
    return dataclasses.replace(LIMITS, **changes)


def on_arc(shift, diameter=DIAMETER):
    """Slides of a shift, derived once more: the tool's offset projected on skewed axes."""
    shift = np.asarray(shift, dtype=float)
    dx, dy = diameter / 2 * (1 - np.cos(shift)), diameter / 2 * np.sin(shift)
    y1 = dy / math.sin(PSI)
    return np.array((shift, dx - y1 * math.cos(PSI), y1))


class SoundPath:
    """Goes from rest to rest: a rate limiter behind two moving averages, like any good path generator."""

    def __init__(self, shift=0.0, speed=0.5):
        self.rest(shift, speed)

    def rest(self, shift, speed=0.5):
        self.level = self.goal = shift
        self.step, self.first, self.second = speed / RATE, 900, 450
        self.levels = np.full(self.first + self.second - 2, shift)

    def advance(self, n):
        new = np.empty(n)
        for i in range(n):
            self.level += min(max(self.goal - self.level, -self.step), self.step)
            new[i] = self.level
        joined = np.concatenate((self.levels, new))
        self.levels = joined[-len(self.levels) :]
        if not np.ptp(joined):
            return new
        once = np.convolve(joined, np.full(self.first, 1 / self.first), "valid")
        return np.convolve(once, np.full(self.second, 1 / self.second), "valid")


class Rig:
    """Machine node, controller and operator in a few lines; keeps every set point that left the guard."""

    def __init__(self, start=(0.0, 0.0, 0.0), samples=BLOCK, **changes):
        self.limits = limits(**changes)
        self.tokens = iter(f"session-{i}" for i in range(10_000))
        self.guard = Guard(
            self.limits,
            run="run",
            controller="controller",
            operator="operator",
            token=self.tokens.__next__,
            start=start,
        )
        self.start, self.samples, self.now, self.sequence, self.nonce = np.array(start), samples, 0, 0, 0
        self.path, self.issued, self.notices, self.plans, self.followed = SoundPath(start[0]), [], [], [], []
        self.conditions = {}
        self.measure = lambda issued: issued
        self.mangle = lambda request: request

    def ask(self, request, **changes):
        self.nonce += 1
        fields = {"run": "run", "source": "operator", "sequence": self.nonce, "nonce": f"n{self.nonce}"} | changes
        return self.guard.request(OperatorRequest(request=request, **fields))

    def make(self, shift_deg, **changes):
        self.sequence += 1
        fields = {
            "run": "run",
            "source": "controller",
            "sequence": self.sequence,
            "session": self.guard.session,
            "shift_deg": shift_deg,
            "order": 3,
            "action": "hold",
            "issued_sample": self.now,
            "apply_at_sample": self.now,
            "expires_at_sample": self.now + 900,
            "reason": "",
        } | changes
        return TurretCommand(**fields)

    def say(self, shift_deg, **changes):
        return self.guard.command(self.make(shift_deg, **changes), self.now)

    def state_of_machine(self):
        last = self.issued[-1] if self.issued else self.start[:, None]
        fields = {"in_cut": True, "homed": True, "feed_hold": False, "spindle_hz": 20.0, "diameter": DIAMETER}
        return Conditions(**({"measured": self.measure(last)} | fields | self.conditions))

    def block(self, n=None):
        n = n or self.samples
        plan = self.guard.begin_block(self.now, n, self.state_of_machine())
        if plan.target is None:
            self.path.rest(self.guard.shift, 0.24 if self.guard.limits.on_loss == "return" else 0.5)
        else:
            self.path.goal = plan.target
        checked = self.guard.check(*self.mangle(on_arc(self.path.advance(n))))
        self.issued.append(np.array(checked[:3]))
        self.now += n
        self.plans.append(plan)
        self.followed.append(checked.followed)
        self.notices += self.guard.notices()
        return checked

    def run(self, blocks, shift_deg=None):
        for _ in range(blocks):
            if shift_deg is not None:
                self.say(shift_deg)
            self.block()
        return self

    def active(self):
        """Arm and run until the path is followed."""
        assert self.ask("arm") == ""
        return self.run(2, None)

    def points(self):
        return np.concatenate([np.repeat(self.start[:, None], 4, axis=1), *self.issued], axis=1)

    def assert_within(self):
        assert worst(self.points(), self.limits) <= 1.0


def worst(points, lim):
    """Largest share of any limit that a stream of set points uses, from its plain finite differences."""
    shift, x, y = points
    offsets = {"shift": shift, "x1": x, "y1": y, "dx": x + y * math.cos(PSI), "dy": y * math.sin(PSI)}
    shares = [np.abs(series).max() / getattr(lim, name) for name, series in offsets.items()]
    for order, name in enumerate(("speed", "acceleration", "jerk"), start=1):
        rates = np.abs(np.diff(points, n=order)).max(axis=1) * RATE**order
        shares += list(rates / [getattr(lim, f"{axis}_{name}") for axis in ("shift", "slide", "slide")])
    lag = round(lim.interval * RATE)
    if points.shape[1] > lag:
        steps = np.abs(points[:, lag:] - points[:, :-lag]).max(axis=1)
        shares += list(steps / (lim.shift_step, lim.slide_step, lim.slide_step))
    assert np.isfinite(shares).all()
    return max(shares)


SHIFT = math.radians(2.8)


def rig_in(state, **changes):
    """A machine at a shift of 2.8 degrees, at rest, in a state."""
    changes = {"on_loss": "return"} | changes if state == "RETURNING" else changes
    rig = Rig(**changes)
    if state == "OFF":
        return rig.run(2)
    if state == "ARMED":
        assert rig.ask("dry_run") == ""
        return rig.run(2)
    rig.active().run(80, 2.8)
    assert rig.guard.shift == pytest.approx(SHIFT, abs=1e-12)
    if state == "HOLDING":
        rig.run(40)
    if state == "RETURNING":
        rig.run(115)
    if state == "FAULT":
        rig.conditions = {"homed": False}
        rig.run(1)
        rig.conditions = {}
    assert rig.guard.state == state
    return rig
