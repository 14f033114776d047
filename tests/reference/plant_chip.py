"""Chip of a nose-radius tool by brute force: profiles on a grid of 20 nm, crossings and lengths counted."""

import math

import numpy as np

TURN_OVER = math.radians(88.0)


def tool_profile(z, radius, approach):
    """Height of the edge above its tip."""
    limit = min(approach, TURN_OVER)
    end = radius * math.sin(limit)
    inside = np.clip(z, -end, end)
    return radius - np.sqrt(radius**2 - inside**2) + np.abs(z - inside) * math.tan(limit)


def chip_of_passes(depth, spacing, radius, approach, depths, dz=20e-9):
    """Area, edge length and chord direction of the chip; `depths[0]` is the tool now, the others the passes before."""
    front = radius if depth > 0.8 * radius else radius * math.sqrt(1.0 - (1.0 - (depth + 30e-6) / radius) ** 2)
    z = np.arange(-2.0 * spacing, front + 20e-6, dz)
    old = np.full(z.size, depth)
    for k, p in enumerate(depths[1:], start=1):
        old = np.minimum(old, tool_profile(z + k * spacing, radius, approach) - p)
    return chip_between(z, old, tool_profile(z, radius, approach) - depths[0])


def chip_between(z, old, now):
    """The same from two profiles over z; three zeros without a chip."""
    chip, dz = old - now, z[1] - z[0]
    cut = np.flatnonzero(chip > 0.0)
    if cut.size == 0:
        return 0.0, 0.0, 0.0
    ends = []
    for inside, outside in ((cut[0], cut[0] - 1), (cut[-1], cut[-1] + 1)):
        part = chip[inside] / (chip[inside] - chip[outside])
        ends.append((z[inside] + part * (z[outside] - z[inside]), now[inside] + part * (now[outside] - now[inside])))
    (z0, y0), (z1, y1) = ends
    pieces = np.hypot(np.diff(now), dz)
    both = (chip[1:] > 0.0) & (chip[:-1] > 0.0)
    edge = pieces[both].sum()
    # cells cut in part: the share of their length inside
    partly = (chip[1:] > 0.0) != (chip[:-1] > 0.0)
    high, low = np.maximum(chip[1:], chip[:-1])[partly], np.minimum(chip[1:], chip[:-1])[partly]
    edge += (pieces[partly] * high / (high - low)).sum()
    return np.maximum(chip, 0.0).sum() * dz, edge, math.atan2(y1 - y0, z1 - z0)


def forces_of_passes(cutting, depths, steady_direction=None):
    """Radial and tangential force of one tool (N)."""
    area, edge, psi = chip_of_passes(
        cutting.depth_of_cut, cutting.feed_per_rev / 2.0, cutting.nose_radius, cutting.approach_angle, depths
    )
    return forces_of_chip(cutting, area, edge, psi if steady_direction is None else steady_direction)


def forces_of_chip(cutting, area, edge, psi):
    if area == 0.0:
        return 0.0, 0.0
    law, ratio = cutting.force_law, area / edge / 33e-6
    radial = law.thrust_coefficient * area * ratio**-law.thrust_exponent * math.cos(psi)
    return radial, law.tangential_coefficient * area * ratio**-law.tangential_exponent


def dynamic_stiffness(cutting, steady=False, change=0.5e-6):
    """Derivatives of both forces with respect to the present depth and, with the sign turned, the one before (N/m)."""
    rest = [0.0] * 5
    psi = chip_of_passes(
        cutting.depth_of_cut, cutting.feed_per_rev / 2.0, cutting.nose_radius, cutting.approach_angle, rest
    )[2]
    rows = []
    for k, sign in ((0, 1.0), (1, -1.0)):
        up, down = list(rest), list(rest)
        up[k], down[k] = change, -change
        high, low = (np.array(forces_of_passes(cutting, d, psi if steady else None)) for d in (up, down))
        rows.append(sign * (high - low) / (2.0 * change))
    return np.array(rows)
