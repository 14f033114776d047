"""Compiled surface map: columns of heights along the bar, one for each step of each tool, cut by the tools' profiles.

Symbols, all SI:

======  =============================================================  =========
symbol  meaning                                                        origin
======  =============================================================  =========
y       height of the surface above the nominal finished one (m)       model, 5
z       distance from the tip of the tool, towards the chuck (m)       model, 5
p       how much deeper than nominal a tool stands (m)                 model, 4
flank   height above the tip from where on the map lacks edge (m)   below
A, b    chip area (m2) and engaged edge length (m)                     model, 4
psi     thrust direction, normal to the chord of the engaged edge      model, 4
he      mean chip thickness A/b (m)                                    model, 4
======  =============================================================  =========

Cell `j` of a column lies at the helix that its tool would follow without a shift, plus a fixed distance. Half a turn is
then a whole number of cells for every shift and speed, so the grid never slides under a tool: a grid fixed on the bar
would, at 3 mm/s and 5 um, shake the force at 600 Hz.

A column has one height at each place, and few cells for a steep flank. The edge of the map therefore ends in a flank of
at most 75 deg (`turn_over`), and `lean_over` adds what the edge has beyond. That part stands in the wall that the other
tool left half a feed behind, never leaves it, and all it meets there is how deep that tool stood: it needs no map, and
the flank may lean over the cut.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

REFERENCE_THICKNESS = 33e-6
AREA, LENGTH, FIRST, LAST, OVER = 0, 1, 2, 3, 4
ANSWERS = 5
HEIGHT, EDGE, BEND, SKEW = 0, 1, 2, 3


class Map(NamedTuple):
    """The numbers of the map and of the force law, in SI units."""

    dz: float
    half_feed: int
    tip: int
    depth: float
    deepest: float
    radius: float
    turn_over: float
    approach: float
    flank: float
    thrust: float
    tangential: float
    thrust_exponent: float
    tangential_exponent: float
    reference_edge: float
    live: bool
    steady_cos: float


@njit(cache=True, fastmath=False)
def tool_profile(grid, offset, tool):
    """Fill the profile of a tool; `offset` moves it (m).

    Rows: height of the edge above its tip; length of edge in each cell, between this height and the next; how much the
    slopes of height and of length change over the cell.
    """
    end = grid.radius * math.sin(grid.turn_over)
    slope = math.tan(grid.turn_over)
    height, edge, last = tool[HEIGHT], tool[EDGE], tool.shape[1] - 1
    for j in range(last + 1):
        z = (j - grid.tip) * grid.dz - offset
        inside = min(max(z, -end), end)
        arc = grid.radius - math.sqrt(grid.radius * grid.radius - inside * inside)
        height[j] = arc + abs(z - inside) * slope
    for j in range(last):
        edge[j] = math.hypot(grid.dz, height[j + 1] - height[j])
    tool[BEND:, :] = 0.0
    for j in range(1, last - 1):
        tool[BEND, j] = 0.5 * (height[j + 2] - height[j + 1] - height[j] + height[j - 1])
        tool[SKEW, j] = 0.5 * (edge[j + 1] - edge[j - 1])


@njit(cache=True, fastmath=False)
def find(phase, ptr, target, weight):
    """Return where a history passes a phase and fill the weights of the four columns about it (Lagrange)."""
    mask = phase.size - 1
    while phase[(ptr + 1) & mask] <= target:
        ptr += 1
    while phase[ptr & mask] > target:
        ptr -= 1
    a, b = phase[(ptr - 1) & mask], phase[ptr & mask]
    c, d = phase[(ptr + 1) & mask], phase[(ptr + 2) & mask]
    ta, tb, tc, td = target - a, target - b, target - c, target - d
    ab, ac, ad, bc, bd, cd = a - b, a - c, a - d, b - c, b - d, c - d
    weight[0] = tb * tc * td / (ab * ac * ad)
    weight[1] = -ta * tc * td / (ab * bc * bd)
    weight[2] = ta * tb * td / (ac * bc * cd)
    weight[3] = -ta * tb * tc / (ad * bd * cd)
    return ptr


@njit(cache=True, fastmath=False, forceinline=True)
def depth_there(left, ptr, weight):
    """Return how deep a tool stood where `find` has found its history (m)."""
    mask = left.size - 1
    return (weight[0] * left[(ptr - 1) & mask] + weight[1] * left[ptr & mask]) + (
        weight[2] * left[(ptr + 1) & mask] + weight[3] * left[(ptr + 2) & mask]
    )


@njit(cache=True, fastmath=False)
def meet(grid, columns, ptr, weight, old):
    """Fill the surface that a tool meets: what the other left half a turn before, half a feed further back."""
    mask = columns.shape[0] - 1
    shift, count = grid.half_feed, old.size - grid.half_feed
    a, b = columns[(ptr - 1) & mask][shift:], columns[ptr & mask][shift:]
    c, d = columns[(ptr + 1) & mask][shift:], columns[(ptr + 2) & mask][shift:]
    wa, wb, wc, wd = weight[0], weight[1], weight[2], weight[3]
    for j in range(count):
        old[j] = (wa * a[j] + wb * b[j]) + (wc * c[j] + wd * d[j])
    for j in range(count, old.size):
        old[j] = grid.depth


@njit(cache=True, fastmath=False)
def gap(old, tool, chip, extra):
    """Fill how far the surface stands above the edge at nominal depth, and the area over straight cells (cells).

    Two passes meet in an edge that points outwards. The straight line between two cells cuts it off; both sides
    continued give its area back, without which the chip would answer to the earlier pass 0.7 % too strongly or weakly.
    """
    height, bend = tool[HEIGHT], tool[BEND]
    for j in range(old.size):
        chip[j] = old[j] - height[j]
        extra[j] = bend[j] * (1.0 / 12.0)
    left, middle = old[1] - old[0], old[2] - old[1]
    for j in range(1, old.size - 2):
        right = old[j + 2] - old[j + 1]
        if left > middle and middle > right:
            extra[j] += 0.5 * (left - middle) * (middle - right) / (left - right)
        left, middle = middle, right


@njit(cache=True, fastmath=False, forceinline=True)
def curved(start, end, bend, t):
    """Return a quantity within a cell whose slope changes by `bend` over it."""
    return start + t * (end - start) - 0.5 * t * (1.0 - t) * bend


@njit(cache=True, fastmath=False, forceinline=True)
def leaving(here, there, bend):
    """Return where in a cell the edge, curved, comes out of a surface, straight."""
    t = here / (here - there)
    slope = there - here + 0.5 * (1.0 - 2.0 * t) * bend
    if slope >= 0.0:
        return t
    return min(max(t - 0.5 * t * (1.0 - t) * bend / slope, 0.0), 1.0)


@njit(cache=True, fastmath=False)
def engaged(grid, tool, chip, extra, p, out):
    """Fill chip area, engaged edge and its first and last place (cells) for a tool `p` deeper than nominal."""
    edge, area, length, first, last = tool[EDGE], 0.0, 0.0, -1.0, -1.0
    here, j, end = chip[0] + p, 0, chip.size - 1
    if here > 0.0:
        first = 0.0
    while j < end:
        # four cells at a time where the edge does not come out of the surface
        if j + 4 <= end:
            a, b, c, d = chip[j + 1] + p, chip[j + 2] + p, chip[j + 3] + p, chip[j + 4] + p
            if here > 0.0 and a > 0.0 and b > 0.0 and c > 0.0 and d > 0.0:
                area += (0.5 * (here + d) + (a + b + c)) + ((extra[j] + extra[j + 1]) + (extra[j + 2] + extra[j + 3]))
                length += (edge[j] + edge[j + 1]) + (edge[j + 2] + edge[j + 3])
                here, j = d, j + 4
                last = float(j)
                continue
            if here <= 0.0 and a <= 0.0 and b <= 0.0 and c <= 0.0 and d <= 0.0:
                here, j = d, j + 4
                continue
        there = chip[j + 1] + p
        if here > 0.0 and there > 0.0:
            area += 0.5 * (here + there) + extra[j]
            length += edge[j]
            last = j + 1.0
        elif here > 0.0:
            bend = tool[BEND, j]
            t = leaving(here, there, bend)
            area += t * (here + 0.5 * t * (there - here)) + bend * t * t * (0.25 - t / 6.0)
            length += curved(0.0, edge[j], tool[SKEW, j], t)
            last = j + t
        elif there > 0.0:
            t = here / (here - there)
            area += 0.5 * there * (1.0 - t)
            length += edge[j] - curved(0.0, edge[j], tool[SKEW, j], t)
            last = j + 1.0
            if first < 0.0:
                first = j + t
        here, j = there, j + 1
    out[AREA], out[LENGTH], out[FIRST], out[LAST], out[OVER] = area * grid.dz, length, first, last, 0.0


@njit(cache=True, fastmath=False)
def beyond(grid, height):
    """Return what the edge has beyond that of the map up to a height above its tip (m).

    Place along the bar, integral of that over the height, and length of edge; negative where it leans back.
    """
    r, cot = grid.radius, 1.0 / math.tan(grid.turn_over)
    nose = r * (1.0 - math.cos(grid.approach))
    if height <= grid.flank:
        return 0.0, 0.0, 0.0
    angle = grid.approach if height >= nose else math.acos(1.0 - height / r)
    rise, straight = height - grid.flank, max(height - nose, 0.0)
    sine, cosine = math.sin(angle), math.cos(angle)
    first_sine, first_cosine = math.sin(grid.turn_over), math.cos(grid.turn_over)
    lean = cosine / sine if straight > 0.0 else 0.0
    place = r * sine + straight * lean - (r * first_sine + rise * cot)
    area = 0.5 * r * r * (angle - sine * cosine - grid.turn_over + first_sine * first_cosine)
    area += straight * (r * sine + 0.5 * straight * lean) - rise * (r * first_sine + 0.5 * rise * cot)
    length = r * (angle - grid.turn_over) + straight / sine - rise / first_sine
    return place, area, length


@njit(cache=True, fastmath=False)
def lean_over(grid, p, before, out):
    """Add what the edge cuts beyond that of the map to a chip as `engaged` leaves it.

    The pass before stood `before` deeper than nominal (m).
    """
    place, area, length = beyond(grid, grid.depth + p)
    _, cut, _ = beyond(grid, grid.depth + before)
    out[AREA] += area - cut
    out[LENGTH] += length
    out[OVER] = place


@njit(cache=True, fastmath=False, forceinline=True)
def height_at(tool, place):
    """Return the height of the edge at a place between cells."""
    j = min(int(place), tool.shape[1] - 2)
    return curved(tool[HEIGHT, j], tool[HEIGHT, j + 1], tool[BEND, j], place - j)


@njit(cache=True, fastmath=False)
def chip_forces(grid, tool, chip):
    """Return the radial and the tangential force of a chip as `engaged` leaves it."""
    if chip[AREA] <= 0.0 or chip[LENGTH] <= 0.0:
        return 0.0, 0.0
    direction = grid.steady_cos
    if grid.live:
        along = (chip[LAST] - chip[FIRST]) * grid.dz + chip[OVER]
        direction = along / math.hypot(along, height_at(tool, chip[LAST]) - height_at(tool, chip[FIRST]))
    ratio = math.log(chip[AREA] / (chip[LENGTH] * REFERENCE_THICKNESS))
    radial = grid.thrust * chip[AREA] * math.exp(-grid.thrust_exponent * ratio) * direction
    return radial, grid.tangential * chip[AREA] * math.exp(-grid.tangential_exponent * ratio)


@njit(cache=True, fastmath=False)
def leave(old, tool, p, cuts, rest, column):
    """Write what a tool leaves: the lower of the surface and its edge; in air, what it shall find on entry."""
    if cuts:
        for j in range(old.size):
            column[j] = min(old[j], tool[HEIGHT, j] - p)
    else:
        column[:] = rest


@njit(cache=True, fastmath=False)
def past_columns(grid, depths, ahead, columns):
    """Fill what tools leave that stood `depths[pass, step]` (m) deeper than nominal.

    Parameters
    ----------
    grid : Map
        The map.
    depths : ndarray
        Depth of each pass, the newest first, at each step (m), shape (passes, n).
    ahead : ndarray
        How far the tool of each pass runs ahead of its cells (m), shape (passes,).
    columns : ndarray
        Shape (n, cells).
    """
    tool = np.empty((4, columns.shape[1]))
    columns[:, :] = grid.depth
    for k in range(depths.shape[0]):
        tool_profile(grid, ahead[k] - k * grid.half_feed * grid.dz, tool)
        for n in range(columns.shape[0]):
            for j in range(columns.shape[1]):
                columns[n, j] = min(columns[n, j], tool[HEIGHT, j] - depths[k, n])
