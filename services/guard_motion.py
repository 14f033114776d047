"""The envelope of motion: nothing leaves it that was not checked, and it can stop from wherever it is.

A set point is a column (shift, x1, y1). Its speed, acceleration and jerk are the finite differences
`np.diff(points, n=k) * sample_rate_hz**k` over everything that was issued, across blocks.

Why no set point is ever beyond a limit, also while it stops: a block is issued only if (1) each of its points and
differences keeps every limit, and (2) a stop that begins after its last point was computed and kept every limit in
the same check. That stop is stored. If the next block fails, the stored stop is issued instead, so all that leaves
has passed the one check; by induction from rest, where the stop is to stay. Nothing hinges on margins: they only decide
how seldom the stop has to be used. With path limits at half of the guard's, a sound path never needs it.

The stop brings the speed to zero as a cubic over a duration T, from the speed v and acceleration a it has:
v(u) = v (1 - 3 u^2 + 2 u^3) + a T (u - 2 u^2 + u^3), u = t/T. It is linear in v and a, hence the same for all axes and
any combination of them, and its jerk is largest at the ends: 6 |v| / T^2 + 4 |a| / T. The shortest T that
passes is taken.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from services.guard_limits import MARGIN, GuardLimits

Floats = NDArray[np.float64]
AXES = ("shift", "x1", "y1", "dx", "dy")
ORDERS = ("speed", "acceleration", "jerk")
RESUME_S = 1.0
"""Time over which the distance between where a stop ended and where the path restarts is taken out (s)."""

LONGEST_STOP_S = 2.0
"""Duration of the slowest stop that is considered (s)."""


class Way(NamedTuple):
    """Where the set points of a block may lie: shift from `low` to `high` (rad), on the arc of `radius` (m)."""

    low: float
    high: float
    radius: float
    speed: float = math.inf


def arc(shift: float | Floats, radius: float, axis_angle: float) -> Floats:
    """Shift and slides of a tool that stays on its arc: dx = r (1 - cos h), dy' = r sin h; shape (3, ...)."""
    dy = radius * np.sin(shift)
    dx = radius * (1.0 - np.cos(shift))
    return np.array((shift, dx - dy / math.tan(axis_angle), dy / math.sin(axis_angle)))


