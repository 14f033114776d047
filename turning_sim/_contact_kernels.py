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

from turning_sim._delay_kernels import muladd

POINTS, TERMS = 8, 12
TRACKED, SMOOTH = 3, 99
NEAR, DIP = 1e-9, 0.06
AT = 0.5 - 0.5 * np.cos(np.pi * np.arange(POINTS) / (POINTS - 1))
FIT = np.ascontiguousarray(np.linalg.inv(np.vander(AT, POINTS, increasing=True)).T)
FACTORIAL = np.array([math.factorial(k) for k in range(TERMS)], dtype=np.float64)

START, END, SCALE = 0, 1, 2
X, V, ONSET = 0, 1, 2
SAMPLE, PIECES, FLANK, LOSSES = 0, 1, 2, 3
TOUCHES, SEEN, NEXT, BEGAN = 4, 6, 8, 10


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


@njit(cache=True, fastmath=False, forceinline=True)
def values(p, y, out):
    """Fill the sums of p[k] y^k at `POINTS` places."""
    for j in range(POINTS):
        value = 0.0
        for k in range(TERMS - 1, -1, -1):
            value = muladd(value, y[j], p[k])
        out[j] = value


@njit(cache=True, fastmath=False, forceinline=True)
def surface(left, i, tool, y, out):
    """Fill what a tool left on piece `i` at `POINTS` places."""
    for j in range(POINTS):
        value = 0.0
        for k in range(TERMS - 1, -1, -1):
            value = muladd(value, y[j], left[i, tool, k])
        out[j] = value


@njit(cache=True, fastmath=False, forceinline=True)
def value_of(p, y):
    """Return the sum of p[k] y^k."""
    value = 0.0
    for k in range(TERMS - 1, -1, -1):
        value = muladd(value, y, p[k])
    return value


@njit(cache=True, fastmath=False, forceinline=True)
def next_kink(cut, k, number, span, order, tool, x):
    """Return where in this sample, after x, a tool meets the next kink of the surface (2 if not), and its order."""
    mask = number.size - 1
    tau = cut.tau1 if tool == 0 else cut.tau2
    whole = int(math.floor(tau))
    late, z = tau - whole, k[NEXT + tool]
    while z < k[PIECES]:
        i = z & mask
        ahead = (number[i] + whole - k[SAMPLE]) + (span[i, START] + late)
        if order[i, 1 - tool] <= TRACKED and ahead > x + NEAR:
            k[NEXT + tool] = z
            return (ahead, order[i, 1 - tool]) if ahead < 1.0 - NEAR else (2.0, SMOOTH)
        z += 1
    k[NEXT + tool] = z
    return 2.0, SMOOTH


@njit(cache=True, fastmath=False, forceinline=True)
def meet(cut, k, number, span, left, tool, x, length, y, part, meets, met):
    """Fill the surface that a tool meets on a piece: at the points, and as a polynomial."""
    mask = number.size - 1
    tau = cut.tau1 if tool == 0 else cut.tau2
    whole = int(math.floor(tau))
    late, z = tau - whole, k[SEEN + tool]
    i = z & mask
    while (number[i] + whole - k[SAMPLE]) + (span[i, END] + late - x) <= 0.0:
        z += 1
        i = z & mask
    k[SEEN + tool] = z
    first = True
    while True:
        begin = (number[i] + whole - k[SAMPLE]) + (span[i, START] + late - x)
        for j in range(POINTS):
            y[j] = (AT[j] * length - begin) * span[i, SCALE]
        surface(left, i, 1 - tool, y, part)
        for j in range(POINTS):
            meets[tool, j] = cut.mu * part[j] if first or y[j] >= 0.0 else meets[tool, j]
        first = False
        if (number[i] + whole - k[SAMPLE]) + (span[i, END] + late - x) >= length or z + 1 >= k[PIECES]:
            break
        z += 1
        i = z & mask
    for m in range(POINTS):
        value = 0.0
        for j in range(POINTS):
            value = muladd(FIT[j, m], meets[tool, j], value)
        met[tool, m] = value


