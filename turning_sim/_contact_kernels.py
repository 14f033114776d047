"""Compiled steps of the two-delay equation with tools that lose contact and a surface that remembers; times in samples.

Symbols:

======  ===================================================================  ============
symbol  meaning                                                              origin
======  ===================================================================  ============
x, v    displacement towards tool 1 (m) and its slope (m per sample)         model, 4
s       surface that a tool meets, mu r(t - tau) of the other tool (m)       model, 4
r       what a tool leaves: in contact its own depth, else s - h0 (m)        model, 4 (1)
h0      nominal cut (m)                                                      model, 4
lim     speed into the cut from which the flank touches (m per sample)       model, 4 (2)
======  ===================================================================  ============

A run is a chain of pieces, on each of which x and both r are polynomials. A piece ends at a sample, where a tool takes
or loses contact or a flank touches or leaves (found as the root of a polynomial), and where a tool meets a kink that
such an event left in the surface. Within a piece nothing has a kink, so that the order of the method is kept.
The order of a kink is that of the first derivative that jumps; the bar takes two orders off it.
"""

from __future__ import annotations

import math
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numba import njit

from turning_sim._intrinsics import borrowed, muladd

POINTS, TERMS = 8, 12
TRACKED, SMOOTH = 3, 99
NEAR, DIP = 1e-9, 0.06
AT = 0.5 - 0.5 * np.cos(np.pi * np.arange(POINTS) / (POINTS - 1))
FIT = np.ascontiguousarray(np.linalg.inv(np.vander(AT, POINTS, increasing=True)).T)
FACTORIAL = np.array([math.factorial(k) for k in range(TERMS)], dtype=np.float64)
INVERSE = 1.0 / FACTORIAL

# columns of a piece: its sample, where it begins and ends in it, one over its planned length, the orders of the kinks
# at its start in what each tool leaves, and the two polynomials
NUMBER, START, END, SCALE, KINKS, LEFT = 0, 1, 2, 3, 4, 6
COLUMNS = LEFT + 2 * TERMS
# parts of the work array, and of the counts
X, V, P, MET = 0, TERMS, 2 * TERMS, 3 * TERMS
SEEN, PLACES, HERE = 5 * TERMS, 5 * TERMS + 2 * POINTS, 5 * TERMS + 3 * POINTS
WORK = HERE + POINTS
SAMPLE, PIECES, FLANK, LOSSES = 0, 1, 2, 3
TOUCHES, READ, NEXT, BEGAN, FOUND = 4, 6, 8, 10, 12
COUNTS = 14


class Status(IntEnum):
    """What the kernel has to say."""

    OK = 0
    DIVERGED = 1
    SURFACE_MEMORY = 2
    STUCK = 3


class Cut(NamedTuple):
    """The numbers of the equation, per mass and in samples."""

    c: float
    k: float
    cp: float
    flank: float
    stiffness: float
    mu: float
    h0: float
    lim: float
    tau1: float
    tau2: float
    push: float


@njit(cache=True, fastmath=False, error_model="numpy", forceinline=True)
def value_of(work, p, y):
    """Return the sum of p[k] y^k."""
    value = 0.0
    for k in range(TERMS - 1, -1, -1):
        value = muladd(value, y, work[p + k])
    return value


@njit(cache=True, fastmath=False, error_model="numpy", forceinline=True)
def delayed(cut, tool):
    """Return whole and part of the delay after which a tool meets the other's surface."""
    tau = cut.tau1 if tool == 0 else cut.tau2
    whole = math.floor(tau)
    return whole, tau - whole


@njit(cache=True, fastmath=False, error_model="numpy", forceinline=True)
def next_kink(cut, k, piece, tool, x):
    """Return where in this sample, after x, a tool meets the next kink of the surface; 2 if not. Note its order."""
    mask, (whole, late) = piece.shape[0] - 1, delayed(cut, tool)
    z, at = k[NEXT + tool], 2.0
    k[FOUND + tool] = SMOOTH
    while z < k[PIECES]:
        i = z & mask
        if piece[i, KINKS + 1 - tool] <= TRACKED:
            ahead = (piece[i, NUMBER] + whole - k[SAMPLE]) + (piece[i, START] + late)
            if ahead > x + NEAR:
                if ahead < 1.0 - NEAR:
                    at = ahead
                    k[FOUND + tool] = int(piece[i, KINKS + 1 - tool])
                break
        z += 1
    k[NEXT + tool] = z
    return at


