"""Chip of an edge whose flank may lean over the cut: at each height the stretches along the bar that the tool takes."""

import math

import numpy as np

from tests.reference.plant_chip import forces_of_chip

PASSES = 6


def front(height, radius, approach):
    """How far ahead of its tip the edge is at a height above it; an arc, then a straight flank."""
    nose = radius * (1.0 - math.cos(approach))
    arc = np.sqrt(np.maximum(radius**2 - (radius - height) ** 2, 0.0))
    return np.where(height <= nose, arc, radius * math.sin(approach) + (height - nose) / math.tan(approach))


def back(height, radius):
    """The same of the trailing side, which has no flank."""
    return -np.where(height < radius, front(np.minimum(height, radius), radius, math.pi / 2.0), radius)


def leaning_chip(depth, spacing, radius, approach, depths, count=20_001):
    """Area, edge length and chord direction of the chip; `depths[0]` is the tool now, the others the passes before."""
    root = np.linspace(0.0, math.sqrt(depth + depths[0]), count)
    above, left = root**2, np.zeros(count)
    cursor, end = front(above, radius, approach), back(above, radius)
    for k, other in enumerate(depths[1:], start=1):
        height = above - depths[0] + other
        cuts = height > 0.0
        taken = np.maximum(front(np.maximum(height, 0.0), radius, approach) - k * spacing, end)
        left += np.where(cuts, np.maximum(cursor - taken, 0.0), 0.0)
        cursor = np.where(cuts, np.minimum(cursor, back(np.maximum(height, 0.0), radius) - k * spacing), cursor)
    left += np.maximum(cursor - end, 0.0)
    area = np.trapezoid(2.0 * root * left, root)
    first, arc = engaged_arc(depth, spacing, radius, approach, depths, count)
    nose, height = radius * (1.0 - math.cos(approach)), depth + depths[0]
    edge = radius * arc + max(height - nose, 0.0) / math.sin(approach)
    along = float(front(np.array(height), radius, approach)) - radius * math.sin(first)
    return float(area), edge, math.atan2(height - radius * (1.0 - math.cos(first)), along)


def engaged_arc(depth, spacing, radius, approach, depths, count):
    """Angle on the nose where the chip begins, and how much of the nose is in the cut (rad)."""
    nose, height = radius * (1.0 - math.cos(approach)), depth + depths[0]
    end = approach if height >= nose else math.acos(1.0 - height / radius)
    angle = np.linspace(-1.2, end, count)
    lowest = np.full(count, depth)
    for k, other in enumerate(depths[1:], start=1):
        place = radius * np.sin(angle) + k * spacing
        inside = np.clip(place, -radius, radius)
        arc = radius - np.sqrt(np.maximum(radius**2 - inside**2, 0.0)) - other
        lowest = np.where(place > inside, lowest, np.minimum(lowest, arc))
    inside = lowest - (radius * (1.0 - np.cos(angle)) - depths[0])
    inside[-1] = max(inside[-1], 1e-15)
    start, stop = inside[:-1], inside[1:]
    # of a piece that the edge enters or leaves, the share inside
    partly = np.maximum(start, stop) / np.maximum(np.abs(start) + np.abs(stop), 1e-18)
    part = np.where((start > 0.0) & (stop > 0.0), 1.0, np.clip(partly, 0.0, 1.0))
    cut = np.flatnonzero(part)
    step = angle[1] - angle[0]
    return float(angle[cut[0]] + (1.0 - part[cut[0]]) * step), float(part.sum() * step)


def leaning_stiffness(cutting, steady=False, change=0.2e-6):
    """Derivatives of both forces with respect to the present depth and, with the sign turned, the one before (N/m)."""
    shape = cutting.depth_of_cut, cutting.feed_per_rev / 2.0, cutting.nose_radius, cutting.approach_angle
    psi = leaning_chip(*shape, [0.0] * PASSES)[2]
    rows = []
    for k, sign in ((0, 1.0), (1, -1.0)):
        pair = []
        for size in (change, -change):
            depths = [0.0] * PASSES
            depths[k] = size
            area, edge, live = leaning_chip(*shape, depths)
            pair.append(np.array(forces_of_chip(cutting, area, edge, psi if steady else live)))
        rows.append(sign * (pair[0] - pair[1]) / (2.0 * change))
    return np.array(rows)
