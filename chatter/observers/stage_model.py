"""What the sensors of a nominal drive show under a force: frequency responses of the dual-inertia stage.

    A_r = M_r s^2 + C_r s    A_t = M_t s^2 + C_t s    B = C_k s + K    (A_r + B) x_m - B x_t = u' - d
    (A_t + B) x_t - B x_m = -F        u' = exp(-T_s s) omega_cc/(s + omega_cc) u

Yamada, PhD thesis, Keio University, 2017, eq. (2-4) with the factor alpha/(M_t^2 s D) in place of the printed one.
"""

from dataclasses import dataclass, fields, replace
from math import isfinite

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chatter.observers.nominal import NominalFeedDrive

Complexes = NDArray[np.complex128]

ALIASES = 3
"""Folds on either side that a held thrust is summed over: beyond, positions fall as the third power of frequency."""


@dataclass(frozen=True, slots=True, kw_only=True)
class NominalControl:
    """Full-closed loop: position P on the scale, velocity P on the motor, disturbance cancelled (thesis, chapter 4).

    Parameters
    ----------
    position_gain, velocity_gain : float
        K_p, K_v (1/s).
    disturbance_bandwidth : float
        g_dis of the first-order disturbance observer (rad/s); 0 for a loop without one.
    derivative_bandwidth : float
        g_LPF of the differentiated encoders (rad/s).
    """

    position_gain: float
    velocity_gain: float
    disturbance_bandwidth: float
    derivative_bandwidth: float

    def __post_init__(self) -> None:
        """Check every value once."""
        for field in fields(self):
            value = getattr(self, field.name)
            optional = field.name == "disturbance_bandwidth"
            if not (isfinite(value) and (value > 0.0 or (optional and value == 0.0))):
                raise ValueError(f"{field.name} must be {'at least 0' if optional else 'positive'}, got {value}")


def with_errors(drive: NominalFeedDrive, **relative: float) -> NominalFeedDrive:
    """Return a drive some of whose parameters are larger by a relative amount.

    Parameters
    ----------
    drive : NominalFeedDrive
        The drive.
    **relative : float
        For each parameter by name, how much larger it is, -0.5 for half.
    """
    return replace(drive, **{name: getattr(drive, name) * (1.0 + by) for name, by in relative.items()})


def sensed(
    drive: NominalFeedDrive,
    frequency_hz: ArrayLike,
    *,
    control: NominalControl | None = None,
    sample_rate_hz: float | None = None,
    motor_side: bool = False,
    thrust_gain: float = 1.0,
    tuned_for: NominalFeedDrive | None = None,
) -> Complexes:
    """Return motor position (m/N), stage position (m/N) and commanded thrust (N/N) per unit force, shape (k, 3).

    Parameters
    ----------
    drive : NominalFeedDrive
        The drive as it is.
    frequency_hz : array_like, shape (k,)
        Frequencies (Hz), above 0.
    control : NominalControl or None
        The loop around it; None when nothing drives it.
    sample_rate_hz : float or None
        Rate at which the loop holds its commands (Hz); None for a loop without sampling.
    motor_side : bool
        For a force that opposes the motor (friction of screw and bearings) instead of the stage.
    thrust_gain : float
        Thrust over what was asked for: an error of the torque constant.
    tuned_for : NominalFeedDrive or None
        The drive that the loop was designed for; None for the drive itself.
    """
    s: Complexes = (2j * np.pi * np.atleast_1d(np.asarray(frequency_hz, dtype=np.float64))).astype(np.complex128)
    under_load = _positions(drive, s, np.array([-1.0, 0.0] if motor_side else [0.0, -1.0]))
    thrust = np.zeros(len(s), dtype=np.complex128)
    if control is not None:
        feedback = _feedback(tuned_for or drive, control, s, sample_rate_hz)
        driven = thrust_gain * _driven(drive, s, sample_rate_hz)
        thrust = (feedback * under_load).sum(axis=1) / (1.0 - (feedback * driven).sum(axis=1))
        under_load = under_load + driven * thrust[:, None]
    return np.concatenate([under_load, thrust[:, None]], axis=1)


def _positions(drive: NominalFeedDrive, s: Complexes, push: NDArray[np.float64]) -> Complexes:
    """Return what both encoders show per unit push on motor and stage, shape (k, 2)."""
    spring = drive.screw_damping * s + drive.screw_stiffness
    a = np.zeros((len(s), 2, 2), dtype=np.complex128)
    a[:, 0, 0] = drive.rotor_mass * s**2 + drive.rotor_viscosity * s + spring
    a[:, 1, 1] = drive.stage_mass * s**2 + drive.stage_damping * s + spring
    a[:, 0, 1] = a[:, 1, 0] = -spring
    x = np.linalg.solve(a, np.broadcast_to(push, (len(s), 2))[..., None])[..., 0]
    seen = np.stack([np.exp(-s * drive.motor_delay), np.exp(-s * drive.stage_delay)], axis=1)
    return (x * seen).astype(np.complex128)


def _driven(drive: NominalFeedDrive, s: Complexes, sample_rate_hz: float | None) -> Complexes:
    """Return what both encoders show per unit of commanded thrust, held and sampled where there is a rate."""
    folds = range(-ALIASES, ALIASES + 1) if sample_rate_hz else range(1)
    total = np.zeros((len(s), 2), dtype=np.complex128)
    for fold in folds:
        at = (s + 2j * np.pi * fold * (sample_rate_hz or 0.0)).astype(np.complex128)
        lag = np.exp(-at * drive.thrust_delay)
        if np.isfinite(drive.omega_current):
            lag = lag * drive.omega_current / (at + drive.omega_current)
        if sample_rate_hz:
            lag = lag * -np.expm1(-at / sample_rate_hz) / (at / sample_rate_hz)
        total += _positions(drive, at, np.array([1.0, 0.0])) * lag[:, None]
    return total


def _feedback(
    drive: NominalFeedDrive, control: NominalControl, s: Complexes, sample_rate_hz: float | None
) -> Complexes:
    """Return what motor and stage position, as seen, command of thrust (N/m), shape (k, 2)."""
    m_r, c_r, m_t, c_t = drive.rotor_mass, drive.rotor_viscosity, drive.stage_mass, drive.stage_damping
    g = control.disturbance_bandwidth
    low = g / (s + g)
    rate = s if sample_rate_hz is None else 2.0 * sample_rate_hz * np.tanh(0.5 * s / sample_rate_hz)  # bilinear
    slope = rate * control.derivative_bandwidth / (rate + control.derivative_bandwidth)
    total = m_r + m_t
    motor = -total * control.velocity_gain * slope + (low * (g * m_r - c_r) - g * m_r) * slope
    stage = -total * control.velocity_gain * control.position_gain + (low * (g * m_t - c_t) - g * m_t) * slope
    return (np.stack([motor, stage], axis=1) / (1.0 - low)[:, None]).astype(np.complex128)