@njit(cache=True, fastmath=False, error_model="numpy", forceinline=True)
def meet(cut, k, piece, work, tool, x, length):
    """Fill the surface that a tool meets on a piece: at the points, and as a polynomial."""
    mask, (whole, late) = piece.shape[0] - 1, delayed(cut, tool)
    seen, met, left = SEEN + tool * POINTS, MET + tool * TERMS, LEFT + (1 - tool) * TERMS
    z = k[READ + tool]
    while (piece[z & mask, NUMBER] + whole - k[SAMPLE]) + (piece[z & mask, END] + late - x) <= 0.0:
        z += 1
    k[READ + tool] = z
    reached, latest = 0.0, -1.0
    while reached < length and z < k[PIECES]:
        i = z & mask
        begin = (piece[i, NUMBER] + whole - k[SAMPLE]) + (piece[i, START] + late - x)
        scale = piece[i, SCALE]
        for j in range(POINTS):
            y = (AT[j] * length - begin) * scale
            value = 0.0
            for m in range(TERMS - 1, -1, -1):
                value = muladd(value, y, piece[i, left + m])
            work[seen + j] = cut.mu * value if y >= latest else work[seen + j]
        reached = (piece[i, NUMBER] + whole - k[SAMPLE]) + (piece[i, END] + late - x)
        z, latest = z + 1, 0.0
    for m in range(POINTS):
        value = 0.0
        for j in range(POINTS):
            value = muladd(FIT[j, m], work[seen + j], value)
        work[met + m] = value


@njit(cache=True, fastmath=False, error_model="numpy", forceinline=True)
def swing(cut, k, f, work, length, force, ramp):
    """Fill the polynomials of displacement and slope on a piece, from the equation of its mode of contact."""
    one, two = float(k[TOUCHES]), float(k[TOUCHES + 1])
    damping = cut.c + cut.cp * (one + two) + (cut.flank if k[FLANK] != 0 else 0.0)
    stiffness = cut.k + cut.stiffness * (one + two)
    a, b, square = -damping * length, -stiffness * length * length, length * length
    constant = cut.flank * cut.lim * k[FLANK] - cut.stiffness * cut.h0 * (one - two) + force
    one, two = cut.stiffness * one, -cut.stiffness * two
    last, now = f[0], f[1] * length
    work[X], work[X + 1] = last, now
    for m in range(TERMS - 2):
        pushed = one * work[MET + m] + two * work[MET + TERMS + m] if m < POINTS else 0.0
        if m < 2:
            pushed += constant if m == 0 else ramp * length
        last, now = now, muladd(a, now, muladd(b, last, square * FACTORIAL[m] * pushed))
        work[X + m + 2] = now
    for m in range(TERMS):
        work[X + m] *= INVERSE[m]
    for m in range(TERMS - 1):
        work[V + m] = (m + 1) * work[X + m + 1]


@njit(cache=True, fastmath=False, error_model="numpy")
def crossing(work, low, high, rising):
    """Return where the polynomial at `P` passes 0 between two places that it has on either side of it."""
    at, sign = 0.5 * (low + high), 1.0 if rising else -1.0
    for _ in range(60):
        value = slope = 0.0
        for k in range(TERMS - 1, -1, -1):
            slope = slope * at + value
            value = value * at + work[P + k]
        if sign * value > 0.0:
            high = at
        else:
            low = at
        better = at - value / slope if slope != 0.0 else 2.0
        if not low <= better <= high:
            better = 0.5 * (low + high)
        if abs(better - at) < 1e-15:
            break
        at = better
    return at


@njit(cache=True, fastmath=False, error_model="numpy", forceinline=True)
def far(work, sign):
    """Return whether the values at `HERE` are so far on the side of `sign` that no dip between them reaches 0."""
    low = high = sign * work[HERE + 1]
    for j in range(2, POINTS):
        low, high = min(low, sign * work[HERE + j]), max(high, sign * work[HERE + j])
    return low > DIP * (high - low)


@njit(cache=True, fastmath=False, error_model="numpy")
def first_change(work, sign, before):
    """Return where a quantity on the side of `sign` leaves it (2 if not before `before`).

    Its values are at `HERE`, its polynomial at `P`; a dip between two points is looked for at its bottom.
    """
    for j in range(1, POINTS):
        low, here = AT[j - 1], sign * work[HERE + j]
        if here <= 0.0:
            return crossing(work, low, AT[j], sign < 0.0)
        if j + 1 < POINTS:
            last, after = sign * work[HERE + j - 1], sign * work[HERE + j + 1]
            if here < last and here < after and here < 0.25 * (last + after - 2.0 * here):
                one, two = AT[j] - low, AT[j + 1] - AT[j]
                fall, rise = (last - here) * two, (after - here) * one
                at = AT[j] + 0.5 * (fall * two - rise * one) / (fall + rise)
                if sign * value_of(work, P, at) < 0.0:
                    return crossing(work, low, at, sign < 0.0)
        if AT[j] > before:
            break
    return 2.0


@njit(cache=True, fastmath=False, error_model="numpy", forceinline=True)
def places(work, p, out):
    """Fill the values of a polynomial at the points."""
    for j in range(POINTS):
        value = 0.0
        for k in range(TERMS - 1, -1, -1):
            value = muladd(value, AT[j], work[p + k])
        work[out + j] = value


