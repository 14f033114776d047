"""The equation of the usual cut, and what the linear theory says of it."""

import dataclasses
import math

import numpy as np

from pitch import OneModeProcess, rightmost_root
from tests.turning_sim.cases import bar, cut
from turning_sim import DelayEquation, linear_parameters

NOMINAL_CUT, FLANK_SPEED = 40e-6, 40.0 * math.pi * 12.5e-3 * math.tan(math.radians(3.0))


def equation(shift_deg=0.0, **changes):
    usual = DelayEquation.of_cut(linear_parameters(bar(), cut(), 6e-3), 20.0, math.radians(shift_deg))
    return dataclasses.replace(usual, **changes)


def root_of(e):
    """The rightmost root (1/s)."""
    process = OneModeProcess(
        e.modal_mass, e.natural_frequency_hz, e.damping_ratio, e.overlap, e.process_damping
    )  # fmt: skip
    turn = e.delay_1 + e.delay_2
    return rightmost_root(process, e.cutting_stiffness, 1.0 / turn, 2.0 * math.pi * (e.delay_1 - e.delay_2) / turn)


def eigenfunction(root, size=1.0):
    return lambda time: size * np.exp(root * time).real


def misfit(got, wanted):
    return np.abs(got - wanted).max() / np.abs(wanted).max()


def order_of(errors, rates):
    """The order at which errors fall with the rate, fitted."""
    return -np.polyfit(np.log(rates), np.log(errors), 1)[0]
