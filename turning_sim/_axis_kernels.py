"""Compiled inner loop of one servo axis.

Symbols, all SI:

======  ===============================================================  =======================
symbol  meaning                                                          origin
======  ===============================================================  =======================
h       sub-step, over which thrust, load and friction are held (s)      `AxisDrive.transition`
z       deflection of the bristles, half a sub-step behind (m)           LuGre
g       friction of steady sliding at the momentary speed (N)            Stribeck
======  ===============================================================  =======================

The bristles bend half a sub-step out of step with the masses (leapfrog): second order, and like every symplectic step
it neither feeds nor eats the energy of the presliding spring. Dry friction is the force that ends the sub-step at rest,
if that is within the limit, and the limit else.
"""

from __future__ import annotations

import math
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numba import njit

from turning_sim._kernels import quantise, servo

THRUST, MOTOR, STAGE, FORCE, TRUE_MOTOR, TRUE_STAGE, MOTOR_FRICTION, STAGE_FRICTION, SCREW, TRUE_SCREW = range(10)
CHANNELS = 10
COMMAND, X_MOTOR, V_MOTOR, X_STAGE, V_STAGE, X_SCREW, V_SCREW = range(7)
RING_CHANNELS = 7
DEFLECTION, SPEED_BEFORE, RUBBING = range(3)
STICKS, BRISTLES = 1, 2


class Status(IntEnum):
    """What the kernel has to say about its block."""

    OK = 0
    DIVERGED = 1


class Axis(NamedTuple):
    """The numbers of the drive that its exact step does not hold; delays in sub-steps, that of the thrust whole.

    What that leaves of a sub-step is in the exact step: the older command acts first, then the newer.
    """

    h: float
    substeps: int
    thrust_delay: int
    motor_delay: float
    stage_delay: float
    screw_delay: float
    screw_step: float
    screw_encoder: bool
    load: float
    closed: bool
    stage_encoder: bool
    far: float


class Rub(NamedTuple):
    """Friction of one side; `rise` is static over Coulomb, `grip` what a unit of it changes of the end velocity."""

    kind: int
    coulomb: float
    rise: float
    stribeck_velocity: float
    exponent: float
    viscous: float
    stiffness: float
    damping: float
    grip: float


@njit(cache=True, fastmath=False, forceinline=True)
def sliding(rub, speed):
    """Return the magnitude of steady friction without its viscous part."""
    if rub.rise == 0.0:
        return rub.coulomb
    r = speed / rub.stribeck_velocity
    if rub.exponent == 2.0:
        return rub.coulomb + rub.rise * math.exp(-r * r)
    if rub.exponent == 1.0:
        return rub.coulomb + rub.rise * math.exp(-r)
    return rub.coulomb + rub.rise * math.exp(-(r**rub.exponent))


@njit(cache=True, fastmath=False)
def bristles(rub, state, velocity, h):
    """Bend the bristles by one sub-step, exact at constant velocity, and return their force in its middle (LuGre)."""
    speed = abs(velocity)
    g = sliding(rub, speed)
    steady = math.copysign(g / rub.stiffness, velocity)
    z = steady + (state[DEFLECTION] - steady) * math.exp(-rub.stiffness * speed * h / g)
    force = rub.stiffness * z
    if rub.damping > 0.0:
        ahead = 1.5 * velocity - 0.5 * state[SPEED_BEFORE]
        force += rub.damping * (ahead - abs(ahead) * rub.stiffness * z / sliding(rub, abs(ahead)))
    state[DEFLECTION] = z
    state[SPEED_BEFORE] = velocity
    state[RUBBING] = force
    return force


@njit(cache=True, fastmath=False, forceinline=True)
def stick(rub, state, before, after):
    """Return by how much the dry friction held over the sub-step must change; whether the side then ends at rest."""
    needed = state[RUBBING] - after / rub.grip
    limit = sliding(rub, abs(before))
    rests = abs(needed) <= limit
    force = needed if rests else math.copysign(limit, needed)
    change = force - state[RUBBING]
    state[RUBBING] = force
    return change, rests


@njit(cache=True, fastmath=False, forceinline=True)
def delayed(ring, n, delay, channel, h):
    """Return a position as it was `delay` sub-steps before `n`, cubic between sub-steps (Hermite)."""
    mask = ring.shape[0] - 1
    whole = int(delay)
    t = delay - whole
    new = (n - whole) & mask
    if t == 0.0:
        return ring[new, channel]
    old = (n - whole - 1) & mask
    rise = ring[old, channel] - ring[new, channel]
    start = -h * ring[new, channel + 1] - rise
    end = h * ring[old, channel + 1] + rise
    return ring[new, channel] + t * rise + t * (1.0 - t) * ((1.0 - t) * start + t * end)


@njit(cache=True, fastmath=False)
def waves(table, x):
    """Return the sum at position `x` of waves given by amplitude, wave number and phase."""
    total = 0.0
    for i in range(table.shape[0]):
        total += table[i, 0] * math.sin(table[i, 1] * x + table[i, 2])
    return total


