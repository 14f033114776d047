"""Every estimator by its name for the two skewed slides of a turret, as the closed loop takes it."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chatter.observers.choice import optimal_weight
from chatter.observers.family import BLEND_HZ, linear_observer, two_encoder
from chatter.observers.fitted import fitted_observer
from chatter.observers.linear import LinearObserver
from chatter.observers.named import NAMES, Observer, observer
from chatter.observers.nominal import NominalTurret
from chatter.observers.prediction import Scene
from chatter.observers.stage_model import NominalControl

Floats = NDArray[np.float64]

LEFT_UNKNOWN = {"stage_mass": 0.05, "rotor_inertia": 0.02, "screw_stiffness": 0.1}
"""Standard uncertainties that the optimal weight is chosen for when nothing else is said."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PairState:
    """Copy of the whole state of a `PairObserver`."""

    axes: tuple[Any, ...]


class PairObserver:
    """Two estimators of one axis each, their loads turned into the force on the tool.

    The acceleration of the other slide is not taken off: an estimator from one signal has no way to know it.

    Parameters
    ----------
    turret : NominalTurret
        Nominal drives and the angle of the slides.
    axes : tuple of Observer
        One for each slide.
    """

    def __init__(self, turret: NominalTurret, axes: tuple[Observer, Observer]) -> None:
        self.name, self.axes, self._turn = axes[0].name, axes, turret.force_from_loads()
        self.sample_rate_hz = axes[0].sample_rate_hz
        self.bandwidth_hz = min(axis.bandwidth_hz for axis in axes)
        self.needs_thrust = any(axis.needs_thrust for axis in axes)
        self.first_valid_sample = max(axis.first_valid_sample for axis in axes)
        self.latency = max(axis.latency for axis in axes)
        self._idling = np.zeros(2)

    def update(self, motor_position: ArrayLike, stage_position: ArrayLike, thrust: ArrayLike | None = None) -> Floats:
        """Take a block of signals and return the force on the tool (N), shape (n, 2): F_x against +X1, F_y' along +Y1'.

        Parameters
        ----------
        motor_position, stage_position : array_like, shape (n, 2)
            Positions (m) as slide travel.
        thrust : array_like, shape (n, 2), optional
            Commanded thrust (N).
        """
        signals = [
            None if s is None else np.asarray(s, dtype=np.float64) for s in (motor_position, stage_position, thrust)
        ]
        loads = [
            axis.update(*(None if s is None else np.ascontiguousarray(s[:, k]) for s in signals))
            for k, axis in enumerate(self.axes)
        ]
        return np.stack(loads, axis=1) @ self._turn.T - self._idling

    def set_idling(self, force: ArrayLike) -> None:
        """Take a constant force off the estimate from now on.

        Parameters
        ----------
        force : array_like, shape (2,)
            Mean estimate while the axes idle (N).
        """
        idling = np.asarray(force, dtype=np.float64)
        if idling.shape != (2,) or not np.isfinite(idling).all():
            raise ValueError(f"force must be two finite values, got {force}")
        self._idling = self._idling + idling

    def prepare(self) -> None:
        """Compile the kernels; the state stays as it is."""
        for axis in self.axes:
            axis.prepare()

    def reset(self) -> None:
        """Forget every sample; the idling force stays."""
        for axis in self.axes:
            axis.reset()

    def snapshot(self) -> PairState:
        """Return a copy of the whole state."""
        return PairState(axes=tuple(axis.snapshot() for axis in self.axes))

    def restore(self, state: PairState) -> None:
        """Continue from a copy of the state.

        Parameters
        ----------
        state : PairState
            What `snapshot` of the same pair returned.
        """
        for axis, saved in zip(self.axes, state.axes, strict=True):
            axis.restore(saved)


def turret_observer(
    name: str,
    turret: NominalTurret,
    sample_rate_hz: float,
    *,
    cutoff_hz: float = 1000.0,
    band_hz: tuple[float, float] = (500.0, 750.0),
    controls: tuple[NominalControl, NominalControl] | None = None,
    spindle_hz: float | None = None,
    blend_hz: float = BLEND_HZ,
) -> LinearObserver | PairObserver:
    """Return an estimator of the force on the tool.

    Parameters
    ----------
    name : str
        One of `chatter.observers.named.NAMES`.
    turret : NominalTurret
        Nominal drives.
    sample_rate_hz : float
        Sampling rate (Hz).
    cutoff_hz : float
        Edge of the low-pass (Hz).
    band_hz : (float, float)
        Where the estimate matters (Hz), for optimal.
    controls : tuple of NominalControl or None
        Loops of X1 and Y1; needed by kalman.
    spindle_hz : float or None
        Spindle speed (Hz); needed by fitted.
    blend_hz : float
        Edge of blended (Hz).
    """
    if name not in NAMES:
        raise ValueError(f"name must be one of {', '.join(NAMES)}, got {name!r}")
    if name == "optimal":
        loops = controls or (None, None)
        scenes = [Scene(band_hz=band_hz, force=30.0, uncertainty=LEFT_UNKNOWN, control=loop) for loop in loops]
        weights = [
            optimal_weight(drive, sample_rate_hz, scene, cutoff_hz=cutoff_hz)
            for drive, scene in zip(turret.drives, scenes, strict=True)
        ]
        return two_encoder(turret, sample_rate_hz, weights, name=name, cutoff_hz=cutoff_hz)
    if name == "fitted":
        if spindle_hz is None:
            raise ValueError("spindle_hz must be given for the estimator fitted, got None")
        return fitted_observer(turret, sample_rate_hz, spindle_hz=spindle_hz, cutoff_hz=cutoff_hz)
    if name in ("damping", "kalman"):
        loops = controls or (None, None)
        x1, y1 = (
            observer(name, drive, sample_rate_hz, cutoff_hz=cutoff_hz, control=loop)
            for drive, loop in zip(turret.drives, loops, strict=True)
        )
        return PairObserver(turret, (x1, y1))
    return linear_observer(name, turret, sample_rate_hz, cutoff_hz=cutoff_hz, blend_hz=blend_hz)
