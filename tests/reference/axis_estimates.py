"""The simplest force estimates of one axis in plain NumPy, to judge load cases: thrust, DOB and MEDOB.

Positions by second and first difference about the sample before the last, the thrust of an ideal current loop by its
mean over the two samples that these differences span; one low-pass on the sum. No dead times.
"""

import numpy as np
from scipy.signal import butter, sosfilt


def difference_force(x, mass, damping, rate):
    """mass x'' + damping x' one sample late."""
    y = np.zeros_like(x)
    y[2:] = mass * (x[2:] - 2.0 * x[1:-1] + x[:-2]) * rate**2 + damping * (x[2:] - x[:-2]) * rate / 2.0
    return y


def before(x, samples=1):
    return np.concatenate([np.full(samples, x[0]), x[:-samples]])


def estimates(block, motor_mass, motor_damping, stage_mass, stage_damping, rate, mass_error=1.0):
    """Name -> estimate and its lag in samples, before the low-pass."""
    u, xm, xt = block.thrust, block.motor_position, block.stage_position
    held = 0.5 * (before(u, 1) + before(u, 2))
    both = difference_force(xm, motor_mass + stage_mass, motor_damping + stage_damping, rate)
    motor = difference_force(xm, motor_mass, motor_damping, rate)
    stage = difference_force(xt, mass_error * stage_mass, stage_damping, rate)
    return {"thrust": (u, 0), "dob": (held - both, 1), "medob": (held - motor - stage, 1)}


def error_ratio(estimate, lag, force, rate, first, cutoff_hz=1000.0):
    """std(error) over std(force), both through a Butterworth of fourth order, from sample `first` on."""
    low = butter(4, cutoff_hz, fs=rate, output="sos")
    reference = sosfilt(low, before(force, lag) if lag else force)
    error = sosfilt(low, estimate) - reference
    return float(error[first:].std() / reference[first:].std())