@njit(cache=True, fastmath=False, forceinline=True)
def read(ring, n, delay, channel, h, error, noise, resolution):
    """Return what an encoder says of a position."""
    x = delayed(ring, n, delay, channel, h)
    return quantise(x + waves(error, x) + noise, resolution)


@njit(cache=True, fastmath=False, forceinline=True)
def mechanics(g, z, new, u, older, load_motor, load_stage):
    """Advance the linear part by its exact step; `g` and `new` are padded to 8 columns so that the loop vectorises."""
    z0, z1, z2, z3, z4, z5, z6 = z[0], z[1], z[2], z[3], z[4], z[5], z[6]
    for i in range(8):
        left = (g[0, i] * z0 + g[1, i] * z1) + (g[2, i] * z2 + g[3, i] * z3)
        right = (g[4, i] * z4 + g[5, i] * z5) + (g[6, i] * z6 + g[7, i] * u)
        new[i] = (left + right) + ((g[8, i] * load_motor + g[9, i] * load_stage) + g[10, i] * older)


@njit(cache=True, fastmath=False, forceinline=True)
def remember(ring, slot, z):
    """Write positions and velocities into the ring that the dead times read."""
    ring[slot, X_MOTOR], ring[slot, V_MOTOR] = z[0], z[1]
    ring[slot, X_STAGE], ring[slot, V_STAGE] = z[4], z[5]
    ring[slot, X_SCREW], ring[slot, V_SCREW] = z[2], z[3]


@njit(cache=True, fastmath=False)
def steps(axis, motor_rub, stage_rub, g, ripple, u, force, z, new, rub, ring, n):
    """Advance the axis by one servo sample, the command held over it."""
    mask = ring.shape[0] - 1
    for j in range(axis.substeps):
        slot = (n + j) & mask
        ring[slot, COMMAND] = u
        remember(ring, slot, z)
        load_motor, load_stage = rub[0, RUBBING], axis.load + force[j] + rub[1, RUBBING]
        if motor_rub.kind == BRISTLES:
            load_motor = bristles(motor_rub, rub[0], z[1], axis.h)
        if stage_rub.kind == BRISTLES:
            load_stage = axis.load + force[j] + bristles(stage_rub, rub[1], z[5], axis.h)
        if ripple.shape[0] > 0:
            load_motor += waves(ripple, z[0] + 0.5 * axis.h * z[1])
        at = n + j - axis.thrust_delay
        mechanics(g, z, new, ring[at & mask, COMMAND], ring[(at - 1) & mask, COMMAND], load_motor, load_stage)
        if motor_rub.kind == STICKS:
            change, rests = stick(motor_rub, rub[0], z[1], new[1])
            for i in range(8):
                new[i] += g[8, i] * change
            if rests:
                new[1] = 0.0
        if stage_rub.kind == STICKS:
            change, rests = stick(stage_rub, rub[1], z[5], new[5])
            for i in range(8):
                new[i] += g[9, i] * change
            if rests:
                new[5] = 0.0
        for i in range(7):
            z[i] = new[i]


@njit(cache=True, fastmath=False)
def advance(
    axis, control, motor_rub, stage_rub, g, ripple, motor_error, stage_error, command, force, noise, z, rub, law, ring,
    k, last, out,
):  # fmt: skip
    """Advance `command.size` servo samples; the state arrays are updated in place."""
    new = np.empty(8)
    mask = ring.shape[0] - 1
    for i in range(command.size):
        n, first = k[0], i * axis.substeps
        remember(ring, n & mask, z)
        motor = read(ring, n, axis.motor_delay, X_MOTOR, axis.h, motor_error, noise[i, 0], control.motor_step)
        stage = motor
        if axis.stage_encoder:
            stage = read(ring, n, axis.stage_delay, X_STAGE, axis.h, stage_error, noise[i, 1], control.stage_step)
        u = servo(control, law, command[i], motor, stage) if axis.closed else command[i]
        before = last[0] if n > 0 else force[first]
        out[THRUST, i], out[MOTOR, i], out[STAGE, i] = u, motor, stage if axis.stage_encoder else np.nan
        out[FORCE, i] = 0.5 * (before + force[first])
        out[TRUE_MOTOR, i], out[TRUE_STAGE, i] = z[0], z[4]
        out[SCREW, i] = out[TRUE_SCREW, i] = np.nan
        if axis.screw_encoder:
            out[SCREW, i] = quantise(delayed(ring, n, axis.screw_delay, X_SCREW, axis.h), axis.screw_step)
            out[TRUE_SCREW, i] = z[2]
        out[MOTOR_FRICTION, i] = rub[0, RUBBING] + motor_rub.viscous * z[1]
        out[STAGE_FRICTION, i] = rub[1, RUBBING] + stage_rub.viscous * z[5]
        steps(axis, motor_rub, stage_rub, g, ripple, u, force[first : first + axis.substeps], z, new, rub, ring, n)
        last[0] = force[first + axis.substeps - 1]
        k[0] = n + axis.substeps
        if not (abs(z[0]) < axis.far and abs(z[4]) < axis.far):
            return Status.DIVERGED
    return Status.OK
