"""Cutting force from the command of thrust alone, by a Kalman filter that knows how a force shows in it.

The response from force to thrust is a small linear model; the force is a constant that wanders and lines at half, once
and twice the frequency of tooth passing whose amplitudes wander:

    A_e = [A  B  B C_F; 0 0 0; 0 0 A_F]    C_e = [C  D  D C_F]    A_F = diag [0 -w_i; w_i 0]    C_F = [1 0 1 0 ...]

Kakkassery and Uthayakumar, Chalmers, 2020, eq. (7.5) to (7.11), with the second state of each line taken as w_i times
the integral of the first, so that its step is a rotation, noise only into the first, and D kept.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import block_diag, expm, solve_discrete_are

from chatter.blocks import as_block
from chatter.observers import _kalman_kernels

Floats = NDArray[np.float64]

HARMONICS = (0.5, 1.0, 2.0)
"""Lines of tooth passing in the model: run-out of two teeth, each tooth, and twice."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ForceModel:
    """How a force shows in the thrust: state space with one input and one output.

    Parameters
    ----------
    a : ndarray, shape (m, m)
        Continuous (1/s).
    b : ndarray, shape (m,)
        From the force (N).
    c : ndarray, shape (m,)
        To the commanded thrust (N).
    d : float
        From force to thrust at once.
    """

    a: Floats
    b: Floats
    c: Floats
    d: float = 0.0

    def __post_init__(self) -> None:
        """Check shapes and stability."""
        m = len(self.a)
        if self.a.shape != (m, m) or self.b.shape != (m,) or self.c.shape != (m,):
            raise ValueError(f"a, b, c must be of shapes (m, m), (m,), (m,), got {self.a.shape, self.b.shape}")
        if m and float(np.linalg.eigvals(self.a).real.max()) >= 0.0:
            raise ValueError(f"a must be stable, got an eigenvalue of {np.linalg.eigvals(self.a).real.max():g} 1/s")

    def response(self, frequency_hz: ArrayLike) -> NDArray[np.complex128]:
        """Return thrust over force, shape (k,).

        Parameters
        ----------
        frequency_hz : array_like, shape (k,)
            Frequencies (Hz).
        """
        s = 2j * np.pi * np.atleast_1d(np.asarray(frequency_hz, dtype=np.float64))
        eye = np.eye(len(self.a))
        return np.array([self.c @ np.linalg.solve(z * eye - self.a, self.b) + self.d for z in s])


def alias_hz(frequency_hz: float, sample_rate_hz: float) -> float:
    """Return where a line shows after sampling (Hz).

    Parameters
    ----------
    frequency_hz : float
        Frequency (Hz).
    sample_rate_hz : float
        Sampling rate (Hz).
    """
    return abs(frequency_hz - sample_rate_hz * round(frequency_hz / sample_rate_hz))


def van_loan(a: Floats, noise: Floats, step: float) -> tuple[Floats, Floats]:
    """Return the transition over a step and the covariance that noise adds in it; Van Loan, IEEE TAC 23 (1978) 395.

    Parameters
    ----------
    a : ndarray, shape (m, m)
        Continuous dynamics (1/s).
    noise : ndarray, shape (m, m)
        Intensity of the white noise that enters.
    step : float
        Time step (s).
    """
    m = len(a)
    big = expm(np.block([[-a, noise], [np.zeros((m, m)), a.T]]) * step)
    transition = np.ascontiguousarray(big[m:, m:].T, dtype=np.float64)
    added = transition @ big[:m, m:]
    return transition, np.asarray(0.5 * (added + added.T), dtype=np.float64)


@dataclass(frozen=True, slots=True, kw_only=True)
class KalmanState:
    """Copy of the whole state of a `KalmanObserver`."""

    seen: int
    estimate: Floats
    covariance: Floats


