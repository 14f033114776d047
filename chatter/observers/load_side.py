"""Cutting force from the balance of the stages alone: no current, no rotor inertia, no motor friction."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chatter.blocks import as_block, reject_non_finite
from chatter.filters import butterworth, group_delay, response, steady_state
from chatter.observers import _kernels
from chatter.observers.delays import align
from chatter.observers.nominal import NominalFeedDrive, NominalTurret

__all__ = ["LoadSideObserver", "LoadSideState", "NominalFeedDrive", "NominalTurret"]

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class LoadSideState:
    """Copy of the whole state of a `LoadSideObserver`."""

    seen: int
    origin: Floats
    history: Floats
    delays: Floats
    idling: Floats


class LoadSideObserver:
    """Force on the tool of a two-slide turret from motor and stage positions.

    Member lambda = 0 of the two-encoder family H (E_t + lambda E_m), E_t the force balance of the stage and E_m that of
    the motor (thesis chapter 3). Each balance holds the acceleration of the other slide through the cross mass.
    Positions count from the first sample: a constant load (gravity) is left out and nothing rings at the start.

    Parameters
    ----------
    turret : NominalTurret
        Nominal drives, upper mass and angle of the slides.
    sample_rate_hz : float
        Sampling rate (Hz).
    cutoff_hz : float
        Edge of the low-pass that all terms share (Hz).
    order : int
        Order of that Butterworth filter.
    """

    def __init__(self, turret: NominalTurret, sample_rate_hz: float, cutoff_hz: float = 1000.0, order: int = 4) -> None:
        self.turret = turret
        self.sample_rate_hz = float(sample_rate_hz)
        self.sections = butterworth(order, cutoff_hz, sample_rate_hz)
        x1, y1 = turret.drives
        ages = [x1.motor_delay, y1.motor_delay, x1.stage_delay, y1.stage_delay]
        self._alignment = align(np.array(ages) * self.sample_rate_hz)
        self._resolution = np.array(
            [x1.motor_resolution, y1.motor_resolution, x1.stage_resolution, y1.stage_resolution]
        )
        self._gains = balance_gains(turret, self.sample_rate_hz)
        self._gains *= np.where(self._resolution > 0.0, self._resolution, 1.0)[:, None, None]
        self._steady = steady_state(self.sections)
        self._turn = turret.force_from_loads()
        self._origin = np.zeros(4)
        self._history = np.zeros((4, self._alignment.reach + 2))
        self._delays = np.zeros((2, len(self.sections), 2))
        self._idling = np.zeros(2)
        self._seen = 0

    def update(self, motor_position: ArrayLike, stage_position: ArrayLike, thrust: ArrayLike | None = None) -> Floats:
        """Take a block of signals and return the force on the tool (N), shape (n, 2): F_x against +X1, F_y' along +Y1'.

        Parameters
        ----------
        motor_position : array_like, shape (n, 2)
            Positions (m) by the motor encoders of X1 and Y1, as slide travel.
        stage_position : array_like, shape (n, 2)
            Positions (m) by the linear scales of X1 and Y1.
        thrust : array_like, shape (n, 2), optional
            Commanded thrust (N); this member of the family has no use for it.
        """
        motor, stage = as_block(motor_position, 2), as_block(stage_position, 2)
        if motor.shape != stage.shape:
            raise ValueError(f"stage_position must be of the shape of motor_position {motor.shape}, got {stage.shape}")
        out, residual = np.empty_like(motor), np.empty_like(motor)
        buffer = np.empty((2, self.first_valid_sample + len(motor)))
        first, weights, _ = self._alignment
        bad = _kernels.residuals(
            motor, stage, self._seen, self._resolution, first, weights, self._gains,
            self._origin, self._history, buffer, residual,
        )  # fmt: skip
        if bad >= 0:
            reject_non_finite(np.hstack([motor, stage]), bad, self._seen)
        start = self._seen == 0
        _kernels.smooth_and_turn(
            residual, start, self.sections, self._steady, self._delays, self._turn, self._idling, out
        )
        self._seen += len(motor)
        return out

    @property
    def first_valid_sample(self) -> int:
        """Index of the first sample whose balance rests on measured samples only; before it the springs alone speak."""
        return self._history.shape[1]

    @property
    def latency(self) -> float:
        """Time (s) by which the force lags: age of the signals, one sample of the kernel, low-pass at low frequency."""
        age = (self._alignment.age + 1.0) / self.sample_rate_hz
        return age + group_delay(self.sections, 0.0, self.sample_rate_hz)

    def response(self, frequency_hz: ArrayLike) -> NDArray[np.complex128]:
        """Return estimate over true force as it is with exact parameters: delay, kernel weight (1, 10, 1)/12, low-pass.

        Parameters
        ----------
        frequency_hz : array_like
            Frequencies (Hz).
        """
        angle = 2.0 * np.pi * np.asarray(frequency_hz, dtype=np.float64) / self.sample_rate_hz
        kernel = (5.0 + np.cos(angle)) / 6.0 * np.exp(-1j * angle * (self._alignment.age + 1.0))
        return kernel * response(self.sections, frequency_hz, self.sample_rate_hz)

    def set_idling(self, force: ArrayLike) -> None:
        """Take a constant force off the estimate from now on.

        Parameters
        ----------
        force : array_like, shape (2,)
            Mean estimate (N) while the axes idle, in the frame of `update`, counted from zero idling.
        """
        idling = np.asarray(force, dtype=np.float64)
        if idling.shape != (2,) or not np.isfinite(idling).all():
            raise ValueError(f"force must be two finite values, got {force}")
        self._idling[:] = idling

    def prepare(self) -> None:
        """Compile the kernels; the state stays as it is."""
        LoadSideObserver(self.turret, self.sample_rate_hz).update(np.zeros((2, 2)), np.zeros((2, 2)))

    def reset(self) -> None:
        """Forget every sample; the idling force stays."""
        self._seen = 0

    def snapshot(self) -> LoadSideState:
        """Return a copy of the whole state."""
        return LoadSideState(
            seen=self._seen,
            origin=self._origin.copy(),
            history=self._history.copy(),
            delays=self._delays.copy(),
            idling=self._idling.copy(),
        )

    def restore(self, state: LoadSideState) -> None:
        """Continue from a copy of the state.

        Parameters
        ----------
        state : LoadSideState
            What `snapshot` of an observer of the same turret and rate returned.
        """
        if state.history.shape != self._history.shape or state.delays.shape != self._delays.shape:
            raise ValueError(f"state must be of history {self._history.shape}, got {state.history.shape}")
        self._seen = state.seen
        self._origin[:], self._history[:], self._delays[:] = state.origin, state.history, state.delays
        self._idling[:] = state.idling


def balance_gains(turret: NominalTurret, sample_rate_hz: float) -> Floats:
    """Return what level, first and second difference of each position add to each stage balance, shape (4, 2, 3).

    E_t = K W (x_m - x_t) + C_k D (x_m - x_t) - M_t S x_t - C_t D x_t - m_c cos(psi) S x_t(other slide), with the
    three-tap kernel S = (1, -2, 1)/T^2, D = (1, 0, -1)/2T, W = (1, 10, 1)/12 = level + S T^2/12 at the middle sample.

    Parameters
    ----------
    turret : NominalTurret
        Nominal drives.
    sample_rate_hz : float
        Sampling rate (Hz).
    """
    rate = sample_rate_hz
    gains = np.zeros((4, 2, 3))
    for axis, drive in enumerate(turret.drives):
        stiffness, damping = drive.screw_stiffness, 0.5 * rate * drive.screw_damping
        spring = np.array([stiffness, damping, stiffness / 12.0])
        gains[axis, axis] = spring
        gains[2 + axis, axis] = -spring
        gains[2 + axis, axis, 1] -= 0.5 * rate * drive.stage_damping
        gains[2 + axis, axis, 2] -= rate**2 * drive.stage_mass
        gains[3 - axis, axis, 2] = -(rate**2) * turret.cross_mass
    return gains
