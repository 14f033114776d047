"""One bar mode between two tools that cut each other's surface, as an equation with two delays.

    m q'' + (c + 2 cp) q' + k q = -K [2 q + mu q(t - tau_1) + mu q(t - tau_2)] + F

Between samples the bar answers exactly, the past is read through a polynomial of degree 19 and every break that the
start leaves in the solution is followed, so that 13 samples per wave leave an error of 1e-11 after 7000 waves. Delays
are never rounded.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from turning_sim import _delay_kernels as kernels
from turning_sim._check import require
from turning_sim.linear import LinearParameters
from turning_sim.simulator import SimulationDiverged

_Floats = np.ndarray
Past = Callable[[_Floats], _Floats] | _Floats | None

_PER_WAVE = 6.0
_SHORTEST = kernels.HALF + 8
_DEGREE, _REACH = 26, kernels.HALF + 2.0


@dataclass(frozen=True, slots=True, kw_only=True)
class DelayEquation:
    """The numbers of the one-mode equation.

    Attributes
    ----------
    modal_mass : float
        With the displacement at the tools as coordinate (kg).
    natural_frequency_hz : float
        Of the bar alone, undamped (Hz).
    damping_ratio : float
        Of the bar alone.
    cutting_stiffness : float
        Radial, of one tool (N/m).
    overlap : float
        Share of the other tool's wave that a tool meets, positive for opposed tools.
    process_damping : float
        Of one tool (N s/m).
    delay_1, delay_2 : float
        From tool 2's cut to tool 1, and from tool 1's to tool 2 (s).
    """

    modal_mass: float
    natural_frequency_hz: float
    damping_ratio: float
    cutting_stiffness: float
    overlap: float
    process_damping: float
    delay_1: float
    delay_2: float

    def __post_init__(self) -> None:
        """Check the ranges."""
        for name in ("modal_mass", "natural_frequency_hz", "delay_1", "delay_2"):
            value = getattr(self, name)
            require(value > 0.0 and math.isfinite(value), name, "positive", value)
        for name in ("damping_ratio", "cutting_stiffness", "process_damping"):
            value = getattr(self, name)
            require(value >= 0.0 and math.isfinite(value), name, "at least 0", value)
        require(-1.0 <= self.overlap <= 1.0, "overlap", "in [-1, 1]", self.overlap)

    @classmethod
    def of_cut(cls, linear: LinearParameters, spindle_hz: float, shift: float) -> DelayEquation:
        """Return the equation of a cut, with turret 1 shifted by `shift` (rad) at a spindle speed (Hz)."""
        require(spindle_hz > 0.0, "spindle_hz", "positive", spindle_hz)
        require(abs(shift) < math.pi, "shift", "within half a turn", shift)
        turn = 2.0 * math.pi * spindle_hz
        return cls(
            modal_mass=linear.mass_at_tools,
            natural_frequency_hz=linear.natural_frequency_hz,
            damping_ratio=linear.damping_ratio,
            cutting_stiffness=linear.cutting_stiffness,
            overlap=linear.overlap,
            process_damping=linear.process_damping,
            delay_1=(math.pi + shift) / turn,
            delay_2=(math.pi - shift) / turn,
        )

    @property
    def stiffness(self) -> float:
        """Of the bar alone (N/m)."""
        return self.modal_mass * (2.0 * math.pi * self.natural_frequency_hz) ** 2

    @property
    def damping(self) -> float:
        """Of the bar alone (N s/m)."""
        return 4.0 * math.pi * self.damping_ratio * self.modal_mass * self.natural_frequency_hz


class LinearVibration:
    """A small vibration from a given past on, advanced piece by piece; any cutting gives the same numbers.

    Parameters
    ----------
    equation : DelayEquation
        What vibrates.
    sample_rate_hz : float
        Steps and samples per second (Hz), at least six for each wave.
    past : callable or ndarray or None
        Displacement (m) up to time 0: a smooth function of an array of times (s), which is also asked for its
        continuation a dozen samples beyond 0 and before the longest delay; or samples, oldest first, the last one at
        time 0, that the equation itself has made (a break where they end is not followed); None for rest.
    impulse : float
        On the bar at time 0 (N s).

    Attributes
    ----------
    sample : int
        Number of the last sample; sample 0 is at time 0.
    """

    def __init__(
        self,
        equation: DelayEquation,
        *,
        sample_rate_hz: float = 9000.0,
        past: Past = None,
        impulse: float = 0.0,
    ) -> None:
        self.equation, self.sample_rate_hz, self.sample = equation, sample_rate_hz, 0
        self._step = step_of(equation, sample_rate_hz)
        self._weights = np.empty((2, kernels.TAPS))
        kernels.rows(self._step, self._weights, np.empty(kernels.TAPS), np.empty(kernels.TAPS))
        self._force_shares = np.empty(3)
        kernels.shares_of_force(self._step.s, self._step.w2, self._step.push, self._force_shares)
        self._past = sampled(past, self._step, sample_rate_hz)
        self._force = np.zeros(2)
        self._missing = self._breaks(past, impulse)

    def advance(self, samples: int, force: np.ndarray | None = None) -> np.ndarray:
        """Return the displacement (m) at the next samples.

        Parameters
        ----------
        samples : int
            How many.
        force : ndarray or None
            On the bar (N) at these samples, linear between them and 0 up to time 0, shape (samples,). White noise
            leaves kinks at every sample, which are read smoothed: 2e-5 of the vibration at 13 samples per wave.

        Returns
        -------
        ndarray
            Shape (samples,).
        """
        require(samples >= 0, "samples", "at least 0", samples)
        shared, first = self._shared(samples, force), self._past.size
        q = np.empty(first + samples)
        q[:first] = self._past
        kernels.advance(
            self._step, self._weights, first, self._missing, self.sample + 1, shared, np.empty(kernels.CHUNK), q
        )
        self.sample += samples
        if not abs(q[-1]) < np.inf:
            raise SimulationDiverged(sample=self.sample, hint="the linear vibration left the range of numbers")
        self._past = q[samples:].copy()
        return q[first:]

    def snapshot(self) -> dict[str, Any]:
        """Return a copy of the whole state."""
        return {"sample": self.sample, "past": self._past.copy(), "force": self._force.copy(), "missing": self._missing}

    def restore(self, snapshot: dict[str, Any]) -> None:
        """Go back to a state from `snapshot`."""
        self.sample, self._missing = snapshot["sample"], snapshot["missing"]
        self._past, self._force = snapshot["past"].copy(), snapshot["force"].copy()

    def _shared(self, samples: int, force: np.ndarray | None) -> np.ndarray:
        """Return what the force adds at each step; nothing while there has been none."""
        if force is None and not self._force.any():
            return np.empty(0)
        push = np.zeros(samples) if force is None else np.asarray(force, dtype=np.float64)
        require(push.shape == (samples,), "force", f"of shape ({samples},)", push.shape)
        require(bool(np.isfinite(push).all()), "force", "finite", "a force that is not")
        push = np.concatenate([self._force, push])
        self._force = push[-2:].copy()
        return np.convolve(push, self._force_shares[::-1], "valid") if samples else np.empty(0)

    def _breaks(self, past: Past, impulse: float) -> np.ndarray:
        """Return what the rows miss because of the break that the start leaves at time 0 and its echoes."""
        step, given = self._step, callable(past)
        require(math.isfinite(impulse), "impulse", "finite", impulse)
        if not given and impulse == 0.0:
            return np.empty(0)
        series, forced = np.zeros(kernels.JUMPS), np.zeros(kernels.JUMPS)
        before = np.zeros(kernels.JUMPS)
        if given:
            before, one, two = (_taylor(past, self.sample_rate_hz, at) for at in (0.0, -step.tau1, -step.tau2))
            forced = -step.a * (one + two)
        series[0], series[1] = before[0], before[1] + impulse * step.push * self.sample_rate_hz
        kernels.continue_series(step, series, forced)
        jump = series - before
        missing = np.empty(math.ceil(kernels.LEVELS * max(step.tau1, step.tau2)) + 2 * kernels.TAPS)
        kernels.hand_on(step, self._weights, jump, missing)
        # the first step has the break at its start: its end is known
        q = np.concatenate([self._past, np.zeros(1)])
        kernels.advance(step, self._weights, q.size - 1, np.zeros(1), 1, np.empty(0), np.empty(kernels.CHUNK), q)
        missing[0] = series.sum() - q[-1] if given else jump.sum()
        return missing


def step_of(equation: DelayEquation, sample_rate_hz: float) -> kernels.Step:
    """Return the numbers of an equation at a rate (Hz), after checking that the rate can carry them."""
    e, h = equation, 1.0 / sample_rate_hz if sample_rate_hz > 0.0 else math.nan
    squared = (e.stiffness + 2.0 * e.cutting_stiffness) / e.modal_mass
    slowest = max(_PER_WAVE * math.sqrt(squared) / (2.0 * math.pi), _SHORTEST / min(e.delay_1, e.delay_2))
    require(
        sample_rate_hz >= slowest and math.isfinite(sample_rate_hz), "sample_rate_hz",
        f"at least {slowest:.6g} (six samples per wave, {_SHORTEST} in a delay)", sample_rate_hz,
    )  # fmt: skip
    return kernels.Step(
        s=0.5 * (e.damping + 2.0 * e.process_damping) / e.modal_mass * h,
        w2=squared * h * h,
        a=e.cutting_stiffness * e.overlap / e.modal_mass * h * h,
        tau1=e.delay_1 * sample_rate_hz,
        tau2=e.delay_2 * sample_rate_hz,
        push=h * h / e.modal_mass,
    )


def sampled(past: Past, step: kernels.Step, rate: float) -> np.ndarray:
    """Return the past at the samples up to 0 that the rows read, oldest first."""
    count = math.floor(max(step.tau1, step.tau2)) + kernels.HALF + 2
    if past is None:
        return np.zeros(count)
    if callable(past):
        values = np.asarray(past(np.arange(1 - count, 1) / rate), dtype=np.float64)
        require(values.shape == (count,), "past", "a function of an array of times", values.shape)
    else:
        values = np.array(past, dtype=np.float64)
        require(values.ndim == 1 and values.size >= count, "past", f"at least {count} samples", values.shape)
        values = values[-count:]
    require(bool(np.isfinite(values).all()), "past", "finite", values)
    return values


def _taylor(past: Any, rate: float, at: float) -> np.ndarray:
    """Return the series of a smooth function about a time, both in samples."""
    places, matrix = _interpolation()
    return matrix @ past((at + _REACH * places) / rate)


@cache
def _interpolation() -> tuple[_Floats, _Floats]:
    """Return Chebyshev points and the matrix from values there to a series in samples, shape (JUMPS, points)."""
    chebyshev = np.polynomial.chebyshev
    places = chebyshev.chebpts1(_DEGREE + 1)
    fit = 2.0 / places.size * chebyshev.chebvander(places, _DEGREE).T
    fit[0] *= 0.5
    powers = np.zeros((kernels.JUMPS, _DEGREE + 1))
    for k in range(_DEGREE + 1):
        powers[: k + 1, k] = chebyshev.cheb2poly(np.eye(_DEGREE + 1)[k])[: k + 1]
    return places, (powers @ fit) / _REACH ** np.arange(kernels.JUMPS)[:, None]
