"""Compiled inner loop of the plant: one call advances a whole block of servo samples.

Symbols, all SI:

======  =========================================================  =========
symbol  meaning                                                    origin
======  =========================================================  =========
h       fixed time step of bar, drives and surface (s)             54 kHz
p1, p2  penetration of each tool, deeper is positive (m)           model, 4
r       what a tool left, relative to its nominal cut (m)          model, 4
u1, u2  material phase under each tool (rad)                       below
D       change of depth (m)                                        model, 4
mu      overlap factor                                             model, 1
V       surface speed (m/s)                                        model, 4
======  =========================================================  =========

A tool at polar position ``beta`` (measured along the surface motion) meets the material point ``beta - theta``. Tool 1
sits at ``h``, tool 2 half a turn behind it, so with the phases ``u1 = theta - h`` and ``u2 = theta`` each tool reads
what the other wrote at its own phase minus pi, whatever the shift and the speed did in between.
"""

from __future__ import annotations

import math
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numba import njit

RING, SURFACE = 256, 16384
PASSES = 3

X1_THRUST, X1_MOTOR, X1_STAGE, Y1_THRUST, Y1_MOTOR, Y1_STAGE = 0, 1, 2, 3, 4, 5
BAR, VIBRATION, FORCE_X1, FORCE_Y1P, FORCE_X2 = 6, 7, 8, 9, 10
CONTACT1, CONTACT2, ANGLE, POSITION, IN_CUT = 11, 12, 13, 14, 15
LEFT1, LEFT2, PHASE1, PHASE2 = 16, 17, 18, 19
CHANNELS = 20

THETA, THETA_ENTRY, FR1, FR2, QX, QY, BRISTLE_X, BRISTLE_Y = range(8)
STEP, READ1, READ2, WAS_IN_CUT = 0, 1, 2, 3


class Status(IntEnum):
    """What a kernel has to say about its block."""

    OK = 0
    DIVERGED = 1
    SURFACE_MEMORY = 2
    BEYOND_MAP = 3


class Plant(NamedTuple):
    """The numbers the kernel needs, in SI units."""

    h: float
    substeps: int
    entry_step: int
    start: float
    stop: float
    feed: float
    radius: float
    stiffness: float
    tangential_ratio: float
    mu: float
    cp: float
    flank_factor: float
    tan_clearance: float
    rake: float
    force: float
    tangential_force: float
    setting: float
    cos_psi: float
    sin_psi: float
    thrust_delay: float
    motor_delay: float
    stage_delay: float
    friction_x: float
    friction_y: float
    presliding_x: float
    presliding_y: float
    table_step: float
    max_amplitude: float


class Control(NamedTuple):
    """One axis' control law and encoders."""

    inertia: float
    motor_mass: float
    stage_mass: float
    motor_damping: float
    stage_damping: float
    kp: float
    kv: float
    dis_gain: float
    g_dis: float
    der_b: float
    der_a: float
    rate: float
    motor_step: float
    stage_step: float


@njit(cache=True, fastmath=False)
def quantise(x, q):
    """Return the encoder reading of a position; no step means no quantisation."""
    if q <= 0.0:
        return x
    return math.floor(x / q + 0.5) * q


@njit(cache=True, fastmath=False, forceinline=True)
def delayed(ring, n, delay, channel):
    """Read a ring `delay` steps back, linear between steps."""
    whole = int(delay)
    part = delay - whole
    a = ring[(n - whole) & (RING - 1), channel]
    if part == 0.0:
        return a
    return a + part * (ring[(n - whole - 1) & (RING - 1), channel] - a)


