"""What one writes first: classical Runge-Kutta with a cubic through the history, compiled; peers of the delay table.

Symbols as in the two-delay equation: m x'' + c x' + k x = -K [...], times in steps of the method. Half and whole steps
read the past at the same places in the grid, so the weights of the cubics are made once.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit


class Peer(NamedTuple):
    """The numbers of the equation, SI, and its delays in steps."""

    m: float
    c: float
    k: float
    cp: float
    K: float
    mu: float
    tau1: float
    tau2: float
    h: float
    h0: float
    flank: float
    limit: float


@njit(cache=True, fastmath=False)
def cubic(late, weights):
    """Fill the weights of the four samples about a place, `late` behind the third of them."""
    y = 1.0 - late
    weights[0] = -y * (y - 1.0) * (y - 2.0) / 6.0
    weights[1] = (y + 1.0) * (y - 1.0) * (y - 2.0) / 2.0
    weights[2] = -(y + 1.0) * y * (y - 2.0) / 2.0
    weights[3] = (y + 1.0) * y * (y - 1.0) / 6.0


@njit(cache=True, fastmath=False)
def places(tau, weights):
    """Fill the weights at a step and half a step on, and return where their four samples begin."""
    whole = int(math.floor(tau))
    cubic(tau - whole, weights[0])
    half = int(math.floor(tau - 0.5))
    cubic(tau - 0.5 - half, weights[1])
    return whole + 2, half + 2


@njit(cache=True, fastmath=False, forceinline=True)
def read(past, i, w, row):
    """Return the value of a cubic."""
    return w[row, 0] * past[i] + w[row, 1] * past[i + 1] + w[row, 2] * past[i + 2] + w[row, 3] * past[i + 3]


@njit(cache=True, fastmath=False)
def linear(peer, x, first, v):
    """Advance from step `first - 1` to the end of `x`; what stands before is the past. Returns the last velocity."""
    w1, w2 = np.empty((2, 4)), np.empty((2, 4))
    (at1, half1), (at2, half2) = places(peer.tau1, w1), places(peer.tau2, w2)
    h, stiffness, damping = peer.h, (peer.k + 2.0 * peer.K) / peer.m, (peer.c + 2.0 * peer.cp) / peer.m
    gain = -peer.K * peer.mu / peer.m
    begin = gain * (read(x, first - 1 - at1, w1, 0) + read(x, first - 1 - at2, w2, 0))
    for i in range(first, x.size):
        middle = gain * (read(x, i - 1 - half1, w1, 1) + read(x, i - 1 - half2, w2, 1))
        end = gain * (read(x, i - at1, w1, 0) + read(x, i - at2, w2, 0))
        q = x[i - 1]
        a1 = begin - stiffness * q - damping * v
        v2 = v + 0.5 * h * a1
        a2 = middle - stiffness * (q + 0.5 * h * v) - damping * v2
        v3 = v + 0.5 * h * a2
        a3 = middle - stiffness * (q + 0.5 * h * v2) - damping * v3
        v4 = v + h * a3
        a4 = end - stiffness * (q + h * v3) - damping * v4
        x[i] = q + h / 6.0 * (v + 2.0 * (v2 + v3) + v4)
        v += h / 6.0 * (a1 + 2.0 * (a2 + a3) + a4)
        begin = end
    return v


@njit(cache=True, fastmath=False, forceinline=True)
def pull(peer, x, v, met1, met2):
    """Return the acceleration with tools that may have lost contact."""
    force = -peer.c * v - peer.k * x
    chip1, chip2 = peer.h0 + x - met1, peer.h0 - x - met2
    if chip1 > 0.0:
        force -= peer.K * chip1 + peer.cp * v + peer.flank * peer.cp * max(v - peer.limit, 0.0)
    if chip2 > 0.0:
        force += peer.K * chip2 - peer.cp * v + peer.flank * peer.cp * max(-v - peer.limit, 0.0)
    return force / peer.m


@njit(cache=True, fastmath=False)
def remembering(peer, x, left1, left2, first, v):
    """Advance with loss of contact and surfaces that remember, from step `first - 1` to the end of `x`."""
    w1, w2 = np.empty((2, 4)), np.empty((2, 4))
    (at1, half1), (at2, half2) = places(peer.tau1, w1), places(peer.tau2, w2)
    h, mu = peer.h, peer.mu
    met1, met2 = mu * read(left2, first - 1 - at1, w1, 0), mu * read(left1, first - 1 - at2, w2, 0)
    for i in range(first, x.size):
        half_1, half_2 = mu * read(left2, i - 1 - half1, w1, 1), mu * read(left1, i - 1 - half2, w2, 1)
        end_1, end_2 = mu * read(left2, i - at1, w1, 0), mu * read(left1, i - at2, w2, 0)
        q = x[i - 1]
        a1 = pull(peer, q, v, met1, met2)
        v2 = v + 0.5 * h * a1
        a2 = pull(peer, q + 0.5 * h * v, v2, half_1, half_2)
        v3 = v + 0.5 * h * a2
        a3 = pull(peer, q + 0.5 * h * v2, v3, half_1, half_2)
        v4 = v + h * a3
        a4 = pull(peer, q + h * v3, v4, end_1, end_2)
        x[i] = q + h / 6.0 * (v + 2.0 * (v2 + v3) + v4)
        v += h / 6.0 * (a1 + 2.0 * (a2 + a3) + a4)
        met1, met2 = end_1, end_2
        left1[i] = met1 + max(peer.h0 + x[i] - met1, 0.0) - peer.h0
        left2[i] = met2 + max(peer.h0 - x[i] - met2, 0.0) - peer.h0
    return v
