"""Compiled loops of the observers.

=========  =====================  =================================================================
symbol     name in the API        meaning
=========  =====================  =================================================================
d1, d2     (gains)                y[n] - y[n-2] and y[n] - 2 y[n-1] + y[n-2], exact on whole counts
e          omega_current          exp(-omega_cc T): what is left of a thrust after one sample
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
def _to_current(thrust, column, e, start, held, counts):
    """Write the thrust that a held command has become after the lag of the current loop; e < 0: as commanded."""
    if e < 0.0:
        for i in range(thrust.shape[0]):
            counts[i] = thrust[i, column]
        return
    if start:
        held[0] = held[1] = thrust[0, column]
    y, before = held[0], held[1]
    for i in range(thrust.shape[0]):
        y = e * y + (1.0 - e) * before
        before = thrust[i, column]
        counts[i] = y
    held[0], held[1] = y, before


@njit(cache=True, fastmath=False)
def _delay(counts, first, weights, aligned):
    """Write counts as they were ``first`` samples before, between samples where there are weights to do so."""
    newest = counts.size - aligned.size - first
    for i in range(aligned.size):
        aligned[i] = weights[0] * counts[newest + i]
    for j in range(1, weights.size):
        if weights[j] != 0.0:
            for i in range(aligned.size):
                aligned[i] += weights[j] * counts[newest - j + i]


@njit(cache=True, fastmath=False)
def _balance(aligned, gains, still, out):
    """Add to the balances, shape (n, rows), what one aligned signal of n + 2 samples weighs in them."""
    for row in range(out.shape[1]):
        level, slope, curve = gains[row]
        if level == 0.0 and slope == 0.0 and curve == 0.0:
            continue
        for i in range(out.shape[0]):
            y0, y1, y2 = aligned[i + 2], aligned[i + 1], aligned[i]
            if i < still:
                out[i, row] += level * y1
            else:
                out[i, row] += level * y1 + slope * (y0 - y2) + curve * ((y0 - y1) - (y1 - y2))


@njit(cache=True, fastmath=False)
def residuals(
    motor, stage, thrust, seen, resolution, first, weights, gains, lag, origin, held, history, buffer, out
):
    """Write the force balances, one sample behind the aligned signals.

    Parameters: motor, stage, thrust (n, any), thrust without columns where no balance needs it; seen: samples before
    this block; resolution, first (signals,) and weights (signals, taps) of the signals, all motors, then all stages,
    then all thrusts; gains (signals, rows, 3): what level, d1 and d2 of each signal add to each balance; lag (axes,)
    with held (axes, 2): the current loops; origin (signals,), history (signals, reach): state; buffer (2,
    reach + n): scratch; out (n, rows).
    """
    bad, other = first_non_finite(motor), first_non_finite(stage)
    bad = other if bad == FINE or FINE < other < bad else bad
    if thrust.size > 0:
        other = first_non_finite(thrust)
        bad = other if bad == FINE or FINE < other < bad else bad
    if bad != FINE:
        return bad
    samples, motors, reach = motor.shape[0], motor.shape[1], history.shape[1]
    positions = motors + stage.shape[1]
    if samples == 0:
        return FINE
    out[:] = 0.0
    counts, aligned = buffer[0], buffer[1, : samples + 2]
    for j in range(gains.shape[0]):
        if seen == 0:
            history[j] = 0.0
        counts[:reach] = history[j]
        if j >= positions:
            k = j - positions
            _to_current(thrust, k, lag[k], seen == 0, held[k], counts[reach:])
            if seen == 0:
                counts[:reach] = counts[reach]
        else:
            signal, column = (motor, j) if j < motors else (stage, j - motors)
            origin[j] = _to_counts(signal, column, resolution[j], seen == 0, origin[j], counts[reach:])
        history[j] = counts[samples:]
        _delay(counts, first[j], weights[j], aligned)
        _balance(aligned, gains[j], reach - seen, out)
    return FINE


@njit(cache=True, fastmath=False)
def blend(residual, e, start, slow, out):
    """Add to each stage balance the motor balance beside it after a first-order low-pass.

    Parameters: residual (n, 2 axes): stage balances, then motor balances; e (axes,): exp(-omega T); slow (axes, 2):
    last output and input; out (n, axes). Bilinear, so that both keep one phase at low frequency.
    """
    axes = out.shape[1]
    for k in range(axes):
        y, before = slow[k, 0], slow[k, 1]
        if start:
            y = before = residual[0, axes + k]
        b = 0.5 * (1.0 - e[k])
        for i in range(out.shape[0]):
            x = residual[i, axes + k]
            y = e[k] * y + b * (x + before)
            before = x
            out[i, k] = residual[i, k] + y
        slow[k, 0], slow[k, 1] = y, before


@njit(cache=True, fastmath=False)
def smooth_and_turn(residual, start, sections, steady, delays, turn, idling, out):
    """Filter the balances and turn the loads of the slides into the force on the tool, shape (n, axes)."""
    biquads(residual, start, sections, steady, delays, out)
    if out.shape[1] == 1:
        for i in range(out.shape[0]):
            out[i, 0] = turn[0, 0] * out[i, 0] - idling[0]
        return
    for i in range(out.shape[0]):
        x, y = out[i, 0], out[i, 1]
        out[i, 0] = turn[0, 0] * x + turn[0, 1] * y - idling[0]
        out[i, 1] = turn[1, 0] * x + turn[1, 1] * y - idling[1]