@njit(cache=True, fastmath=False, error_model="numpy", forceinline=True)
def look(cut, k, work, length):
    """Return where on a piece the mode of contact changes first (2 if not) and what changes.

    0, 1: contact of a tool; 2, 3: its flank.
    """
    first, what = 2.0, -1
    places(work, X, PLACES)
    for tool in range(2):
        way, side = 1.0 if tool == 0 else -1.0, 1.0 if k[TOUCHES + tool] == 1 else -1.0
        for j in range(POINTS):
            work[HERE + j] = cut.h0 + way * work[PLACES + j] - work[SEEN + tool * POINTS + j]
        if not far(work, side):
            for m in range(TERMS):
                work[P + m] = way * work[X + m] - work[MET + tool * TERMS + m]
            work[P] += cut.h0
            at = first_change(work, side, first)
            if at < first:
                first, what = at, tool
    if cut.flank == 0.0:
        return first, what
    places(work, V, PLACES)
    for tool in range(2):
        way = 1.0 if tool == 0 else -1.0
        side = 1.0 if k[FLANK] == way else -1.0
        for j in range(POINTS):
            work[HERE + j] = way * work[PLACES + j] - cut.lim * length
        if k[TOUCHES + tool] == 1 and not far(work, side):
            for m in range(TERMS):
                work[P + m] = way * work[V + m]
            work[P] -= cut.lim * length
            at = first_change(work, side, first)
            if at < first:
                first, what = at, 2 + tool
    return first, what


@njit(cache=True, fastmath=False, error_model="numpy", forceinline=True)
def leave(cut, k, piece, work, start, end, length):
    """Append a piece: what each tool leaves."""
    i = k[PIECES] & (piece.shape[0] - 1)
    piece[i, NUMBER], piece[i, START], piece[i, END], piece[i, SCALE] = k[SAMPLE], start, end, 1.0 / length
    for tool in range(2):
        piece[i, KINKS + tool] = k[BEGAN + tool]
        if k[TOUCHES + tool] == 1:
            for m in range(TERMS):
                piece[i, LEFT + tool * TERMS + m] = work[X + m] if tool == 0 else -work[X + m]
        else:
            for m in range(TERMS):
                piece[i, LEFT + tool * TERMS + m] = work[MET + tool * TERMS + m]
            piece[i, LEFT + tool * TERMS] -= cut.h0
    k[PIECES] += 1


@njit(cache=True, fastmath=False, error_model="numpy", forceinline=True)
def change(cut, k, f, what):
    """Change the mode of contact and note which kinks the next piece begins with; those that were met are in `k`."""
    bar = SMOOTH
    for tool in range(2):
        if k[TOUCHES + tool] == 1:
            bar = min(bar, k[FOUND + tool] + 2)
    k[BEGAN] = k[BEGAN + 1] = SMOOTH
    if 0 <= what < 2:
        bar = min(bar, 2)
        k[BEGAN + what] = 1
        k[LOSSES] += k[TOUCHES + what]
        k[TOUCHES + what] = 1 - k[TOUCHES + what]
        k[FLANK] = 0
        if k[TOUCHES] == 1 and f[1] > cut.lim:
            k[FLANK] = 1
        elif k[TOUCHES + 1] == 1 and -f[1] > cut.lim:
            k[FLANK] = -1
    elif what >= 2:
        bar = min(bar, 3)
        k[FLANK] = 0 if k[FLANK] != 0 else (1 if what == 2 else -1)
    for tool in range(2):
        k[BEGAN + tool] = min(k[BEGAN + tool], bar if k[TOUCHES + tool] == 1 else k[FOUND + tool])


@njit(cache=True, fastmath=False, error_model="numpy")
def advance(cut, force, piece, k, f, work, out):
    """Advance `out.size` samples and write the displacement at each; `force` has one more, from the last sample on."""
    piece, k, f, work = borrowed(piece), borrowed(k), borrowed(f), borrowed(work)
    for n in range(out.size):
        at, ramp, tries = 0.0, cut.push * (force[n + 1] - force[n]), 0
        while at < 1.0:
            kink1, kink2 = next_kink(cut, k, piece, 0, at), next_kink(cut, k, piece, 1, at)
            end = min(kink1, kink2, 1.0)
            if kink1 > end + NEAR:
                k[FOUND] = SMOOTH
            if kink2 > end + NEAR:
                k[FOUND + 1] = SMOOTH
            length = end - at
            meet(cut, k, piece, work, 0, at, length)
            meet(cut, k, piece, work, 1, at, length)
            swing(cut, k, f, work, length, cut.push * force[n] + ramp * at, ramp)
            when, what = look(cut, k, work, length)
            if what >= 0:
                k[FOUND] = k[FOUND + 1] = SMOOTH
                end = at + when * length
            else:
                when = 1.0
            leave(cut, k, piece, work, at, end, length)
            f[0], f[1] = value_of(work, X, when), value_of(work, V, when) / length
            change(cut, k, f, what)
            at, tries = end, tries + 1
            if tries > 100:
                return Status.STUCK
        out[n] = f[0]
        k[SAMPLE] += 1
        if not abs(f[0]) < 1.0:
            return Status.DIVERGED
        if k[PIECES] - min(min(k[READ], k[READ + 1]), min(k[NEXT], k[NEXT + 1])) > piece.shape[0] - 128:
            return Status.SURFACE_MEMORY
    return Status.OK
