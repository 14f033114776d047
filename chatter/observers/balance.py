"""Force balances of motor and stage as weights of three taps of every signal.

    E_t = K (x_m - x_t) + C_k (v_m - v_t) - M_t a_t - C_t v_t          = F      (stage)
    E_m = u' - M_r a_m - C_r v_m - K (x_m - x_t) - C_k (v_m - v_t)     = 0      (motor)

Yamada, PhD thesis, Keio University, 2017, chapter 2; of two slides each also feels m_c cos(psi) times the other's
acceleration.
Kernel about the middle sample: S = (1, -2, 1)/T^2 for a, D = (1, 0, -1)/2T for v, W = (1, 10, 1)/12 = level + S T^2/12
for what is not differentiated, so that S against W is -omega^2 to 0.014 % at 612 Hz and 9 kHz.
"""

import numpy as np
from numpy.typing import NDArray

from chatter.observers.linear import Drives

Floats = NDArray[np.float64]

MOTOR, STAGE, THRUST = 0, 1, 2
LEVEL = np.array([1.0, 0.0, 1.0 / 12.0])


def held(omega_current: float, sample_rate_hz: float) -> Floats:
    """Return the weights of a thrust that follows a held command: its mean under the hat about the middle sample.

    That mean is what a second difference of the position sees. The thrust bends at the samples, so (1, 10, 1)/12, right
    for what is smooth, is not right here: where the loop of machine A is lightly damped (174 Hz) and its thrust is 100
    times the force, the exact MEDOB would be 6.6 % wrong. Exact for a dead time of whole samples.

    Parameters
    ----------
    omega_current : float
        Bandwidth of the current loop (rad/s), may be infinite.
    sample_rate_hz : float
        Sampling rate (Hz).
    """
    x = omega_current / sample_rate_hz
    if x < 1e-3:  # the closed forms cancel; the limit is (1, 4, 1)/6
        return np.array([1.0, 0.0, 1.0 / 6.0])
    e = float(np.exp(-x))
    rising = 0.0 if np.isinf(x) else (1.0 - (1.0 + x) * e) / x**2
    falling = 0.0 if np.isinf(x) else (x - 1.0 + e) / x**2
    after = (0.5 - falling) / (1.0 - e)
    before = rising - e * (0.5 - rising) / (1.0 - e)
    return np.array([1.0, 0.5 * (after - before), 0.5 * (after + before)])


def _slope(rate: float) -> Floats:
    return np.array([0.0, 0.5 * rate, 0.0])


def _curve(rate: float) -> Floats:
    return np.array([0.0, 0.0, rate * rate])


def stage_balance(drives: Drives, sample_rate_hz: float) -> Floats:
    """Return E_t as weights, shape (3 axes, axes, 3).

    Parameters
    ----------
    drives : SingleAxis or NominalTurret
        Nominal drives.
    sample_rate_hz : float
        Sampling rate (Hz).
    """
    axes = len(drives.drives)
    gains = np.zeros((3 * axes, axes, 3))
    for axis, drive in enumerate(drives.drives):
        spring = drive.screw_stiffness * LEVEL + drive.screw_damping * _slope(sample_rate_hz)
        gains[axis, axis] = spring
        gains[axes + axis, axis] = -spring - drive.stage_damping * _slope(sample_rate_hz)
        gains[axes + axis, axis] -= drive.stage_mass * _curve(sample_rate_hz)
        for other in range(axes):
            if other != axis:
                gains[axes + other, axis] = -drives.cross_mass * _curve(sample_rate_hz)
    return gains


def motor_balance(drives: Drives, sample_rate_hz: float) -> Floats:
    """Return E_m as weights, shape (3 axes, axes, 3).

    Parameters
    ----------
    drives : SingleAxis or NominalTurret
        Nominal drives.
    sample_rate_hz : float
        Sampling rate (Hz).
    """
    axes = len(drives.drives)
    gains = np.zeros((3 * axes, axes, 3))
    for axis, drive in enumerate(drives.drives):
        spring = drive.screw_stiffness * LEVEL + drive.screw_damping * _slope(sample_rate_hz)
        gains[axis, axis] = -spring - drive.rotor_mass * _curve(sample_rate_hz)
        gains[axis, axis] -= drive.rotor_viscosity * _slope(sample_rate_hz)
        gains[axes + axis, axis] = spring
        gains[2 * axes + axis, axis] = held(drive.omega_current, sample_rate_hz)
    return gains


def rigid_balance(drives: Drives, sample_rate_hz: float) -> Floats:
    """Return u' - (A_r + A_t) x_m, the disturbance of a drive taken as rigid, as weights, shape (3 axes, axes, 3).

    Parameters
    ----------
    drives : SingleAxis or NominalTurret
        Nominal drives.
    sample_rate_hz : float
        Sampling rate (Hz).
    """
    axes = len(drives.drives)
    gains = np.zeros((3 * axes, axes, 3))
    for axis, drive in enumerate(drives.drives):
        gains[axis, axis] = -(drive.rotor_mass + drive.stage_mass) * _curve(sample_rate_hz)
        gains[axis, axis] -= (drive.rotor_viscosity + drive.stage_damping) * _slope(sample_rate_hz)
        gains[2 * axes + axis, axis] = held(drive.omega_current, sample_rate_hz)
        for other in range(axes):
            if other != axis:
                gains[other, axis] = -drives.cross_mass * _curve(sample_rate_hz)
    return gains


def thrust_itself(drives: Drives) -> Floats:
    """Return u as weights, shape (3 axes, axes, 3).

    Parameters
    ----------
    drives : SingleAxis or NominalTurret
        Nominal drives.
    """
    axes = len(drives.drives)
    gains = np.zeros((3 * axes, axes, 3))
    for axis in range(axes):
        gains[2 * axes + axis, axis, 0] = 1.0
    return gains