@njit(cache=True, fastmath=False)
def servo(c, s, ref, xm, xt):
    """Return the commanded thrust of one axis; `s` holds its filters (order as below)."""
    # s: xm, xt, vm, vt, observer low-pass, thrust, last reference, the one before
    s[2] = c.der_a * s[2] + c.der_b * (xm - s[0])
    s[3] = c.der_a * s[3] + c.der_b * (xt - s[1])
    s[0] = xm
    s[1] = xt
    momentum = c.g_dis * (c.motor_mass * s[2] + c.stage_mass * s[3])
    s[4] += c.dis_gain * (s[5] + momentum - c.motor_damping * s[2] - c.stage_damping * s[3] - s[4])
    velocity = (ref - s[6]) * c.rate
    acceleration = (ref - 2.0 * s[6] + s[7]) * c.rate * c.rate
    s[7] = s[6]
    s[6] = ref
    s[5] = c.inertia * (c.kv * (c.kp * (ref - xt) + velocity - s[2]) + acceleration) + s[4] - momentum
    return s[5]


@njit(cache=True, fastmath=False, forceinline=True)
def bristle(z, velocity, friction, stiffness, h):
    """Return the deflection of the presliding spring after a step (Dahl), exact at constant velocity."""
    if friction == 0.0:
        return 0.0
    steady = math.copysign(friction / stiffness, velocity)
    return steady + (z - steady) * math.exp(-stiffness * abs(velocity) * h / friction)


@njit(cache=True, fastmath=False, forceinline=True)
def drive_step(g, z, new, u0, u1, u2, u3, u4, u5, u6, u7):
    """Advance both axes by their exact step; `g` and `new` are padded to 16 columns so that the loop vectorises."""
    z0, z1, z2, z3, z4, z5, z6, z7, z8, z9 = z[0], z[1], z[2], z[3], z[4], z[5], z[6], z[7], z[8], z[9]
    for i in range(g.shape[1]):
        x1 = ((g[0, i] * z0 + g[1, i] * z1) + (g[2, i] * z2 + g[3, i] * z3)) + g[4, i] * z4
        y1 = ((g[5, i] * z5 + g[6, i] * z6) + (g[7, i] * z7 + g[8, i] * z8)) + g[9, i] * z9
        loads = (g[12, i] * u2 + g[13, i] * u3) + (g[14, i] * u4 + g[15, i] * u5)
        new[i] = (x1 + y1) + loads + ((g[10, i] * u0 + g[11, i] * u1) + (g[16, i] * u6 + g[17, i] * u7))
    for i in range(10):
        z[i] = new[i]


@njit(cache=True, fastmath=False)
def modal_step(omega, zeta, h, out):
    """Fill `out` with the exact step of a unit-mass mode, force linear over the step.

    Rows are displacement and velocity, columns displacement, velocity, force at the start, force at the end.
    """
    sigma = zeta * omega
    wd = omega * math.sqrt(1.0 - zeta * zeta)
    e = math.exp(-sigma * h)
    c = e * math.cos(wd * h)
    s = e * math.sin(wd * h) / wd
    k = omega * omega
    out[0, 0] = c + sigma * s
    out[0, 1] = s
    out[1, 0] = -k * s
    out[1, 1] = c - sigma * s
    # particular solution a + b t for a unit force and for a unit slope
    ramp = 1.0 / (k * h)
    lag = -2.0 * zeta / omega * ramp
    end0 = lag + 1.0 / k - (out[0, 0] * lag + out[0, 1] * ramp)
    end1 = ramp - (out[1, 0] * lag + out[1, 1] * ramp)
    out[0, 3] = end0
    out[1, 3] = end1
    out[0, 2] = (1.0 - out[0, 0]) / k - end0
    out[1, 2] = -out[1, 0] / k - end1


