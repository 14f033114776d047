"""Compiled inner loop of a bar that bends in two directions, its cut linear or by the surface map.

Symbols as in `_kernels.py`; besides:

======  =====================================================================  =========
symbol  meaning                                                                origin
======  =====================================================================  =========
x, y    displacement of the bar at the tools, along -X1 and along +Y1' (m)     model, 3
e, w    radial direction and surface velocity at a tool, in x and y            model, 4
======  =====================================================================  =========

Tool 1 sits at the shift h: e_1 = (cos h, sin h), w_1 = (-sin h, cos h). Tool 2 never moves: e_2 = (-1, 0),
w_2 = (0, -1).
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from turning_sim import _surface_kernels as surface
from turning_sim._kernels import (
    ANGLE,
    BAR,
    BRISTLE_X,
    BRISTLE_Y,
    CONTACT1,
    CONTACT2,
    FORCE_X1,
    FORCE_X2,
    FORCE_Y1P,
    FR1,
    FR2,
    IN_CUT,
    LEFT1,
    LEFT2,
    PASSES,
    PHASE1,
    PHASE2,
    POSITION,
    QX,
    QY,
    READ1,
    READ2,
    STEP,
    THETA,
    VIBRATION,
    Status,
    bristle,
    control,
    delayed,
    drive_step,
    feed,
    place_tool,
    read_surface,
    remember,
    see_bar,
    tangential,
    thrust,
)

BAR_Y = 20
CHANNELS = 21
FX, FY = 8, 9
FORCES = 10
GUARD = 8
MAP_PASSES = 2  # each brings the end force 30 (flank touching) to 600 times closer


@njit(cache=True, fastmath=False)
def unforced(step, load, bar, fx, fy, free):
    """Fill what the bar does in a step under the forces at its start; columns x, vx, y, vy."""
    for m in range(bar.shape[0]):
        for a in range(2):
            held = step[m, a, 2] * load[m]
            free[m, a] = step[m, a, 0] * bar[m, 0] + step[m, a, 1] * bar[m, 1] + held * fx
            free[m, 2 + a] = step[m, a, 0] * bar[m, 2] + step[m, a, 1] * bar[m, 3] + held * fy


@njit(cache=True, fastmath=False)
def at_tools(phi, step, load, free, fx, fy):
    """Return displacement and velocity of the bar at the tools under the forces at the end of the step."""
    x = vx = y = vy = 0.0
    for m in range(phi.size):
        move, speed = step[m, 0, 3] * load[m], step[m, 1, 3] * load[m]
        x += phi[m] * (free[m, 0] + move * fx)
        vx += phi[m] * (free[m, 1] + speed * fx)
        y += phi[m] * (free[m, 2] + move * fy)
        vy += phi[m] * (free[m, 3] + speed * fy)
    return x, vx, y, vy


@njit(cache=True, fastmath=False)
def linear_cut(plant, chip, velocity, rise, noise, limit):
    """Return the radial and the tangential force of a tool, linear about the steady cut."""
    if chip <= 0.0:
        return 0.0, 0.0
    radial = thrust(plant, velocity, chip, rise * plant.stiffness, limit) + noise
    return radial, tangential(plant, chip, rise)


@njit(cache=True, fastmath=False)
def surface_cut(plant, grid, tool, chip, extra, p, before, velocity, rise, noise, limit, out):
    """Return the radial and the tangential force of a tool on the surface that it meets."""
    surface.engaged(grid, tool, chip, extra, p, out)
    if grid.depth + max(p, before) > grid.flank and out[surface.AREA] > 0.0:
        surface.lean_over(grid, p, before, out)
    radial, along = surface.chip_forces(grid, tool, out)
    if along == 0.0:
        return 0.0, 0.0
    damping = plant.cp * out[surface.LENGTH] / grid.reference_edge
    radial = rise * radial + damping * (velocity + plant.flank_factor * max(velocity - limit, 0.0))
    return max(radial, 0.0) + noise, rise * along


@njit(cache=True, fastmath=False)
def push_drives(plant, drive, z, new, ring, n, qx, qy, f):
    """Advance the drives, load linear over the step."""
    f[BRISTLE_X] = bristle(f[BRISTLE_X], z[1], plant.friction_x, plant.presliding_x, plant.h)
    f[BRISTLE_Y] = bristle(f[BRISTLE_Y], z[6], plant.friction_y, plant.presliding_y, plant.h)
    vx, vy = delayed(ring, n, plant.thrust_delay, 0), delayed(ring, n, plant.thrust_delay, 1)
    rub_x, rub_y = plant.presliding_x * f[BRISTLE_X], plant.presliding_y * f[BRISTLE_Y]
    drive_step(drive, z, new, vx, vy, f[QX], f[QY], qx, qy, rub_x, rub_y)
    f[QX], f[QY] = qx, qy


@njit(cache=True, fastmath=False)
def look_back(grid, mapped, phase, left, columns, k, u1, u2, tool, weight, met):
    """Fill what both tools meet; return the depths left there by tool 1 and by tool 2."""
    old, chip, extra = met
    if not mapped:
        r1, k[READ1] = read_surface(phase[0], left[0], k[READ1], u2 - math.pi)
        r2, k[READ2] = read_surface(phase[1], left[1], k[READ2], u1 - math.pi)
        return r1, r2
    k[READ1] = surface.find(phase[0], k[READ1], u2 - math.pi, weight)
    surface.meet(grid, columns[0], k[READ1], weight, old[1])
    r1 = surface.depth_there(left[0], k[READ1], weight)
    k[READ2] = surface.find(phase[1], k[READ2], u1 - math.pi, weight)
    surface.meet(grid, columns[1], k[READ2], weight, old[0])
    r2 = surface.depth_there(left[1], k[READ2], weight)
    for i in range(2):
        surface.gap(old[i], tool[i], chip[i], extra[i])
    return r1, r2


@njit(cache=True, fastmath=False)
def steps(
    plant, grid, mapped, omega, ux, uy, noise, in_cut, drive, phi, step, load, free, new, tool, met, z, bar, ring,
    phase, left, columns, rest, f, k,
):  # fmt: skip
    """Advance everything by one servo sample; the thrust commands are held over it."""
    old, chip, extra = met
    out, weight, h0, mask = np.empty(surface.ANSWERS), np.empty(4), plant.force / plant.stiffness, phase.shape[1] - 1
    limit = omega * plant.radius * plant.tan_clearance
    for j in range(plant.substeps):
        n = k[STEP]
        remember(ring, n, ux, uy, z)
        shift, c, s, deeper, rate = place_tool(plant, z[2], z[3], z[7], z[8])
        f[THETA] += omega * plant.h
        u1, u2 = f[THETA] - shift, f[THETA]
        r1, r2 = look_back(grid, mapped, phase, left, columns, k, u1, u2, tool, weight, met)
        rise = 1.0 + plant.rake * shift
        noise1, noise2 = noise[j, 0], noise[j, 1]
        unforced(step, load, bar, f[FX], f[FY], free)
        fx, fy, fr1, fr2, ft1, ft2, p1, p2 = f[FX], f[FY], 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for _ in range(MAP_PASSES if mapped else PASSES):
            x, vx, y, vy = at_tools(phi, step, load, free, fx, fy)
            p1, p2, v1 = c * x + s * y + deeper, plant.setting - x, c * vx + s * vy + rate
            if in_cut and mapped:
                fr1, ft1 = surface_cut(plant, grid, tool[0], chip[0], extra[0], p1, r2, v1, rise, noise1, limit, out)
                fr2, ft2 = surface_cut(plant, grid, tool[1], chip[1], extra[1], p2, r1, -vx, 1.0, noise2, limit, out)
            elif in_cut:
                fr1, ft1 = linear_cut(plant, h0 + p1 - plant.mu * r2, v1, rise, noise1, limit)
                fr2, ft2 = linear_cut(plant, h0 + p2 - plant.mu * r1, -vx, 1.0, noise2, limit)
            fx = fr2 - c * fr1 + s * ft1
            fy = ft2 - s * fr1 - c * ft1
        for m in range(phi.size):
            for a in range(2):
                bar[m, a] = free[m, a] + step[m, a, 3] * load[m] * fx
                bar[m, 2 + a] = free[m, 2 + a] + step[m, a, 3] * load[m] * fy
        slot = n & mask
        phase[0, slot], phase[1, slot] = u1, u2
        if mapped:
            surface.leave(old[0], tool[0], p1, in_cut, rest[0], columns[0, slot])
            surface.leave(old[1], tool[1], p2, in_cut, rest[1], columns[1, slot])
            left[0, slot], left[1, slot] = (p1, p2) if in_cut else (0.0, 0.0)
        else:
            left[0, slot] = plant.mu * r2 + max(h0 + p1 - plant.mu * r2, 0.0) - h0 if in_cut else 0.0
            left[1, slot] = plant.mu * r1 + max(h0 + p2 - plant.mu * r1, 0.0) - h0 if in_cut else 0.0
        qx = fr1 * c - ft1 * s
        qy = qx * plant.cos_psi - (fr1 * s + ft1 * c) * plant.sin_psi
        push_drives(plant, drive, z, new, ring, n, qx, qy, f)
        f[FR1], f[FR2], f[FX], f[FY] = fr1, fr2, fx, fy
        k[STEP] = n + 1


@njit(cache=True, fastmath=False)
def truth(plant, z, bar, phi, f, s, in_cut, phase, left, last, out, i):
    """Write sample `i` of what no sensor gives; return the shift of tool 1."""
    x = y = 0.0
    for m in range(phi.size):
        x += phi[m] * bar[m, 0]
        y += phi[m] * bar[m, 2]
    across, along = plant.radius - z[2] - z[7] * plant.cos_psi, z[7] * plant.sin_psi
    out[BAR, i], out[BAR_Y, i] = -x, y
    out[VIBRATION, i] = -x - (plant.radius - math.hypot(across, along))
    out[FORCE_X1, i] = f[QX]
    out[FORCE_Y1P, i] = (plant.cos_psi * f[QX] - f[QY]) / plant.sin_psi
    out[FORCE_X2, i] = f[FR2]
    out[CONTACT1, i], out[CONTACT2, i] = f[FR1] != 0.0, f[FR2] != 0.0
    out[ANGLE, i], out[POSITION, i], out[IN_CUT, i] = f[THETA], s, in_cut
    out[LEFT1, i], out[LEFT2, i] = left[0, last], left[1, last]
    out[PHASE1, i], out[PHASE2, i] = phase[0, last], phase[1, last]
    return math.atan2(along, across)


@njit(cache=True, fastmath=False)
def advance(
    plant, grid, mapped, cx, cy, drive, table, refs, omega, noise, scale, z, bar, servo_x, servo_y, ring, phase, left,
    columns, rest, f, k, out, tails,
):  # fmt: skip
    """Advance `refs.shape[1]` servo samples; the state arrays are updated in place.

    Row `i` of `tails` takes the heights that tool 2 leaves behind for good at sample `i`, a feed of them.
    """
    modes, cells, mask = bar.shape[0], columns.shape[2], phase.shape[1] - 1
    step, free, load, phi = np.empty((modes, 2, 4)), np.empty((modes, 4)), np.empty(modes), np.empty(modes)
    new = np.empty(drive.shape[1])
    tool, met = np.zeros((2, 4, cells)), (np.zeros((2, cells)), np.zeros((2, cells)), np.zeros((2, cells)))
    if mapped:
        surface.tool_profile(grid, 0.0, tool[1])
    for i in range(refs.shape[1]):
        n = k[STEP]
        remember(ring, n, 0.0, 0.0, z)
        ux, uy = control(
            plant, cx, cy, ring, n, refs[0, i], refs[1, i], scale[i, 0], scale[i, 1], servo_x, servo_y, out, i
        )
        s, in_cut = feed(plant, f, k, n)
        see_bar(plant, table, s, phi, step, load)
        last = (n - 1) & mask
        shift = truth(plant, z, bar, phi, f, s, in_cut, phase, left, last, out, i)
        if mapped:
            surface.tool_profile(grid, plant.feed * shift / (2.0 * math.pi), tool[0])
            tails[i] = columns[1, last, : tails.shape[1]]
        drawn = noise[i * plant.substeps : (i + 1) * plant.substeps]
        steps(
            plant, grid, mapped, omega[i], ux, uy, drawn, in_cut, drive, phi, step, load, free, new, tool, met, z,
            bar, ring, phase, left, columns, rest, f, k,
        )  # fmt: skip
        for m in range(modes):
            if not (abs(bar[m, 0]) < plant.max_amplitude and abs(bar[m, 2]) < plant.max_amplitude):
                return Status.DIVERGED
        last = (k[STEP] - 1) & mask
        if mapped and in_cut and max(left[0, last], left[1, last]) > grid.deepest:
            return Status.BEYOND_MAP
        if k[STEP] - min(k[READ1], k[READ2]) > mask + 1 - GUARD:
            return Status.SURFACE_MEMORY
    return Status.OK