class Envelope:
    """Owns what was issued, checks what is to be issued next, and keeps a checked stop ready.

    Parameters
    ----------
    limits : GuardLimits
        What the set points may do.
    start : sequence of float
        Where the machine stands: shift (rad), x1, y1 (m).
    """

    def __init__(self, limits: GuardLimits, start: Sequence[float]) -> None:
        self._limits = limits
        self._cos, self._sin = math.cos(limits.axis_angle), math.sin(limits.axis_angle)
        rate, inside = limits.sample_rate_hz, 1.0 - MARGIN
        self._inside = inside * np.array([[getattr(limits, axis)] for axis in AXES])
        self._rates = [inside * np.array([limits.each(name)]).T / rate**k for k, name in enumerate(ORDERS, start=1)]
        self._lag = limits.samples(limits.interval)
        self._step, self._most = (inside * np.array([limits.each(name)]).T for name in ("step", "travel"))
        self._near = np.array(limits.each("path"))
        self._following = np.array([limits.each("following")]).T
        ease = np.arange(1, limits.samples(RESUME_S) + 1) / limits.samples(RESUME_S)
        self._ease = 1.0 - ease**3 * (10.0 - 15.0 * ease + 6.0 * ease**2)
        self._stops = self._shapes()
        self._lengths = np.array([[len(shape[0]) - 3.0 for shape in self._stops]])
        position = np.array(start, dtype=np.float64).reshape(3)
        why = self.beyond(position[:, None])
        if why:
            raise ValueError(f"start must be within the limits, got {why}")
        self._history = np.repeat(position[:, None], max(self._lag, 3), axis=1)
        self._still = self._history.shape[1]
        self._stop = self._history[:, :0]
        self._reference = self._nowhere = np.full((3, 1), np.nan)
        self._bias, self._eased, self._held = np.zeros((3, 1)), 0, True
        self.settled = False
        self.travel = np.zeros((3, 1))

    @property
    def position(self) -> Floats:
        """Last issued set point: shift (rad), x1, y1 (m)."""
        return self._history[:, -1].copy()

    @property
    def rest(self) -> Floats:
        """Where the stored stop ends: shift (rad), x1, y1 (m)."""
        return self._stop[:, -1].copy() if self.moving else self.position

    @property
    def moving(self) -> bool:
        """Whether it would take a stop to come to rest."""
        return self._stop.shape[1] > 0

    def beyond(self, points: Floats) -> str:
        """Which limit of position some points (3, n) pass, empty if none; anything not finite is beyond."""
        ok = np.abs(points) <= self._inside[:3]
        if not ok.all():
            return _worst(AXES[:3], "position", points, ok)
        x, y = points[1], points[2]
        offsets = np.stack((x + y * self._cos, y * self._sin))
        ok = np.abs(offsets) <= self._inside[3:]
        return "" if ok.all() else _worst(AXES[3:], "position", offsets, ok)

    def follow(self, request: Sequence[object], samples: int, way: Way) -> str:
        """Issue a block of the path, or say why not; then nothing has changed."""
        points = _parse(request, samples)
        if points is None:
            return "path is not three series of numbers of the block's length"
        if self._stands(points):
            return ""
        bias, eased = self._joint()
        if why := self.beyond(points) or self._astray(points, way) or self._apart(bias):
            return why
        ease = self._ease[eased : eased + samples]
        points[:, : len(ease)] += bias * ease
        if why := self._violation(self._history, points, self.travel):
            return why
        fastest = float(np.abs(np.diff(points[0], prepend=self._history[0, -1])).max()) * self._limits.sample_rate_hz
        if fastest > way.speed:
            return f"path is faster than asked: shift {fastest:.6g}"
        stop = self._way_to_stop(points)
        if stop is None:
            return "no room to stop after this block"
        self._issue(points)
        self._stop = stop
        self._bias, self._eased, self._held = bias, eased + len(ease) if bias.any() else len(self._ease), False
        return ""

    def hold(self, request: Sequence[object], samples: int) -> None:
        """Issue the stored stop or stay, and note where the path rests meanwhile, so that it can be rejoined."""
        self.settled = not self.moving
        points = np.repeat(self.rest[:, None], samples, axis=1)
        part = self._stop[:, :samples]
        points[:, : part.shape[1]] = part
        self._issue(points)
        self._stop = self._stop[:, samples:]
        parsed = _parse(request, samples)
        self._reference, self._held = (self._nowhere if parsed is None else parsed[:, -1:]), True

    def affords(self, ahead: Floats) -> bool:
        """Whether some path length (3, 1) is left of the travel."""
        return bool((self.travel + ahead <= self._most).all())

    def issued(self, samples: int) -> Floats:
        """Last set points that were issued, shape (3, samples) at most."""
        return self._history[:, -samples:].copy()

    def lags(self, measured: object) -> str:
        """Say where the machine is too far from what was last issued, empty if it is not."""
        seen = _numbers(measured)
        if seen is None or seen.shape[:1] != (3,) or not seen.size or not np.isfinite(seen).all():
            return "measured position is not three finite values"
        seen = seen.reshape(3, -1)
        issued = self.issued(seen.shape[1])
        error = seen[:, -issued.shape[1] :] - issued
        ok = np.abs(error) <= self._following
        return "" if ok.all() else _worst(AXES[:3], "following error", error, ok)

    def _joined(self, points: Floats) -> Floats:
        """History after some points, long enough for all limits and for comparison with what is measured."""
        return np.concatenate((self._history, points), axis=1)[:, -max(self._history.shape[1], points.shape[1]) :]

    def _issue(self, points: Floats) -> None:
        """Put checked points behind the history."""
        steps = np.abs(np.diff(np.concatenate((self._history[:, -1:], points), axis=1)))
        self.travel = self.travel + steps.sum(axis=1, keepdims=True)
        self._still = 0 if steps.any() else self._still + points.shape[1]
        self._history = self._joined(points)

    def _joint(self) -> tuple[Floats, int]:
        """Distance from the path to what is issued, and how many samples ago it began to be taken out."""
        return (self._history[:, -1:] - self._reference, 0) if self._held else (self._bias, self._eased)

    def _stands(self, points: Floats) -> bool:
        """Whether a path stays where everything in the history is: the usual block, with nothing left to check."""
        done = not self._held and self._eased >= len(self._ease) and self._still >= self._history.shape[1]
        fits = points.shape[1] <= self._history.shape[1]
        return done and fits and bool((points == self._history[:, -1:]).all())

    def _apart(self, bias: Floats) -> str:
        """Say whether a path rested too far from where the last stop ended, or nowhere."""
        near = (np.abs(bias[:, 0]) <= self._near).all()
        return "" if near else "path does not begin where the last stop ended"

    def _astray(self, points: Floats, way: Way) -> str:
        """Say whether a path leaves the way to its target or the arc."""
        shift, (near, slide, _) = points[0], self._near
        if not (shift >= way.low - near).all() or not (shift <= way.high + near).all():
            return f"path leaves the way to its target: shift {shift.min():.6g} to {shift.max():.6g}"
        off = np.abs(points[1:] - arc(shift, way.radius, self._limits.axis_angle)[1:])
        return "" if (off <= slide).all() else f"path leaves the arc by {off.max():.3g}"

    def _violation(self, history: Floats, points: Floats, travel: Floats) -> str:
        """Which limit some points pass, coming after some history and travel; empty if none."""
        if why := self.beyond(points):
            return why
        joined = np.concatenate((history, points), axis=1)
        difference = joined[:, history.shape[1] - 3 :]
        for order, limit in zip(ORDERS, self._rates, strict=True):
            difference = difference[:, 1:] - difference[:, :-1]
            ok = np.abs(difference) <= limit
            if not ok.all():
                rate = self._limits.sample_rate_hz ** (1 + ORDERS.index(order))
                return _worst(AXES[:3], order, difference * rate, ok)
        start = history.shape[1] - self._lag
        step = points - joined[:, start : start + points.shape[1]]
        ok = np.abs(step) <= self._step
        if not ok.all():
            return _worst(AXES[:3], "step per interval", step, ok)
        total = travel + np.abs(np.diff(joined[:, history.shape[1] - 1 :])).sum(axis=1, keepdims=True)
        ok = total <= self._most
        return "" if ok.all() else _worst(AXES[:3], "total travel", total, ok)

    def _way_to_stop(self, block: Floats) -> Floats | None:
        """Shortest stop after a block (3, n) that keeps every limit; None if there is none."""
        history = self._joined(block)
        last = history[:, -3:]
        speed, before = last[:, 2:] - last[:, 1:2], last[:, 1:2] - last[:, :1]
        change = speed - before
        if not speed.any() and not change.any():
            return last[:, :0]
        jerk = 6.0 * np.abs(speed) / self._lengths**2 + 4.0 * np.abs(change) / self._lengths
        fits = (jerk <= self._rates[2]) & (1.5 * np.abs(speed) / self._lengths <= self._rates[1])
        travel = self.travel + np.abs(np.diff(block, prepend=self._history[:, -1:])).sum(axis=1, keepdims=True)
        for of_speed, of_change in self._stops[int(fits.all(axis=0).argmax()) :]:
            points = last[:, 2:] + speed * of_speed + change * of_change
            if not self._violation(history, points, travel):
                return points
        return None

    def _shapes(self) -> list[tuple[Floats, Floats]]:
        """Way of a stop per unit of speed and acceleration, for growing durations up to the longest needed."""
        speed, acceleration, jerk = (rate[:, 0] for rate in self._rates)
        longest = (4 * acceleration + np.sqrt(16 * acceleration**2 + 24 * speed * jerk)) / (2 * jerk)
        most = 1.5 * float(np.maximum(longest, 3 * speed / acceleration).max())
        most = min(most, self._limits.samples(LONGEST_STOP_S))
        shapes: list[tuple[Floats, Floats]] = []
        length = 8.0
        while length < 1.25 * most or not shapes:
            n = round(length)
            u = np.arange(1, n + 1) / n
            profiles = 1.0 - 3.0 * u**2 + 2.0 * u**3, n * (u - 2.0 * u**2 + u**3)
            of_speed, of_change = (np.pad(np.cumsum(profile), (0, 3), mode="edge") for profile in profiles)
            shapes.append((of_speed, of_change))
            length *= 1.25
        return shapes


def _numbers(given: object) -> Floats | None:
    """Make anything a fresh array of floats; None if it is not numbers."""
    try:
        values = np.array(given)
    except ValueError:
        return None
    return values.astype(np.float64) if values.dtype.kind in "fiu" else None


def _parse(request: Sequence[object], samples: int) -> Floats | None:
    """Make a request (shift, x1, y1) a fresh array (3, samples); None if it is not that."""
    points = _numbers(request)
    return points if points is not None and points.shape == (3, samples) else None


def _worst(axes: Sequence[str], what: str, values: Floats, ok: NDArray[np.bool_]) -> str:
    """Name the first point that breaks a limit."""
    row, column = np.argwhere(~ok)[0]
    return f"{what} of {axes[row]} beyond its limit: {values[row, column]:.6g}"
