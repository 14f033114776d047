"""Compiled pass of a stability chart.

======== ====================== ======= ==================================================================
symbol   API name               unit    meaning
======== ====================== ======= ==================================================================
m, C, k  (process)              SI      mass, damping with the flanks of both tools, stiffness
mu       overlap                -       share of the other tool's wave
T, h     half_turn, shift_time  s       pi/Omega, h/Omega: the delays are T + h and T - h
g        (crossing)             -       (k - m w^2) mu cos(w h) sin(w T) + C w (1 + mu cos(w h) cos(w T))
K        stiffness              N/m     C w/(2 mu cos(w h) sin(w T)) where g = 0: there a root is i w
======== ====================== ======= ==================================================================
"""

import math
from enum import IntEnum

import numpy as np
from numba import njit


class Status(IntEnum):
    """What a pass has to say."""

    OK = 0
    FULL = 1


@njit(cache=True, fastmath=False, forceinline=True)
def crossing(m, C, k, mu, T, h, w):
    """Return g, whose zeros are the borders of stability."""
    c, phase = math.cos(w * h), w * T
    return (k - m * w * w) * mu * c * math.sin(phase) + C * w * (1.0 + mu * c * math.cos(phase))


@njit(cache=True, fastmath=False)
def _zero(m, C, k, mu, T, h, low, high, g_low):
    """Return the zero between two places of different sign: secant steps kept inside (Illinois)."""
    g_high = crossing(m, C, k, mu, T, h, high)
    a, b, ga, gb = low, high, g_low, g_high
    for _ in range(60):
        w = b - gb * (b - a) / (gb - ga)
        g = crossing(m, C, k, mu, T, h, w)
        if g == 0.0 or abs(b - a) <= 4e-16 * abs(b):
            return w
        if (g < 0.0) != (gb < 0.0):
            a, ga = b, gb
        else:
            ga *= 0.5
        step = abs(w - b)
        b, gb = w, g
        if step <= 2e-15 * w:
            return w
    return b


@njit(cache=True, fastmath=False)
def _lowest(m, C, k, mu, T, h, low, high, sign):
    """Return where sign g is least between two places: where it touches zero, two borders are close together."""
    ratio = 0.5 * (math.sqrt(5.0) - 1.0)
    a, b = low, high
    u, v = b - ratio * (b - a), a + ratio * (b - a)
    gu, gv = sign * crossing(m, C, k, mu, T, h, u), sign * crossing(m, C, k, mu, T, h, v)
    for _ in range(40):
        if gu < gv:
            b, v, gv = v, u, gu
            u = b - ratio * (b - a)
            gu = sign * crossing(m, C, k, mu, T, h, u)
        else:
            a, u, gu = u, v, gv
            v = a + ratio * (b - a)
            gv = sign * crossing(m, C, k, mu, T, h, v)
        if min(gu, gv) < 0.0:
            break
    return u if gu < gv else v


@njit(cache=True, fastmath=False)
def _keep(C, mu, T, h, w, rising, highest, found, count):
    """Write stiffness, frequency and direction of a border; return how many there are."""
    by = 2.0 * mu * math.cos(w * h) * math.sin(w * T)
    K = C * w / by if by != 0.0 else math.inf
    if 0.0 < K <= highest and count < found.shape[0]:
        found[count, 0], found[count, 1], found[count, 2] = K, w, -1.0 if rising else 1.0
        return count + 1
    return count


@njit(cache=True, fastmath=False)
def borders(m, C, k, mu, T, h, highest, per_turn, found):
    """Find every border up to a stiffness: rows stiffness, w, change of the number of unstable pairs; return how many.

    A root moves right with K where the imaginary part of K(i w) rises, that is where g falls through zero.
    """
    w = math.sqrt(k / m)
    end = math.sqrt((k + 2.0 * highest * (1.0 + abs(mu))) / m) + C / m
    step = math.pi / (per_turn * T)
    count, g = 0, crossing(m, C, k, mu, T, h, w)
    before, at_before = g, w
    while w < end:
        ahead = w + step
        next_g = crossing(m, C, k, mu, T, h, ahead)
        if (g < 0.0) != (next_g < 0.0):
            zero = _zero(m, C, k, mu, T, h, w, ahead, g)
            count = _keep(C, mu, T, h, zero, next_g > g, highest, found, count)
        elif abs(g) < abs(before) and abs(g) <= abs(next_g) and (before < 0.0) == (g < 0.0):
            sign = 1.0 if g > 0.0 else -1.0
            dip = _lowest(m, C, k, mu, T, h, at_before, ahead, sign)
            g_dip = crossing(m, C, k, mu, T, h, dip)
            if sign * g_dip < 0.0:
                first = _zero(m, C, k, mu, T, h, at_before, dip, before)
                count = _keep(C, mu, T, h, first, sign < 0.0, highest, found, count)
                second = _zero(m, C, k, mu, T, h, dip, ahead, g_dip)
                count = _keep(C, mu, T, h, second, sign > 0.0, highest, found, count)
        before, at_before = g, w
        w, g = ahead, next_g
    return count


@njit(cache=True, fastmath=False)
def chart(m, C, k, mu, T, h, stiffness, per_turn, found, order, unstable, limit, limit_w):
    """Fill the number of unstable pairs of every cell, and the lowest border of every column with its frequency.

    Parameters: C, mu, T, h, limit, limit_w (columns,); stiffness (rows,) rising; found (most, 3) and order (most,):
    scratch; unstable (rows, columns).
    """
    rows = stiffness.size
    for j in range(T.size):
        count = 0
        if mu[j] != 0.0:
            count = borders(m, C[j], k, mu[j], T[j], h[j], stiffness[rows - 1], per_turn, found)
        if count == found.shape[0]:
            return Status.FULL
        order[:count] = np.argsort(found[:count, 0])
        limit[j], limit_w[j] = math.inf, math.nan
        if count > 0:
            limit[j], limit_w[j] = found[order[0], 0], found[order[0], 1]
        passed, now = 0, 0.0
        for i in range(rows):
            while passed < count and found[order[passed], 0] <= stiffness[i]:
                now += found[order[passed], 2]
                passed += 1
            unstable[i, j] = now
    return Status.OK
