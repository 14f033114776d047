"""How wrong an estimate will be: encoder counts, friction, parameters that are not what is believed.

Each part is a linear response, so that all estimators are judged by the same few lines: W, the gain from every sensed
signal to the force (`weights` of an observer), times what the sensors of the drive show (`sensed`).
"""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import solve_discrete_lyapunov

from chatter.filters import response
from chatter.observers.damping import resonance
from chatter.observers.linear import LinearObserver
from chatter.observers.nominal import NominalFeedDrive, SingleAxis
from chatter.observers.stage_model import NominalControl, sensed, with_errors

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

_FINE = 8192

SIGNALS = ("motor", "stage", "thrust")


@dataclass(frozen=True, slots=True, kw_only=True)
class Scene:
    """What an axis will have to do with.

    Parameters
    ----------
    band_hz : (float, float)
        Where the force is and where the estimate matters (Hz).
    force : float
        Of the cut, rms over that band (N).
    motor_friction, stage_friction : float
        What is not known of the friction of screw and guide, rms over that band (N).
    uncertainty : dict of str to float
        Relative standard uncertainty of parameters of the drive, by their name; `thrust` for the torque constant.
    control : NominalControl or None
        The loop around the drive.
    """

    band_hz: tuple[float, float]
    force: float = 1.0
    motor_friction: float = 0.0
    stage_friction: float = 0.0
    uncertainty: dict[str, float] = field(default_factory=dict)
    control: NominalControl | None = None

    def __post_init__(self) -> None:
        low, high = self.band_hz
        if not 0.0 < low < high < np.inf:
            raise ValueError(f"band_hz must be (low, high) with 0 < low < high, got {self.band_hz}")
        for name in ("force", "motor_friction", "stage_friction"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value >= 0.0):
                raise ValueError(f"{name} must be at least 0 and finite, got {value}")
        for name, value in self.uncertainty.items():
            if name != "thrust" and name not in NominalFeedDrive.__dataclass_fields__:
                raise ValueError(f"uncertainty must name parameters of the drive or thrust, got {name}")
            if not 0.0 <= value < 1.0:
                raise ValueError(f"uncertainty of {name} must be in [0, 1), got {value}")

    def frequencies_hz(self, count: int = 48) -> Floats:
        """Return frequencies spread evenly over the band (Hz), shape (count,).

        Parameters
        ----------
        count : int
            How many.
        """
        low, high = self.band_hz
        return low + (high - low) * (np.arange(count) + 0.5) / count


@dataclass(frozen=True, slots=True, kw_only=True)
class PredictedError:
    """Standard deviations of what an estimate will be wrong by (N).

    Parameters
    ----------
    quantisation : float
        From the counts of both encoders, over all frequencies.
    friction : float
        From friction that is not known.
    parameters : float
        From parameters that are not what is believed.
    structure : float
        From what the estimator leaves out even if all parameters are right.
    """

    quantisation: float
    friction: float
    parameters: float
    structure: float

    @property
    def total(self) -> float:
        """Root of the sum of squares (N)."""
        return float(np.sqrt(self.quantisation**2 + self.friction**2 + self.parameters**2 + self.structure**2))


def predicted_error(observer: LinearObserver, scene: Scene) -> PredictedError:
    """Return what an observer of one axis will be wrong by.

    Parameters
    ----------
    observer : LinearObserver
        Of one axis.
    scene : Scene
        What it has to do with.
    """
    drive = _drive(observer)
    hz = scene.frequencies_hz()
    weights = observer.weights(hz)[:, 0]
    loop: dict[str, Any] = {"control": scene.control, "sample_rate_hz": observer.sample_rate_hz}
    gain = (weights * sensed(drive, hz, **loop)).sum(axis=1)
    motor = (weights * sensed(drive, hz, motor_side=True, **loop)).sum(axis=1)
    parameters = 0.0
    for name, by in scene.uncertainty.items():
        moved = [_moved(drive, name, sign * by, hz, scene, observer) for sign in (1.0, -1.0)]
        parameters += _mean_square(0.5 * (weights * (moved[0] - moved[1])).sum(axis=1))
    friction = scene.motor_friction**2 * _mean_square(motor) + scene.stage_friction**2 * _mean_square(gain)
    return PredictedError(
        quantisation=float(np.sqrt(quantisation_variance(observer).sum())),
        friction=float(np.sqrt(friction)),
        parameters=scene.force * float(np.sqrt(parameters)),
        structure=scene.force * float(np.sqrt(_mean_square(gain - ideal_response(observer, hz)))),
    )


def _drive(observer: LinearObserver) -> NominalFeedDrive:
    if not isinstance(observer.drives, SingleAxis):
        raise ValueError(f"observer must be of one drive of two inertias, got {type(observer.drives).__name__}")
    return observer.drives.drive


def _moved(
    drive: NominalFeedDrive, name: str, by: float, hz: Floats, scene: Scene, observer: LinearObserver
) -> Complexes:
    """Return what the sensors show when the drive is not what is believed; its loop was tuned all the same."""
    gain = 1.0 + by if name == "thrust" else 1.0
    real = drive if name == "thrust" else with_errors(drive, **{name: by})
    return sensed(
        real, hz, control=scene.control, sample_rate_hz=observer.sample_rate_hz, thrust_gain=gain, tuned_for=drive
    )