@njit(cache=True, fastmath=False, forceinline=True)
def swing(cut, k, f, length, force, ramp, met, x, v):
    """Fill the polynomials of displacement and slope on a piece, from the equation of its mode of contact."""
    one, two = k[TOUCHES], k[TOUCHES + 1]
    damping = cut.c + cut.cp * (one + two) + (cut.flank if k[FLANK] != 0 else 0.0)
    stiffness = cut.k + cut.stiffness * (one + two)
    a, b, square = -damping * length, -stiffness * length * length, length * length
    constant = cut.flank * cut.lim * k[FLANK] - cut.stiffness * cut.h0 * (one - two) + force
    x[0], x[1] = f[X], f[V] * length
    for m in range(TERMS - 2):
        pushed = 0.0
        if m < POINTS:
            pushed = cut.stiffness * (one * met[0, m] - two * met[1, m])
        if m < 2:
            pushed += constant if m == 0 else ramp * length
        x[m + 2] = muladd(a, x[m + 1], muladd(b, x[m], square * FACTORIAL[m] * pushed))
    for m in range(TERMS):
        x[m] /= FACTORIAL[m]
    for m in range(TERMS - 1):
        v[m] = (m + 1) * x[m + 1]
    v[TERMS - 1] = 0.0


@njit(cache=True, fastmath=False)
def crossing(p, low, high, rising):
    """Return where a polynomial passes 0 between two places that it has on either side of it."""
    at, sign = 0.5 * (low + high), 1.0 if rising else -1.0
    for _ in range(60):
        value = slope = 0.0
        for k in range(TERMS - 1, -1, -1):
            slope = slope * at + value
            value = value * at + p[k]
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


@njit(cache=True, fastmath=False, forceinline=True)
def far(seen, positive):
    """Return whether values at the points are so far on one side of 0 that no dip between them reaches it."""
    low = high = seen[1]
    for j in range(2, POINTS):
        low, high = min(low, seen[j]), max(high, seen[j])
    margin = DIP * (high - low)
    return low > margin if positive else high < -margin


@njit(cache=True, fastmath=False)
def first_change(p, seen, positive, before):
    """Return where a quantity that is `positive` stops being so (2 if not before `before`).

    `seen` are its values at the points, `p` its polynomial; a dip between two points is looked for at its bottom.
    """
    sign = 1.0 if positive else -1.0
    for j in range(1, POINTS):
        low, here = AT[j - 1], sign * seen[j]
        if here <= 0.0:
            return crossing(p, low, AT[j], not positive)
        if j + 1 < POINTS:
            last, after = sign * seen[j - 1], sign * seen[j + 1]
            if here < last and here < after and here < 0.25 * (last + after - 2.0 * here):
                one, two = AT[j] - low, AT[j + 1] - AT[j]
                fall, rise = (last - here) * two, (after - here) * one
                at = AT[j] + 0.5 * (fall * two - rise * one) / (fall + rise)
                if sign * value_of(p, at) < 0.0:
                    return crossing(p, low, at, not positive)
        if AT[j] > before:
            break
    return 2.0


@njit(cache=True, fastmath=False, forceinline=True)
def look(cut, k, length, x, v, met, meets, y, seen, p):
    """Return where on a piece the mode of contact changes first (2 if not) and what changes.

    0, 1: contact of a tool; 2, 3: its flank.
    """
    first, what = 2.0, -1
    values(x, AT, y)
    for tool in range(2):
        sign = 1.0 if tool == 0 else -1.0
        for j in range(POINTS):
            seen[j] = cut.h0 + sign * y[j] - meets[tool, j]
        if not far(seen, k[TOUCHES + tool] == 1):
            for m in range(TERMS):
                p[m] = sign * x[m] - met[tool, m]
            p[0] += cut.h0
            at = first_change(p, seen, k[TOUCHES + tool] == 1, first)
            if at < first:
                first, what = at, tool
    if cut.flank == 0.0:
        return first, what
    values(v, AT, y)
    for tool in range(2):
        sign = 1.0 if tool == 0 else -1.0
        for j in range(POINTS):
            seen[j] = sign * y[j] - cut.lim * length
        if k[TOUCHES + tool] == 1 and not far(seen, k[FLANK] == sign):
            for m in range(TERMS):
                p[m] = sign * v[m]
            p[0] -= cut.lim * length
            at = first_change(p, seen, k[FLANK] == sign, first)
            if at < first:
                first, what = at, 2 + tool
    return first, what


