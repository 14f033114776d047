"""Compiled loops of the observers.

=========  =====================  =================================================================
symbol     name in the API        meaning
=========  =====================  =================================================================
d1, d2     (features)             y[n] - y[n-2] and y[n] - 2 y[n-1] + y[n-2], exact on whole counts
=========  =====================  =================================================================
"""

import numpy as np
from numba import njit

from chatter._kernels import FINE, biquads, first_non_finite


@njit(cache=True, fastmath=False)
def _to_counts(position, column, q, start, origin, counts):
    """Write one signal as counts from its first sample (as travel where the resolution is 0); return that origin."""
    if start:
        origin = np.rint(position[0, column] / q) if q > 0.0 else position[0, column]
    for i in range(position.shape[0]):
        y = position[i, column]
        counts[i] = (np.rint(y / q) if q > 0.0 else y) - origin
    return origin


@njit(cache=True, fastmath=False)
def _delay(counts, first, weights, aligned):
    """Write counts as they were ``first`` samples before, between samples where there are weights to do so."""
    newest = counts.size - aligned.size - first
    for i in range(aligned.size):
        aligned[i] = weights[0] * counts[newest + i]
    for j in range(1, weights.size):
        for i in range(aligned.size):
            aligned[i] += weights[j] * counts[newest - j + i]


@njit(cache=True, fastmath=False)
def _balance(aligned, gains, still, out):
    """Add to both balances, shape (n, 2), what one aligned signal of n + 2 samples weighs in them."""
    for i in range(out.shape[0]):
        y0, y1, y2 = aligned[i + 2], aligned[i + 1], aligned[i]
        d1, d2 = y0 - y2, (y0 - y1) - (y1 - y2)
        if i < still:
            d1, d2 = 0.0, 0.0
        out[i, 0] += gains[0, 0] * y1 + gains[0, 1] * d1 + gains[0, 2] * d2
        out[i, 1] += gains[1, 0] * y1 + gains[1, 1] * d1 + gains[1, 2] * d2


@njit(cache=True, fastmath=False)
def residuals(motor, stage, seen, resolution, first, weights, gains, origin, history, buffer, out):
    """Write the force balance of both stages, one sample behind the aligned signals.

    Parameters: motor, stage and out (n, 2); seen: samples before this block; resolution, first (4,) and weights
    (4, taps) of the signals x motor, y motor, x stage, y stage; gains (4, 2, 3): what level, d1 and d2 of each signal
    add to each balance; origin (4,) and history (4, reach): state; buffer (2, reach + n): scratch.
    """
    bad, other = first_non_finite(motor), first_non_finite(stage)
    if bad != FINE or other != FINE:
        return other if bad == FINE or FINE < other < bad else bad
    samples, reach = motor.shape[0], history.shape[1]
    if samples == 0:
        return FINE
    out[:] = 0.0
    counts, aligned = buffer[0], buffer[1, : samples + 2]
    for j in range(4):
        if seen == 0:
            history[j] = 0.0
        counts[:reach] = history[j]
        signal = motor if j < 2 else stage
        origin[j] = _to_counts(signal, j % 2, resolution[j], seen == 0, origin[j], counts[reach:])
        history[j] = counts[samples:]
        _delay(counts, first[j], weights[j], aligned)
        _balance(aligned, gains[j], reach - seen, out)
    return FINE


@njit(cache=True, fastmath=False)
def smooth_and_turn(residual, start, sections, steady, delays, turn, idling, out):
    """Low-pass both balances and turn the loads of the slides into the force on the tool, shape (n, 2)."""
    biquads(residual, start, sections, steady, delays, out)
    for i in range(out.shape[0]):
        x, y = out[i, 0], out[i, 1]
        out[i, 0] = turn[0, 0] * x + turn[0, 1] * y - idling[0]
        out[i, 1] = turn[1, 0] * x + turn[1, 1] * y - idling[1]