def _mean_square(gain: Complexes) -> float:
    return float(np.mean(gain.real**2 + gain.imag**2))


def ideal_response(observer: LinearObserver, frequency_hz: ArrayLike) -> Complexes:
    """Return what the estimate would be of the force, shape (k,): late by the age of the signals, and low-passed.

    Parameters
    ----------
    observer : LinearObserver
        The observer.
    frequency_hz : array_like, shape (k,)
        Frequencies (Hz).
    """
    hz = np.atleast_1d(np.asarray(frequency_hz, dtype=np.float64))
    return response(observer.sections, hz, observer.sample_rate_hz) * np.exp(-2j * np.pi * hz * observer.age)


def response_of(observer: LinearObserver, drive: NominalFeedDrive, frequency_hz: ArrayLike, **loop: Any) -> Complexes:
    """Return estimate over true force on a drive as it is, relative to the ideal, shape (k,).

    Yamada, PhD thesis, Keio University, 2017, appendix B, with the terms of the loop that the print leaves out.

    Parameters
    ----------
    observer : LinearObserver
        Of one axis, with what it believes.
    drive : NominalFeedDrive
        The drive as it is.
    frequency_hz : array_like, shape (k,)
        Frequencies (Hz).
    **loop
        See `sensed`.
    """
    gain = (observer.weights(frequency_hz)[:, 0] * sensed(drive, frequency_hz, **loop)).sum(axis=1)
    return gain / ideal_response(observer, frequency_hz)


def quantisation_variance(observer: LinearObserver) -> Floats:
    """Return the variance that the counts of each encoder leave in the force of one axis (N^2), shape (positions,).

    Counts as white noise of variance q^2/12, through the state space of kernel, alignment and low-pass: discrete
    Lyapunov equation P = A P A' + B B', variance C P C' + D^2. Hayashi, Fujimoto et al. do so for their fit. Where two
    balances are blended or the motor is low-passed, the mean over the spectrum.

    Parameters
    ----------
    observer : LinearObserver
        Of one axis.
    """
    counts = observer.drives.sensors.resolutions
    if observer.blends or observer.motion is not None:
        hz = (np.arange(_FINE) + 0.5) / _FINE * 0.5 * observer.sample_rate_hz
        gain = observer.weights(hz)[:, 0, : len(counts)]
        return np.array(counts) ** 2 / 12.0 * np.mean(gain.real**2 + gain.imag**2, axis=0)
    return np.array(
        [q * q / 12.0 * filtered_variance(observer.taps(j), observer.sections) for j, q in enumerate(counts)]
    )


def filtered_variance(taps: Floats, sections: Floats) -> float:
    """Return the variance of white noise of variance one after taps and second-order sections.

    Parameters
    ----------
    taps : ndarray, shape (n,)
        Weights of the last samples, newest first.
    sections : ndarray, shape (k, 5)
        Rows b0 b1 b2 a1 a2.
    """
    scale = float(np.abs(taps).max(initial=0.0))
    if scale == 0.0:
        return 0.0
    a, b, c, d = (
        np.diag(np.ones(max(len(taps) - 2, 0)), -1),
        np.eye(max(len(taps) - 1, 1))[0],
        taps[1:] / scale,
        taps[0],
    )
    d = float(d / scale)
    if len(taps) == 1:
        a, c = np.zeros((1, 1)), np.zeros(1)
    for b0, b1, b2, a1, a2 in sections:  # transposed direct form II: z1' = b1 x - a1 y + z2, z2' = b2 x - a2 y
        n = len(a)
        grown = np.zeros((n + 2, n + 2))
        grown[:n, :n] = a
        grown[n, :n], grown[n + 1, :n] = (b1 - a1 * b0) * c, (b2 - a2 * b0) * c
        grown[n : n + 2, n : n + 2] = [[-a1, 1.0], [-a2, 0.0]]
        b = np.concatenate([b, [(b1 - a1 * b0) * d, (b2 - a2 * b0) * d]])
        c, d, a = np.concatenate([b0 * c, [1.0, 0.0]]), b0 * d, grown
    covariance = solve_discrete_lyapunov(a, np.outer(b, b))
    return float(c @ covariance @ c + d * d) * scale**2


def least_forces(drive: NominalFeedDrive, sample_rate_hz: float) -> dict[str, float]:
    """Return the force that one count more or less in one sample makes (N); thesis, Table 3-4.

    The last three are what a count of the scale makes in the vibration mode; the print lists the modal forces, which
    are these over the mass ratio alpha.

    Parameters
    ----------
    drive : NominalFeedDrive
        The drive.
    sample_rate_hz : float
        Sampling rate (Hz).
    """
    motor, stage, rate = drive.motor_resolution, drive.stage_resolution, sample_rate_hz
    return {
        "rotor_inertia": drive.rotor_mass * motor * rate**2,
        "stage_inertia": drive.stage_mass * stage * rate**2,
        "rotor_damping": drive.rotor_viscosity * motor * rate,
        "stage_damping": drive.stage_damping * stage * rate,
        "vibration_inertia": drive.stage_mass * stage * rate**2,
        "vibration_damping": resonance(drive).damping / (1.0 + drive.mass_ratio) * stage * rate,
        "vibration_elastic": (1.0 + drive.mass_ratio) * drive.screw_stiffness * stage,
    }
