"""The drives that the tests of the single axis share: machines A and B of the thesis, Tables 3-2, 3-3, 4-1 and 4-3."""

import numpy as np

from turning_sim import AxisControl, AxisDrive, ServoAxis

CONTROL_A = AxisControl(
    position_gain=50.0, velocity_gain=200.0, disturbance_bandwidth=1000.0, derivative_bandwidth=5000.0
)
CONTROL_B = AxisControl(
    position_gain=80.0, velocity_gain=320.0, disturbance_bandwidth=1000.0, derivative_bandwidth=3000.0
)


def machine_a(**changes):
    usual = {
        "lead": 5e-3, "motor_inertia": 3.8e-5, "motor_damping": 2.3e-3, "stage_mass": 6.2, "stage_damping": 370.0,
        "drive_stiffness": 25.7e6, "drive_damping": 2500.0, "current_bandwidth": 3000.0, "thrust_delay": 0.35e-3,
        "motor_delay": 0.45e-3, "stage_delay": 0.1e-3, "motor_resolution": 0.0, "stage_resolution": 0.0,
    }  # fmt: skip
    return AxisDrive(**(usual | changes))


def machine_b(**changes):
    own = {
        "motor_inertia": 5.2e-5, "motor_damping": 6.5e-3, "stage_mass": 6.6, "stage_damping": 820.0,
        "drive_stiffness": 40.5e6, "drive_damping": 1800.0, "current_bandwidth": 5000.0, "thrust_delay": 0.2e-3,
        "motor_delay": 0.2e-3, "stage_delay": 0.2e-3,
    }  # fmt: skip
    return machine_a(**(own | changes))


def three_inertias(**changes):
    """60, 20 and 6.6 kg behind a coupling of 3.2520e8 N/m: 366 and 770 Hz (thesis, section 2.6)."""
    ratio = 5e-3 / (2.0 * np.pi)
    own = {
        "motor_inertia": 60.0 * ratio**2, "screw_inertia": 20.0 * ratio**2, "screw_damping": 1e-3, "stage_mass": 6.6,
        "coupling_stiffness": 3.2520e8, "coupling_damping": 3e3, "drive_stiffness": 3.4811e7,
        "screw_resolution": 0.0, "screw_delay": 0.3e-3,
    }  # fmt: skip
    return machine_a(**(own | changes))


def pushed(drive, thrust, force, rate=20e3, substeps=10):
    """Signals of an axis without control under a thrust (n,) and a force given as a function of time."""
    axis = ServoAxis(drive, None, rate, substeps=substeps)
    return axis.advance(np.asarray(thrust, dtype=float), force(axis.force_times(len(thrust))))


def held(drive, control, force, rate=20e3, seconds=1.0, feed=0.0):
    """Signals of a controlled axis at a feed rate (m/s) under a force given as a function of time."""
    axis = ServoAxis(drive, control, rate)
    count = round(rate * seconds)
    return axis.advance(feed * np.arange(count) / rate, force(axis.force_times(count)))
