"""Compiled steps of the one-mode equation with two delays, all times in samples.

Symbols:

=========  ===================================================================  ==========
symbol     meaning                                                              origin
=========  ===================================================================  ==========
q          displacement at the tools (m)                                        model, 4
s, w2      damping c/(2 m) and squared frequency (k + 2 K)/m, times h and h^2   model, 4
a          K mu/m times h^2                                                     model, 4
tau        one of the two delays                                                model, 4
H          response of q[n+1] to a push at n + x, |x| < 1                       `push`
P          what q on the right of a break has more than q on the left           `hand_on`
=========  ===================================================================  ==========

Between two samples the bar answers exactly, and the past is a polynomial through `TAPS` of its samples, so that each
delay becomes a row of fixed weights: q[n+1] = c1 q[n] + c2 q[n-1] + both rows on the past. A row does not see a break
of the solution (where it began, and a delay later, two derivatives smoother each time), but the jumps of all
derivatives there follow from the equation: `hand_on` adds what the rows miss.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from turning_sim._intrinsics import muladd

TAPS = 20
HALF = TAPS // 2
CHUNK = 64
JUMPS = 34
LEVELS = 4
LARGE, SMALL = 2.0**300, 2.0**-300
_X, _W = np.polynomial.legendre.leggauss(TAPS // 2 + 4)
NODES, SHARES = 0.5 * (_X + 1.0), 0.5 * _W


class Step(NamedTuple):
    """The numbers of one equation at one sample rate."""

    s: float
    w2: float
    a: float
    tau1: float
    tau2: float
    push: float


@njit(cache=True, fastmath=False)
def push(s, w2, x):
    """Return H(x): how far a unit push at n + x moves q[n+1], beyond what c1 q[n] + c2 q[n-1] say."""
    d, y = w2 - s * s, 1.0 - abs(x)
    w = math.sqrt(abs(d))
    swing = y if w < 1e-9 else (math.sin(w * y) if d > 0.0 else math.sinh(w * y)) / w
    return math.exp(-s * (1.0 - x)) * swing


@njit(cache=True, fastmath=False)
def recurrence(s, w2):
    """Return c1 and c2."""
    d = w2 - s * s
    w = math.sqrt(abs(d))
    return 2.0 * math.exp(-s) * (math.cos(w) if d > 0.0 else math.cosh(w)), -math.exp(-2.0 * s)


@njit(cache=True, fastmath=False)
def lagrange(x, before, out):
    """Fill the weights of samples -HALF ... HALF - 1 in the value at x."""
    product = 1.0
    for j in range(TAPS):
        before[j] = product
        product *= x - (j - HALF)
    product, scale = 1.0, 1.0
    for j in range(1, TAPS):
        scale *= float(j)
    for j in range(TAPS - 1, -1, -1):
        out[j] = before[j] * product / scale
        product *= x - (j - HALF)
        if j > 0:
            scale *= -float(TAPS - j) / float(j)


@njit(cache=True, fastmath=False)
def row(s, w2, tau, gain, before, value, out):
    """Fill the weights of the samples about n - floor(tau) in q[n+1]; `gain` is the force of a unit in the past."""
    late = tau - math.floor(tau)
    out[:] = 0.0
    for side in (-1.0, 1.0):
        for i in range(NODES.size):
            x = side * NODES[i]
            lagrange(x - late, before, value)
            share = gain * SHARES[i] * push(s, w2, x)
            for j in range(TAPS):
                out[j] += share * value[j]


@njit(cache=True, fastmath=False)
def shares_of_force(s, w2, gain, out):
    """Fill the weights of a force at n - 1, n and n + 1 in q[n+1]; it is linear between samples."""
    out[:] = 0.0
    for i in range(NODES.size):
        back, ahead = gain * SHARES[i] * push(s, w2, -NODES[i]), gain * SHARES[i] * push(s, w2, NODES[i])
        out[0] += back * NODES[i]
        out[1] += (back + ahead) * (1.0 - NODES[i])
        out[2] += ahead * NODES[i]


@njit(cache=True, fastmath=False)
def rows(step, weights, before, value):
    """Fill the weights of both delays, shape (2, TAPS)."""
    row(step.s, step.w2, step.tau1, -step.a, before, value, weights[0])
    row(step.s, step.w2, step.tau2, -step.a, before, value, weights[1])


@njit(cache=True, fastmath=False)
def values(p, x, out):
    """Fill the sums of p[k] x^k."""
    for i in range(x.size):
        value = 0.0
        for k in range(JUMPS - 1, -1, -1):
            value = muladd(value, x[i], p[k])
        out[i] = value


@njit(cache=True, fastmath=False)
def continue_series(step, p, forced):
    """Fill p[2:] from p[0], p[1] and the series of the force (per mass, times h^2)."""
    for k in range(p.size - 2):
        p[k + 2] = (forced[k] - 2.0 * step.s * (k + 1) * p[k + 1] - step.w2 * p[k]) / ((k + 1) * (k + 2))


@njit(cache=True, fastmath=False)
def pushed(step, p, x, y, value):
    """Return what P, from x in (-1, 1) on, does to q[n+1] through the past."""
    total, low = 0.0, x
    while low < 1.0:
        high = 0.0 if low < 0.0 else 1.0
        for i in range(NODES.size):
            y[i] = low - x + (high - low) * NODES[i]
        values(p, y, value)
        for i in range(NODES.size):
            total -= step.a * (high - low) * SHARES[i] * push(step.s, step.w2, x + y[i]) * value[i]
        low = high
    return total


@njit(cache=True, fastmath=False)
def missed(step, p, at, tau, weights, near, y, value, out):
    """Add to `out` what the row of one delay misses because of the break P at time `at`, read a delay later.

    `near` holds P at the samples about the break, the first of them HALF + 2 before floor(at).
    """
    whole = int(math.floor(tau))
    origin = int(math.floor(at)) - HALF - 2
    for n in range(max(origin + whole + 2, 0), min(origin + whole + TAPS + 5, out.size)):
        first = n - whole - HALF
        x = at + tau - n
        if x <= -1.0:
            for j in range(TAPS):
                if first + j < at:
                    out[n] += weights[j] * near[first + j - origin]
        else:
            for j in range(TAPS):
                if first + j >= at:
                    out[n] -= weights[j] * near[first + j - origin]
            out[n] += pushed(step, p, x, y, value)


@njit(cache=True, fastmath=False)
def hand_on(step, weights, p0, out):
    """Fill what the rows miss at each of the first samples: P0 is the break at time 0, the others follow from it."""
    jumps = np.zeros((LEVELS + 1, LEVELS + 1, JUMPS))  # after i delays tau1 and j delays tau2
    forced, y, value = np.empty(JUMPS), np.empty(NODES.size), np.empty(NODES.size)
    x, near = np.empty(TAPS + 5), np.empty(TAPS + 5)
    out[:] = 0.0
    jumps[0, 0] = p0
    for level in range(LEVELS + 1):
        for i in range(level + 1):
            j = level - i
            p = jumps[i, j]
            if level > 0:
                for k in range(JUMPS):
                    before = (jumps[i - 1, j, k] if i > 0 else 0.0) + (jumps[i, j - 1, k] if j > 0 else 0.0)
                    forced[k] = -step.a * before
                continue_series(step, p, forced)
            at = i * step.tau1 + j * step.tau2
            for k in range(x.size):
                x[k] = math.floor(at) - HALF - 2 + k - at
            values(p, x, near)
            missed(step, p, at, step.tau1, weights[0], near, y, value, out)
            missed(step, p, at, step.tau2, weights[1], near, y, value, out)


@njit(cache=True, fastmath=False)
def advance(step, weights, first, missing, number, force, f, q):
    """Fill q[first:]; sample `first` has the number `number`; q before it is the past.

    `force` holds force times its gain, from two samples before `first` on, or nothing.
    """
    c1, c2 = recurrence(step.s, step.w2)
    d1, d2 = int(math.floor(step.tau1)), int(math.floor(step.tau2))
    chunk = min(CHUNK, min(d1, d2) - HALF + 1)
    w1, w2 = weights[0], weights[1]
    i = first
    while i < q.size:
        count = min(chunk, q.size - i)
        x1 = q[i - 1 - d1 - HALF : i - 1 - d1 + HALF + count]
        x2 = q[i - 1 - d2 - HALF : i - 1 - d2 + HALF + count]
        for k in range(count):
            one = two = 0.0
            for j in range(TAPS):
                one = muladd(w1[j], x1[k + j], one)
                two = muladd(w2[j], x2[k + j], two)
            f[k] = one + two
        n = number + (i - first) - 1
        for k in range(min(count, missing.size - n)):
            f[k] += missing[n + k]
        if force.size > 0:
            for k in range(count):
                f[k] += force[i - first + k]
        now, last = q[i - 1], q[i - 2]
        for k in range(count):
            new = muladd(c1, now, muladd(c2, last, f[k]))
            q[i + k] = new
            last, now = now, new
        i += count


@njit(cache=True, fastmath=False, nogil=True)
def advance_many(numbers, past, q, ends):
    """Advance every equation from the same past and keep its end; only ratios matter, so none over- or underflows.

    `numbers` has the first five of `Step` in each row, `q` is as long as past and run together.
    """
    weights, before, value, f = np.empty((2, TAPS)), np.empty(TAPS), np.empty(TAPS), np.empty(CHUNK)
    nothing, kept = np.empty(0), max(past.size, ends.shape[1])
    for r in range(numbers.shape[0]):
        step = Step(numbers[r, 0], numbers[r, 1], numbers[r, 2], numbers[r, 3], numbers[r, 4], 0.0)
        rows(step, weights, before, value)
        q[: past.size] = past
        i = past.size
        while i < q.size:
            stop = min(i + 8 * CHUNK, q.size)
            advance(step, weights, i, nothing, 1, nothing, f, q[:stop])
            size = abs(q[stop - 1]) + abs(q[stop - 2])
            if size > LARGE or (0.0 < size < SMALL):
                factor = SMALL if size > LARGE else LARGE
                for k in range(max(stop - kept, 0), stop):
                    q[k] *= factor
            i = stop
        ends[r] = q[q.size - ends.shape[1] :]
