"""Jerk-limited path of the shift, bounded under any sequence of targets.

A rate limiter feeds two moving averages in cascade (trajectory filters: L. Biagiotti and C. Melchiorri, "FIR filters
for online trajectory planning with time- and frequency-domain specifications", Control Engineering Practice, 2012). An
average of something bounded keeps its bound, and the rate of change of an average over T is at most twice the bound
over T; hence speed, acceleration and jerk are bounded whatever the targets do. The levels are integers, so sums are
exact, nothing drifts, and the path ends on the target.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pitch._checks import finite, positive, whole

GRID = 2.0**-40  # rad per count: 1e-14 m on a 25 mm bar
_MAX_TAPS = 2**21  # |level difference| < pi rad = 2**41.7 counts; times this it stays inside an int64


@dataclass(frozen=True, slots=True, kw_only=True)
class TrajectoryLimits:
    """What the shift may do at most, at every sample and under any sequence of targets.

    A plain move from rest to rest uses all of the speed, but only a half of the acceleration and of the jerk: the rest
    is the reserve for a reversal in mid-move.

    Attributes
    ----------
    max_speed : float
        Rate of the shift (rad/s).
    max_acceleration : float
        Its rate (rad/s^2).
    max_jerk : float
        The rate of that (rad/s^3).
    """

    max_speed: float
    max_acceleration: float
    max_jerk: float

    def __post_init__(self) -> None:
        """Check the ranges."""
        positive("max_speed", self.max_speed)
        positive("max_acceleration", self.max_acceleration)
        positive("max_jerk", self.max_jerk)


class TrajectoryState(NamedTuple):
    """Whole state of a `ShiftTrajectory`."""

    goal: int
    target: float
    window: NDArray[np.int64]


class ShiftTrajectory:
    """Streaming path of the shift towards a target that may change at any sample.

    Parameters
    ----------
    limits : TrajectoryLimits
        Bounds on speed, acceleration and jerk.
    sample_rate_hz : float
        Rate of the set points (Hz).
    initial_shift : float
        Where the path starts, at rest (rad).
    """

    def __init__(self, limits: TrajectoryLimits, sample_rate_hz: float, initial_shift: float = 0.0) -> None:
        self._step, self._first, self._second = _design(limits, positive("sample_rate_hz", sample_rate_hz))
        self._target = _checked(initial_shift)
        self._goal = round(self._target / GRID)
        self._window = np.full(self._first + self._second - 1, self._goal, dtype=np.int64)
        self._rests = True

    @property
    def target(self) -> float:
        """Where the path comes to rest (rad)."""
        return self._target

    @property
    def moving(self) -> bool:
        """Whether the last set point was not yet at rest on the target."""
        return not self._rests

    @property
    def samples_to_rest(self) -> int:
        """Samples after which the path is at rest on the target, if that stays."""
        gap = abs(self._goal - int(self._window[-1]))
        if gap:
            return -(-gap // self._step) + len(self._window) - 1
        off = np.flatnonzero(self._window != self._goal)
        return int(off[-1]) + 1 if len(off) else 0

    def retarget(self, shift: float) -> None:
        """Set a new target (rad); takes effect with the next set point, also in mid-move."""
        self._target = _checked(shift)
        self._goal = round(self._target / GRID)
        self._look()

    def stop(self) -> None:
        """Come to rest as soon as the limits allow, short of the target if it is still far."""
        level = int(self._window[-1])
        if level != self._goal:
            self._goal, self._target = level, level * GRID
            self._look()

    def advance(self, n: int) -> NDArray[np.float64]:
        """Next set points of the shift.

        Parameters
        ----------
        n : int
            How many.

        Returns
        -------
        ndarray
            Shift (rad), shape (n,).
        """
        count = whole("n", n, 0)
        if self._rests:
            return np.full(count, self._target)
        full = np.concatenate((self._window, self._ramp(count)))
        self._window = full[count:].copy()
        self._look()
        deviation = _moving_sum(_moving_sum(full[1:] - self._goal, self._first), self._second)
        return self._target + deviation.astype(np.float64) * (GRID / (self._first * self._second))

    def snapshot(self) -> TrajectoryState:
        """Copy of the whole state."""
        return TrajectoryState(self._goal, self._target, self._window.copy())

    def restore(self, state: TrajectoryState) -> None:
        """Go back to a state taken from a trajectory with the same limits."""
        if state.window.shape != self._window.shape:
            raise ValueError(f"state must hold {len(self._window)} levels, got {len(state.window)}")
        self._goal, self._target, self._window = state.goal, state.target, state.window.copy()
        self._look()

    def _look(self) -> None:
        """Note whether the path is at rest on its target; asked far more often than it changes."""
        self._rests = bool((self._window == self._goal).all())

    def _ramp(self, count: int) -> NDArray[np.int64]:
        level = int(self._window[-1])
        gap = self._goal - level
        steps = np.minimum(np.arange(1, count + 1, dtype=np.int64), -(-abs(gap) // self._step))
        return level + (1 if gap > 0 else -1) * np.minimum(steps * self._step, abs(gap))


def _design(limits: TrajectoryLimits, rate_hz: float) -> tuple[int, int, int]:
    """Return counts per sample and lengths of the two averages, with a reserve for rounding the target to the grid."""
    speed = limits.max_speed - GRID * rate_hz
    acceleration = limits.max_acceleration - 2 * GRID * rate_hz**2
    jerk = limits.max_jerk - 4 * GRID * rate_hz**3
    step = min(int(speed / rate_hz / GRID), 2**42)
    if step < 1 or acceleration <= 0.0 or jerk <= 0.0:
        raise ValueError(f"limits must be above the rounding at {rate_hz:g} Hz, got {limits}")
    reached = step * GRID * rate_hz
    first = max(1, math.ceil(2 * reached * rate_hz / acceleration))
    second = max(1, math.ceil(4 * reached * rate_hz**2 / (first * jerk)))
    if first * second > _MAX_TAPS:
        raise ValueError(f"limits must let the shift settle within {_MAX_TAPS} taps, got {first} x {second}: {limits}")
    return step, first, second


def _moving_sum(values: NDArray[np.int64], length: int) -> NDArray[np.int64]:
    total = np.concatenate((np.zeros(1, dtype=np.int64), np.cumsum(values)))
    return total[length:] - total[:-length]


def _checked(shift: float) -> float:
    value = finite("shift", shift)
    if abs(value) >= math.pi / 2:
        raise ValueError(f"shift must be in (-pi/2, pi/2) rad, got {value}")
    return value
