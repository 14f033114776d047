"""How a force shows in the thrust of a position loop: the nominal drive and its control as one small linear model.

Each dead time is a Pade approximation of second order.
"""

import numpy as np
from numpy.typing import NDArray

from chatter.observers.kalman import ForceModel
from chatter.observers.nominal import NominalFeedDrive
from chatter.observers.stage_model import NominalControl

Floats = NDArray[np.float64]

X_M, V_M, X_T, V_T, U, SLOW_M, SLOW_T, CANCELLED, LATE_M, LATE_T, LATE_U, SIZE = 0, 1, 2, 3, 4, 5, 6, 7, 8, 10, 12, 14


def loop_model(drive: NominalFeedDrive, control: NominalControl) -> ForceModel:
    """Return the response from cutting force to commanded thrust.

    Parameters
    ----------
    drive : NominalFeedDrive
        Nominal drive.
    control : NominalControl
        The loop around it; thesis, section 4.1.
    """
    a = np.zeros((SIZE, SIZE))
    a[X_M, V_M] = a[X_T, V_T] = 1.0
    spring = np.zeros(SIZE)
    spring[[X_M, V_M, X_T, V_T]] = [
        drive.screw_stiffness, drive.screw_damping, -drive.screw_stiffness, -drive.screw_damping
    ]  # fmt: skip
    a[V_M], a[V_T] = -spring / drive.rotor_mass, spring / drive.stage_mass
    a[V_M, V_M] -= drive.rotor_viscosity / drive.rotor_mass
    a[V_T, V_T] -= drive.stage_damping / drive.stage_mass
    b = np.zeros(SIZE)
    b[V_T] = -1.0 / drive.stage_mass
    motor = _delayed(a, np.eye(SIZE)[X_M], drive.motor_delay, LATE_M)
    stage = _delayed(a, np.eye(SIZE)[X_T], drive.stage_delay, LATE_T)
    command = _command(a, drive, control, motor, stage)
    push = _delayed(a, command, drive.thrust_delay, LATE_U)
    keep = np.ones(SIZE, dtype=bool)
    keep[CANCELLED] = control.disturbance_bandwidth > 0.0
    for state, dead in ((LATE_M, drive.motor_delay), (LATE_T, drive.stage_delay), (LATE_U, drive.thrust_delay)):
        keep[state : state + 2] = dead > 0.0
    if np.isfinite(drive.omega_current):
        a[U] = drive.omega_current * push
        a[U, U] -= drive.omega_current
        a[V_M, U] = 1.0 / drive.rotor_mass
    else:
        a[V_M] += push / drive.rotor_mass
        keep[U] = False
    return ForceModel(a=a[np.ix_(keep, keep)], b=b[keep], c=command[keep])


def _delayed(a: Floats, signal: Floats, dead: float, state: int) -> Floats:
    """Return a signal later by a dead time, as a row over the states; two states are written into the dynamics."""
    if dead == 0.0:
        return signal
    a[state, state + 1] = 1.0
    a[state + 1] = 12.0 / dead**2 * signal
    a[state + 1, state] -= 12.0 / dead**2
    a[state + 1, state + 1] -= 6.0 / dead
    late = signal.copy()
    late[state + 1] -= dead
    return late


def _command(a: Floats, drive: NominalFeedDrive, control: NominalControl, motor: Floats, stage: Floats) -> Floats:
    """Return the commanded thrust as a row over the states; those of the control are written into the dynamics."""
    g, unit = control.derivative_bandwidth, np.eye(SIZE)
    a[SLOW_M], a[SLOW_T] = g * (motor - unit[SLOW_M]), g * (stage - unit[SLOW_T])  # pseudo-derivatives of both
    total = drive.rotor_mass + drive.stage_mass
    momentum = control.disturbance_bandwidth * (drive.rotor_mass * a[SLOW_M] + drive.stage_mass * a[SLOW_T])
    pull = -total * control.velocity_gain * (a[SLOW_M] + control.position_gain * stage)
    rub = drive.rotor_viscosity * a[SLOW_M] + drive.stage_damping * a[SLOW_T]
    a[CANCELLED] = control.disturbance_bandwidth * (pull - rub)
    return pull - momentum + unit[CANCELLED]