@njit(cache=True, fastmath=False, forceinline=True)
def read_surface(phase, left, ptr, target):
    """Return (value, pointer) of a history at a phase, 4-point Lagrange on its own nodes."""
    mask = SURFACE - 1
    while phase[(ptr + 1) & mask] <= target:
        ptr += 1
    while phase[ptr & mask] > target:
        ptr -= 1
    i0, i1, i2, i3 = (ptr - 1) & mask, ptr & mask, (ptr + 1) & mask, (ptr + 2) & mask
    a, b, c, d = phase[i0], phase[i1], phase[i2], phase[i3]
    ta, tb, tc, td = target - a, target - b, target - c, target - d
    ab, ac, ad, bc, bd, cd = a - b, a - c, a - d, b - c, b - d, c - d
    value = (
        left[i0] * (tb * tc * td / (ab * ac * ad))
        - left[i1] * (ta * tc * td / (ab * bc * bd))
        + left[i2] * (ta * tb * td / (ac * bc * cd))
        - left[i3] * (ta * tb * tc / (ad * bd * cd))
    )
    return value, ptr


@njit(cache=True, fastmath=False, forceinline=True)
def thrust(plant, velocity, chip, stiffness, limit):
    """Return the radial force of one tool in contact (never pulling)."""
    force = stiffness * chip + plant.cp * velocity
    if velocity > limit:
        force += plant.flank_factor * plant.cp * (velocity - limit)
    return max(force, 0.0)


@njit(cache=True, fastmath=False, forceinline=True)
def remember(ring, n, ux, uy, z):
    """Write thrust commands and positions at step `n` into the ring that the dead times read."""
    slot = n & (RING - 1)
    ring[slot, 0] = ux
    ring[slot, 1] = uy
    ring[slot, 2] = z[0]
    ring[slot, 3] = z[5]
    ring[slot, 4] = z[2]
    ring[slot, 5] = z[7]


@njit(cache=True, fastmath=False)
def control(plant, cx, cy, ring, n, ref_x, ref_y, noise_x, noise_y, servo_x, servo_y, out, i):
    """Read the encoders, command both thrusts, write sample `i` of what the machine sees."""
    xm = quantise(delayed(ring, n, plant.motor_delay, 2), cx.motor_step)
    ym = quantise(delayed(ring, n, plant.motor_delay, 3), cy.motor_step)
    xt = quantise(delayed(ring, n, plant.stage_delay, 4) + noise_x, cx.stage_step)
    yt = quantise(delayed(ring, n, plant.stage_delay, 5) + noise_y, cy.stage_step)
    ux = servo(cx, servo_x, ref_x, xm, xt)
    uy = servo(cy, servo_y, ref_y, ym, yt)
    out[X1_THRUST, i], out[X1_MOTOR, i], out[X1_STAGE, i] = ux, xm, xt
    out[Y1_THRUST, i], out[Y1_MOTOR, i], out[Y1_STAGE, i] = uy, ym, yt
    return ux, uy


@njit(cache=True, fastmath=False)
def see_bar(plant, table, s, phi, step, load):
    """Fill shape, exact step and load factor of each mode for the tools at `s`."""
    row = min(int(s / plant.table_step), table.shape[0] - 2)
    part = s / plant.table_step - row
    for m in range(phi.size):
        phi[m] = table[row, m, 0] + part * (table[row + 1, m, 0] - table[row, m, 0])
        omega = table[row, m, 1] + part * (table[row + 1, m, 1] - table[row, m, 1])
        zeta = table[row, m, 2] + part * (table[row + 1, m, 2] - table[row, m, 2])
        mass = table[row, m, 3] + part * (table[row + 1, m, 3] - table[row, m, 3])
        modal_step(omega, zeta, plant.h, step[m])
        load[m] = phi[m] / mass


@njit(cache=True, fastmath=False)
def truth(plant, z, bar, phi, f, s, in_cut, out, i):
    """Write sample `i` of what no sensor gives."""
    q = 0.0
    for m in range(phi.size):
        q += phi[m] * bar[m, 0]
    rho = math.hypot(plant.radius - z[2] - z[7] * plant.cos_psi, z[7] * plant.sin_psi)
    out[BAR, i] = -q
    out[VIBRATION, i] = -q - (plant.radius - rho)
    out[FORCE_X1, i] = f[QX]
    out[FORCE_Y1P, i] = (plant.cos_psi * f[QX] - f[QY]) / plant.sin_psi
    out[FORCE_X2, i] = f[FR2]
    out[CONTACT1, i], out[CONTACT2, i] = f[FR1] != 0.0, f[FR2] != 0.0
    out[ANGLE, i], out[POSITION, i], out[IN_CUT, i] = f[THETA], s, in_cut


