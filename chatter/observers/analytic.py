"""The published laws as transfer functions, without sampling: what the sampled observers are checked against.

With A_r = M_r s^2 + C_r s, A_t = M_t s^2 + C_t s on an ideal current loop and without dead times:

    dob        u - (A_r + A_t) x_m
    medob      u - A_r x_m - A_t x_t
    vibration  alpha (M_vib s^2 + C_vib s + K_vib) x_vib - alpha u     x_vib = alpha/(1 + alpha) (x_m - x_t)
    load_side  (C_k s + K) (x_m - x_t) - A_t x_t

Yamada, PhD thesis, Keio University, 2017, eq. (2-18), (2-21), (2-44) and appendix B.
"""

from dataclasses import replace
from math import inf

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chatter.observers.nominal import NominalFeedDrive
from chatter.observers.stage_model import NominalControl, sensed

Complexes = NDArray[np.complex128]

LAWS = ("dob", "medob", "vibration", "load_side")


def _s(frequency_hz: ArrayLike) -> Complexes:
    hz = np.atleast_1d(np.asarray(frequency_hz, dtype=np.float64))
    return (2j * np.pi * hz).astype(np.complex128)


def law(name: str, drive: NominalFeedDrive, frequency_hz: ArrayLike) -> Complexes:
    """Return the weights of motor position (N/m), stage position (N/m) and thrust in a law, shape (k, 3).

    Parameters
    ----------
    name : str
        One of `LAWS`.
    drive : NominalFeedDrive
        What is believed of the drive.
    frequency_hz : array_like, shape (k,)
        Frequencies (Hz).
    """
    if name not in LAWS:
        raise ValueError(f"name must be one of {', '.join(LAWS)}, got {name!r}")
    s, alpha = _s(frequency_hz), drive.mass_ratio
    motor = drive.rotor_mass * s**2 + drive.rotor_viscosity * s
    stage = drive.stage_mass * s**2 + drive.stage_damping * s
    one, none = np.ones_like(s), np.zeros_like(s)
    if name == "dob":
        columns = [-(motor + stage), none, one]
    elif name == "medob":
        columns = [-motor, -stage, one]
    elif name == "load_side":
        spring = drive.screw_damping * s + drive.screw_stiffness
        columns = [spring, -spring - stage, none]
    else:
        stretch = 1.0 + 1.0 / alpha
        damping = drive.rotor_viscosity + drive.stage_damping / alpha**2 + stretch**2 * drive.screw_damping
        modal = stretch * drive.rotor_mass * s**2 + damping * s + stretch**2 * drive.screw_stiffness
        modal = modal * alpha / stretch
        columns = [modal, -modal, -alpha * one]
    return np.stack(columns, axis=1)


def analytic_response(
    name: str, believed: NominalFeedDrive, drive: NominalFeedDrive, frequency_hz: ArrayLike,
    control: NominalControl | None = None,
) -> Complexes:  # fmt: skip
    """Return estimate over true force without low-pass, lags and sampling, shape (k,).

    Parameters
    ----------
    name : str
        One of `LAWS`.
    believed, drive : NominalFeedDrive
        What the law takes the drive for, and the drive; its lags are left out.
    frequency_hz : array_like, shape (k,)
        Frequencies (Hz).
    control : NominalControl or None
        The loop around the drive; None when nothing drives it.
    """
    at_once = replace(drive, motor_delay=0.0, stage_delay=0.0, thrust_delay=0.0, omega_current=inf)
    seen = sensed(at_once, frequency_hz, control=control)
    return (law(name, believed, frequency_hz) * seen).sum(axis=1)


def rigid_response(drive: NominalFeedDrive, frequency_hz: ArrayLike, *, as_printed: bool = False) -> Complexes:
    """Return what a disturbance observer makes of a force when nothing drives the axis, eq. (2-19), shape (k,).

    The print has omega_s instead of (alpha + 1) omega_t in the first coefficient.

    Parameters
    ----------
    drive : NominalFeedDrive
        The drive.
    frequency_hz : array_like, shape (k,)
        Frequencies (Hz).
    as_printed : bool
        With that misprint.
    """
    s, a = _s(frequency_hz), drive.mass_ratio
    w, r, k, t = _ratios(drive)
    first = 2.0 * k * w * (np.sqrt(1.0 + a) if as_printed else 1.0 + a)
    middle = 4.0 * a * k * (r + t) * w**2 + (1.0 + a) * w**2
    return (first * s**2 + middle * s + 2.0 * a * (r + t) * w**3) / _denominator(drive, s)


def mass_error_response(
    drive: NominalFeedDrive, frequency_hz: ArrayLike, believed_over_true: float, *, as_printed: bool = False
) -> Complexes:
    """Return what MEDOB with a wrong mass makes of a force when nothing drives the axis, eq. (B-5), shape (k,).

    The print lacks the mass error in the damping of the motor side.

    Parameters
    ----------
    drive : NominalFeedDrive
        The drive.
    frequency_hz : array_like, shape (k,)
        Frequencies (Hz).
    believed_over_true : float
        Q, nominal over true mass of the stage.
    as_printed : bool
        With that misprint.
    """
    s, a, q = _s(frequency_hz), drive.mass_ratio, believed_over_true
    w, r, k, t = _ratios(drive)
    second = 2.0 * w * ((1.0 if as_printed else q) * a * r + (q * a + 1.0) * k + t)
    first = w**2 * (4.0 * a * (t * r + k * t + r * k) + q * a + 1.0)
    return (q * s**3 + second * s**2 + first * s + 2.0 * a * (r + t) * w**3) / _denominator(drive, s)


def _ratios(drive: NominalFeedDrive) -> tuple[float, float, float, float]:
    """Return omega_t (rad/s), zeta_r, zeta_k, zeta_t of eq. (2-6)."""
    omega = float(np.sqrt(drive.screw_stiffness / drive.stage_mass))
    scale = 2.0 * omega * drive.stage_mass
    return omega, drive.rotor_viscosity / scale, drive.screw_damping / scale, drive.stage_damping / scale


def _denominator(drive: NominalFeedDrive, s: Complexes) -> Complexes:
    """Return D(s) of eq. (2-5)."""
    a, (w, r, k, t) = drive.mass_ratio, _ratios(drive)
    second = 2.0 * w * (a * r + (a + 1.0) * k + t)
    first = (1.0 + a) * w**2 + 4.0 * a * (r * t + r * k + t * k) * w**2
    return s**3 + second * s**2 + first * s + 2.0 * a * (r + t) * w**3