@njit(cache=True, fastmath=False, forceinline=True)
def leave(cut, k, span, number, order, left, x, met, start, end, length):
    """Append a piece: what each tool leaves."""
    mask = number.size - 1
    i = k[PIECES] & mask
    number[i] = k[SAMPLE]
    span[i, START], span[i, END], span[i, SCALE] = start, end, 1.0 / length
    order[i, 0], order[i, 1] = k[BEGAN], k[BEGAN + 1]
    for tool in range(2):
        sign = 1.0 if tool == 0 else -1.0
        if k[TOUCHES + tool] == 1:
            for m in range(TERMS):
                left[i, tool, m] = sign * x[m]
        else:
            for m in range(TERMS):
                left[i, tool, m] = met[tool, m]
            left[i, tool, 0] -= cut.h0
    k[PIECES] += 1


@njit(cache=True, fastmath=False, forceinline=True)
def change(cut, k, f, what, kinks):
    """Change the mode of contact and note which kinks the next piece begins with; `kinks` are those that were met."""
    bar = SMOOTH
    for tool in range(2):
        if k[TOUCHES + tool] == 1 and kinks[tool] != SMOOTH:
            bar = min(bar, kinks[tool] + 2)
    k[BEGAN] = k[BEGAN + 1] = SMOOTH
    if 0 <= what < 2:
        bar = min(bar, 2)
        k[BEGAN + what] = 1
        k[LOSSES] += k[TOUCHES + what]
        k[TOUCHES + what] = 1 - k[TOUCHES + what]
        k[FLANK] = 0
        if k[TOUCHES] == 1 and f[V] > cut.lim:
            k[FLANK] = 1
        elif k[TOUCHES + 1] == 1 and -f[V] > cut.lim:
            k[FLANK] = -1
    elif what >= 2:
        bar = min(bar, 3)
        k[FLANK] = 0 if k[FLANK] != 0 else (1 if what == 2 else -1)
    for tool in range(2):
        k[BEGAN + tool] = min(k[BEGAN + tool], bar if k[TOUCHES + tool] == 1 else kinks[tool])


@njit(cache=True, fastmath=False)
def advance(cut, force, number, span, order, left, k, f, out):
    """Advance `out.size` samples and write the displacement at each; `force` has one more, from the last sample on."""
    x, v, p = np.zeros(TERMS), np.zeros(TERMS), np.zeros(TERMS)
    met, meets, kinks = np.zeros((2, TERMS)), np.zeros((2, POINTS)), np.zeros(2, np.int64)
    y, part, seen = np.empty(POINTS), np.empty(POINTS), np.empty(POINTS)
    for n in range(out.size):
        at, ramp, tries = 0.0, cut.push * (force[n + 1] - force[n]), 0
        while at < 1.0:
            kink1, order1 = next_kink(cut, k, number, span, order, 0, at)
            kink2, order2 = next_kink(cut, k, number, span, order, 1, at)
            end = min(kink1, kink2, 1.0)
            kinks[0] = order1 if kink1 <= end + NEAR else SMOOTH
            kinks[1] = order2 if kink2 <= end + NEAR else SMOOTH
            length = end - at
            meet(cut, k, number, span, left, 0, at, length, y, part, meets, met)
            meet(cut, k, number, span, left, 1, at, length, y, part, meets, met)
            swing(cut, k, f, length, cut.push * force[n] + ramp * at, ramp, met, x, v)
            when, what = look(cut, k, length, x, v, met, meets, y, seen, p)
            if what >= 0:
                kinks[:] = SMOOTH
                end = at + when * length
            else:
                when = 1.0
            leave(cut, k, span, number, order, left, x, met, at, end, length)
            f[X], f[V] = value_of(x, when), value_of(v, when) / length
            change(cut, k, f, what, kinks)
            at, tries = end, tries + 1
            if tries > 100:
                return Status.STUCK
        out[n] = f[X]
        k[SAMPLE] += 1
        if not abs(f[X]) < 1.0:
            return Status.DIVERGED
        if k[PIECES] - min(min(k[SEEN], k[SEEN + 1]), min(k[NEXT], k[NEXT + 1])) > number.size - 128:
            return Status.SURFACE_MEMORY
    return Status.OK