@njit(cache=True, fastmath=False, forceinline=True)
def place_tool(plant, x, vx, y, vy):
    """Return shift, its cosine and sine, how much deeper than the arc tool 1 is and how fast, one step ahead."""
    px = x + plant.h * vx + (y + plant.h * vy) * plant.cos_psi
    py = (y + plant.h * vy) * plant.sin_psi
    across = plant.radius - px
    rho = math.sqrt(across * across + py * py)
    cos_h, sin_h = across / rho, py / rho
    rate = cos_h * (vx + vy * plant.cos_psi) - sin_h * vy * plant.sin_psi
    return math.atan2(py, across), cos_h, sin_h, plant.radius - rho, rate


@njit(cache=True, fastmath=False, forceinline=True)
def tangential(plant, chip, rise):
    """Return the tangential force of tool 1, linear about the steady cut."""
    if chip <= 0.0:
        return 0.0
    steady = plant.force / plant.stiffness
    return max(rise * (plant.tangential_force + plant.tangential_ratio * plant.stiffness * (chip - steady)), 0.0)


@njit(cache=True, fastmath=False)
def feed(plant, f, k, n):
    """Return where the tools are along the bar and whether they cut."""
    if n < plant.entry_step:
        return plant.start, False
    if k[WAS_IN_CUT] == 0:
        f[THETA_ENTRY] = f[THETA]
        k[WAS_IN_CUT] = 1
    s = plant.start + plant.feed * (f[THETA] - f[THETA_ENTRY]) / (2.0 * math.pi)
    return min(s, plant.stop), s < plant.stop