class KalmanObserver:
    """Force of one axis from its commanded thrust, sample by sample, with a steady gain.

    Parameters
    ----------
    model : ForceModel
        How a force shows in the thrust.
    sample_rate_hz : float
        Sampling rate (Hz).
    lines_hz : sequence of float
        Lines of the force (Hz), such as `HARMONICS` times tooth passing; above half the rate they count at their alias.
    drift : float
        How fast the constant part wanders: root of the intensity of its white noise (N/sqrt(s)).
    line_drift : float
        The same of each line (N/sqrt(s)).
    noise : float
        Standard deviation of the thrust that no force explains (N).
    """

    name = "kalman"
    needs_thrust = True
    first_valid_sample = 0
    latency = 0.0

    def __init__(
        self, model: ForceModel, sample_rate_hz: float, *, lines_hz: Sequence[float] = (), drift: float = 200.0,
        line_drift: float = 200.0, noise: float = 1.0,
    ) -> None:  # fmt: skip
        positive = {"sample_rate_hz": sample_rate_hz, "drift": drift, "line_drift": line_drift, "noise": noise}
        for name, value in positive.items():
            if not (np.isfinite(value) and value > 0.0):
                raise ValueError(f"{name} must be positive and finite, got {value}")
        self.model, self.sample_rate_hz = model, float(sample_rate_hz)
        self.lines_hz = tuple(alias_hz(f, sample_rate_hz) for f in lines_hz)
        if any(f <= 0.0 for f in self.lines_hz) or len(set(self.lines_hz)) < len(self.lines_hz):
            raise ValueError(f"lines_hz must differ and be above 0 after sampling, got {self.lines_hz}")
        self.bandwidth_hz = max([*self.lines_hz, 0.1 * sample_rate_hz])
        self._expand(drift, line_drift)
        self._noise = noise**2
        self._transition, self._added = van_loan(self._a, self._intensity, 1.0 / self.sample_rate_hz)
        before = solve_discrete_are(self._transition.T, self._c[:, None], self._added, [[self._noise]])
        self._gain, self._after = self._corrected(before)
        self._rows = np.ascontiguousarray(self._transition.T)
        self._scratch = np.empty(len(self._c))
        self.reset()

    def _expand(self, drift: float, line_drift: float) -> None:
        m, lines = len(self.model.a), len(self.lines_hz)
        of_force = np.concatenate([[1.0], np.tile([1.0, 0.0], lines)])
        turns = [2.0 * np.pi * f * np.array([[0.0, -1.0], [1.0, 0.0]]) for f in self.lines_hz]
        self._a: Floats = np.asarray(block_diag(self.model.a, [[0.0]], *turns), dtype=np.float64)
        self._a[:m, m:] = np.outer(self.model.b, of_force)
        self._c = np.concatenate([self.model.c, self.model.d * of_force])
        self._force = np.concatenate([np.zeros(m), of_force])
        spread = np.concatenate([np.zeros(m), [drift**2], np.tile([line_drift**2, 0.0], lines)])
        self._intensity = np.diag(spread)

    def _corrected(self, before: Floats) -> tuple[Floats, Floats]:
        """Return gain and covariance after a sample, in Joseph's form."""
        gain = before @ self._c / (self._c @ before @ self._c + self._noise)
        left = np.eye(len(self._c)) - np.outer(gain, self._c)
        return gain, left @ before @ left.T + self._noise * np.outer(gain, gain)

    def update(self, motor_position: object, stage_position: object, thrust: ArrayLike | None = None) -> Floats:
        """Take a block of thrusts and return the force (N), shape (n,); a sample that is NaN is predicted over.

        Parameters
        ----------
        motor_position, stage_position : object
            Not used.
        thrust : array_like, shape (n,)
            Commanded thrust (N).
        """
        if thrust is None:
            raise ValueError("thrust must be given for the estimator kalman, got None")
        y = as_block(thrust, 1)[:, 0]
        if np.isinf(y).any():
            raise ValueError(f"thrust must be finite or NaN, got {y[np.isinf(y)][0]} at sample {self._seen}")
        out = np.empty_like(y)
        _kalman_kernels.steady_filter(
            y, self._rows, self._gain, self._c, self._force, self._estimate, self._scratch, out
        )
        self._seen += len(y)
        return out

    def update_at(self, thrust: ArrayLike, intervals: ArrayLike) -> Floats:
        """Take samples that are not evenly spaced and return the force (N), shape (n,).

        Transition, noise and gain are made anew for each interval.

        Parameters
        ----------
        thrust : array_like, shape (n,)
            Commanded thrust (N), NaN where lost.
        intervals : array_like, shape (n,)
            Time since the sample before (s), positive.
        """
        y, steps = np.asarray(thrust, dtype=np.float64), np.asarray(intervals, dtype=np.float64)
        if y.shape != steps.shape or y.ndim != 1 or not (np.isfinite(steps) & (steps > 0.0)).all():
            raise ValueError(f"intervals must be positive, one for each thrust {y.shape}, got {steps.shape}")
        out = np.empty_like(y)
        for k, step in enumerate(steps):
            turn, added = van_loan(self._a, self._intensity, step)
            self._estimate = turn @ self._estimate
            before = turn @ self._covariance @ turn.T + added
            self._covariance = before
            if np.isfinite(y[k]):
                gain, self._covariance = self._corrected(before)
                self._estimate = self._estimate + gain * (y[k] - self._c @ self._estimate)
            out[k] = self._force @ self._estimate
        self._seen += len(y)
        return out

    @property
    def force_std(self) -> float:
        """Standard deviation of the error of the force as the filter believes it (N)."""
        return float(np.sqrt(self._force @ self._after @ self._force))

    def prepare(self) -> None:
        """Compile the kernel; the state stays as it is."""
        before = self.snapshot()
        self.update(None, None, np.zeros(2))
        self.restore(before)

    def reset(self) -> None:
        """Forget every sample."""
        self._seen = 0
        self._estimate = np.zeros(len(self._c))
        self._covariance = self._after.copy()

    def snapshot(self) -> KalmanState:
        """Return a copy of the whole state."""
        return KalmanState(seen=self._seen, estimate=self._estimate.copy(), covariance=self._covariance.copy())

    def restore(self, state: KalmanState) -> None:
        """Continue from a copy of the state.

        Parameters
        ----------
        state : KalmanState
            What `snapshot` of an observer with the same model and lines returned.
        """
        if state.estimate.shape != self._estimate.shape:
            raise ValueError(f"state must be of shape {self._estimate.shape}, got {state.estimate.shape}")
        self._seen, self._estimate = state.seen, state.estimate.copy()
        self._covariance = state.covariance.copy()


def force_from_motor_torque(torque: ArrayLike, lead: float, efficiency: float = 1.0) -> Floats:
    """Return the force on the stage (N) for a torque of the motor: F = eta tau/r_g, r_g = lead/2 pi; eq. (7.11).

    Parameters
    ----------
    torque : array_like
        Torque (N m).
    lead : float
        Lead of the screw (m per revolution).
    efficiency : float
        eta, in (0, 1].
    """
    if not (lead > 0.0 and 0.0 < efficiency <= 1.0):
        raise ValueError(f"lead must be positive and efficiency in (0, 1], got {lead} and {efficiency}")
    return efficiency * 2.0 * np.pi / lead * np.asarray(torque, dtype=np.float64)
