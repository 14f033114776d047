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
def _to_counts(signals, resolution, origin, start, buffer, reach):
    """Append four signals to buffer as counts from their first sample (as travel where the resolution is 0)."""
    for j in range(4):
        position, column = signals[j // 2], j % 2
        q = resolution[j]
        if start:
            first = position[0, column]
            origin[j] = np.rint(first / q) if q > 0.0 else first
            buffer[:reach, j] = 0.0
        for i in range(position.shape[0]):
            y = position[i, column]
            buffer[reach + i, j] = (np.rint(y / q) if q > 0.0 else y) - origin[j]


@njit(cache=True, fastmath=False)
def _delay(buffer, column, row, first, weights):
    """Return one signal read ``first`` samples before a row, between samples where there are weights to do so."""
    total = 0.0
    for i in range(weights.size):
        total += weights[i] * buffer[row - first - i, column]
    return total


@njit(cache=True, fastmath=False)
def residuals(motor, stage, seen, resolution, first, weights, gains, origin, history, buffer, out):
    """Write the force balance of both stages, one sample behind the aligned signals.

    Parameters: motor, stage and out (n, 2); seen: samples before this block; resolution, first (4,) and weights
    (4, taps) of the signals x motor, y motor, x stage, y stage; gains (2, 4, 3): what level, d1 and d2 of each signal
    add to each balance; origin (4,) and history (reach, 4): state; buffer (reach + n, 4): scratch.
    """
    bad, other = first_non_finite(motor), first_non_finite(stage)
    if bad != FINE or other != FINE:
        return other if bad == FINE or FINE < other < bad else bad
    if motor.shape[0] == 0:
        return FINE
    reach = history.shape[0]
    buffer[:reach] = history
    _to_counts((motor, stage), resolution, origin, seen == 0, buffer, reach)
    for i in range(motor.shape[0]):
        valid = seen + i >= reach
        out[i, 0], out[i, 1] = 0.0, 0.0
        for j in range(4):
            y0 = _delay(buffer, j, reach + i, first[j], weights[j])
            y1 = _delay(buffer, j, reach + i - 1, first[j], weights[j])
            y2 = _delay(buffer, j, reach + i - 2, first[j], weights[j])
            d1, d2 = y0 - y2, (y0 - y1) - (y1 - y2)
            for a in range(2):
                out[i, a] += gains[a, j, 0] * y1
                if valid:
                    out[i, a] += gains[a, j, 1] * d1 + gains[a, j, 2] * d2
    history[:] = buffer[motor.shape[0] :]
    return FINE


@njit(cache=True, fastmath=False)
def smooth_and_turn(residual, start, sections, steady, delays, turn, idling, out):
    """Low-pass both balances and turn the loads of the slides into the force on the tool, shape (n, 2)."""
    biquads(residual, start, sections, steady, delays, out)
    for i in range(out.shape[0]):
        x, y = out[i, 0], out[i, 1]
        out[i, 0] = turn[0, 0] * x + turn[0, 1] * y - idling[0]
        out[i, 1] = turn[1, 0] * x + turn[1, 1] * y - idling[1]