@njit(cache=True, fastmath=False)
def steps(plant, omega, ux, uy, noise, in_cut, drive, phi, step, load, free, new, z, bar, ring, phase, left, f, k):
    """Advance everything by one servo sample; the thrust commands are held over it."""
    phase1, phase2, left1, left2 = phase[0], phase[1], left[0], left[1]
    modes, h0 = phi.size, plant.force / plant.stiffness
    limit = omega * plant.radius * plant.tan_clearance
    n, read1, read2, theta = k[STEP], k[READ1], k[READ2], f[THETA]
    fr1, fr2, qx0, qy0 = f[FR1], f[FR2], f[QX], f[QY]
    for j in range(plant.substeps):
        # the drives and the spindle take tool 1 to its place on the material
        remember(ring, n, ux, uy, z)
        shift, cos_h, sin_h, deeper, rate = place_tool(plant, z[2], z[3], z[7], z[8])
        theta += omega * plant.h
        u1, u2 = theta - shift, theta
        r1, read1 = read_surface(phase1, left1, read1, u2 - math.pi)
        r2, read2 = read_surface(phase2, left2, read2, u1 - math.pi)
        rise = 1.0 + plant.rake * shift
        base1 = h0 + deeper - plant.mu * r2
        base2 = h0 + plant.setting - plant.mu * r1
        noise1, noise2 = noise[j, 0], noise[j, 1]
        # the bar: what the forces so far do to it, then the forces at the end of the step, by correction
        chip1 = chip2 = 0.0
        for m in range(modes):
            for a in range(2):
                carried = step[m, a, 0] * bar[m, 0] + step[m, a, 1] * bar[m, 1]
                free[m, a] = carried + step[m, a, 2] * load[m] * (fr2 - fr1)
        for _ in range(PASSES):
            q = qd = 0.0
            for m in range(modes):
                q += phi[m] * (free[m, 0] + step[m, 0, 3] * load[m] * (fr2 - fr1))
                qd += phi[m] * (free[m, 1] + step[m, 1, 3] * load[m] * (fr2 - fr1))
            fr1 = fr2 = 0.0
            if in_cut:
                chip1, chip2 = base1 + q, base2 - q
                if chip1 > 0.0:
                    fr1 = thrust(plant, qd + rate, chip1, rise * plant.stiffness, limit) + noise1
                if chip2 > 0.0:
                    fr2 = thrust(plant, -qd, chip2, plant.stiffness, limit) + noise2
        for m in range(modes):
            for a in range(2):
                bar[m, a] = free[m, a] + step[m, a, 3] * load[m] * (fr2 - fr1)
        # what the tools leave: one that lost contact leaves the old surface, a nominal cut thicker for the next
        slot = n & (SURFACE - 1)
        phase1[slot], phase2[slot] = u1, u2
        left1[slot] = plant.mu * r2 + max(chip1, 0.0) - h0 if in_cut else 0.0
        left2[slot] = plant.mu * r1 + max(chip2, 0.0) - h0 if in_cut else 0.0
        # the drives, load linear over the step
        along = tangential(plant, chip1, rise)
        qx = fr1 * cos_h - along * sin_h
        qy = qx * plant.cos_psi - (fr1 * sin_h + along * cos_h) * plant.sin_psi
        f[BRISTLE_X] = bristle(f[BRISTLE_X], z[1], plant.friction_x, plant.presliding_x, plant.h)
        f[BRISTLE_Y] = bristle(f[BRISTLE_Y], z[6], plant.friction_y, plant.presliding_y, plant.h)
        vx, vy = delayed(ring, n, plant.thrust_delay, 0), delayed(ring, n, plant.thrust_delay, 1)
        rub_x, rub_y = plant.presliding_x * f[BRISTLE_X], plant.presliding_y * f[BRISTLE_Y]
        drive_step(drive, z, new, vx, vy, qx0, qy0, qx, qy, rub_x, rub_y)
        qx0, qy0 = qx, qy
        n += 1
    k[STEP], k[READ1], k[READ2], f[THETA] = n, read1, read2, theta
    f[FR1], f[FR2], f[QX], f[QY] = fr1, fr2, qx0, qy0


@njit(cache=True, fastmath=False)
def advance(
    plant, cx, cy, drive, table, refs, omega, noise, scale, z, bar, servo_x, servo_y, ring, phase, left, f, k, out
):
    """Advance `refs.shape[1]` servo samples; the state arrays are updated in place."""
    modes = bar.shape[0]
    step, free, load, phi = np.empty((modes, 2, 4)), np.empty((modes, 2)), np.empty(modes), np.empty(modes)
    new = np.empty(drive.shape[1])
    for i in range(refs.shape[1]):
        n = k[STEP]
        remember(ring, n, 0.0, 0.0, z)
        ux, uy = control(
            plant, cx, cy, ring, n, refs[0, i], refs[1, i], scale[i, 0], scale[i, 1], servo_x, servo_y, out, i
        )
        s, in_cut = feed(plant, f, k, n)
        see_bar(plant, table, s, phi, step, load)
        truth(plant, z, bar, phi, f, s, in_cut, out, i)
        last = (n - 1) & (SURFACE - 1)
        out[LEFT1, i], out[LEFT2, i] = left[0, last], left[1, last]
        out[PHASE1, i], out[PHASE2, i] = phase[0, last], phase[1, last]
        drawn = noise[i * plant.substeps : (i + 1) * plant.substeps]
        steps(
            plant, omega[i], ux, uy, drawn, in_cut, drive, phi, step, load, free, new, z, bar, ring, phase, left, f, k
        )
        if not (abs(bar[0, 0]) < plant.max_amplitude and abs(bar[modes - 1, 0]) < plant.max_amplitude):
            return Status.DIVERGED
        if k[STEP] - min(k[READ1], k[READ2]) > SURFACE - 8:
            return Status.SURFACE_MEMORY
    return Status.OK
