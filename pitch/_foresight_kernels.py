"""Strongest root of many one-mode processes, started where the envelope of the roots is high.

On a root D0(s) + 2 K mu cosh(s h) exp(-s T) = 0, with T = pi/Omega. For many waves in a delay |.| of both terms on the
imaginary axis gives the growth that a root near w would have, and their angles say where the next root lies; Newton's
method ends in a few steps from there. Symbols as in `pitch.stability`.
"""

import cmath
import math

import numpy as np
from numba import njit

BEHIND = 1.0
"""Starts whose envelope lies below the highest one by more than this over the half turn are left out."""
LOWEST = 0.97
"""Roots below this part of the natural frequency are waves of the delays alone, which hardly know the pitch."""
PER_LINE = 3
"""Starts from one line of a family to the next."""
STEPS = 12
SETTLED = 1e-9
MOST_STARTS = 1000


@njit(cache=True, fastmath=False)
def _envelope(m, C, k2, amplitude, T, h, w):
    """Return the growth (1/s) that a root near `w` would have, and the step (rad/s) to the nearest one."""
    bar = complex(k2 - m * w * w, C * w)
    wave = amplitude * math.cos(w * h)
    if wave == 0.0:
        return -1e9, 0.0
    ratio = -wave / bar
    turn = math.pi * 2.0
    off = cmath.phase(ratio) - w * T
    off -= turn * math.floor(off / turn + 0.5)
    return math.log(abs(ratio)) / T, off / T


@njit(cache=True, fastmath=False)
def _newton(m, C, k2, half, T, h, s, reach):
    """Return the root near `s` and whether it settled within `reach` (rad/s)."""
    start = s
    for _ in range(STEPS):
        if s.real * T < -40.0:
            return s, False
        one, two = half * cmath.exp(-s * (T + h)), half * cmath.exp(-s * (T - h))
        value = (m * s + C) * s + k2 + one + two
        slope = 2.0 * m * s + C - (T + h) * one - (T - h) * two
        if slope == 0.0:
            return s, False
        step = value / slope
        size = abs(step)
        if size > 0.15 * reach:
            step *= 0.15 * reach / size
        s -= step
        if abs(s - start) > 1.5 * reach:
            return s, False
        if size < SETTLED * abs(s):
            return s, True
    return s, False


@njit(cache=True, fastmath=False)
def strongest(process, T, h, near, env, at, out):
    """Fill `out` with growth and frequency of the strongest root, and of the one nearest to `near` (rad/s).

    Parameters
    ----------
    process : ndarray
        m, C, k, mu, K of each row, shape (n, 5).
    T, h : ndarray
        Half turn and half of the difference of the delays (s), shape (n,) each.
    near : float
        Line that is looked for (rad/s); 0 for none.
    env, at : ndarray
        Scratch, shape (MOST_STARTS,).
    out : ndarray
        Growth (1/s), angular frequency (rad/s) of the strongest; the same of the nearest, shape (n, 4).
    """
    for i in range(process.shape[0]):
        m, C, k, mu, K = process[i, 0], process[i, 1], process[i, 2], process[i, 3], process[i, 4]
        half, k2, delay, shift = K * mu, k + 2.0 * K, T[i], h[i]
        spacing = 2.0 * math.pi / delay
        step = spacing / PER_LINE
        low, high = LOWEST * math.sqrt(k / m), 1.15 * math.sqrt((k + 2.0 * K * (1.0 + abs(mu))) / m)
        count = min(int((high - low) / step) + 2, MOST_STARTS)
        highest = -1e9
        for j in range(count):
            w = low + step * j
            env[j], off = _envelope(m, C, k2, 2.0 * half, delay, shift, w)
            at[j] = w + off
            highest = max(highest, env[j])
        out[i, 0], out[i, 1], out[i, 2], out[i, 3] = -1e9, 0.0, -1e9, 0.0
        for j in range(count):
            close = near > 0.0 and abs(at[j] - near) < spacing
            if env[j] < highest - BEHIND / delay and not close:
                continue
            s, settled = _newton(m, C, k2, half, delay, shift, complex(max(env[j], -20.0 / delay), at[j]), spacing)
            if not settled or s.imag < 0.97 * low:
                continue
            if s.real > out[i, 0]:
                out[i, 0], out[i, 1] = s.real, s.imag
            if close and abs(s.imag - near) < abs(out[i, 3] - near):
                out[i, 2], out[i, 3] = s.real, s.imag


def scratch() -> tuple[np.ndarray, np.ndarray]:
    """Return what `strongest` works in."""
    return np.empty(MOST_STARTS), np.empty(MOST_STARTS)
