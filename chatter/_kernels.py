"""Compiled loops of the package.

Every kernel that takes a block looks at all of it before it changes any state and returns ``FINE`` or the row of the
first sample that is not finite.

=========  =====================  =================================================================
symbol     name in the API        meaning
=========  =====================  =================================================================
X, y       spectrum, block        X_k = sum_i y[i] exp(-2j pi f_k i / f_s)
N          window                 samples in the window
P, Q, B    (state)                sums over the last whole window, its part that left, the new part
c, s       (tables)               cosine and sine of 2 pi f_k i / f_s
b, a, z    sections, state        numerator, denominator and state of a second-order section
=========  =====================  =================================================================
"""

import numpy as np
from numba import njit

FINE = -1
LARGEST = np.finfo(np.float64).max


@njit(cache=True, fastmath=False)
def first_non_finite(block):
    """Return the row of the first sample that is not finite, or FINE."""
    bad = 0
    flat = block.reshape(block.size)
    for i in range(flat.size):
        bad |= not abs(flat[i]) <= LARGEST
    if bad:
        for i in range(flat.size):
            if not np.isfinite(flat[i]):
                return i // block.shape[1]
    return FINE


@njit(cache=True, fastmath=False)
def _project(samples, first, count, channel, tables, row, total):
    """Add sum_i samples[first + i] exp(-2j pi f_k (row + i) / f_s) of one channel to total, shape (2, bins)."""
    bins = total.shape[1]
    cosine, sine = tables[0], tables[1]
    real, imag = total[0], total[1]
    for k in range(bins):
        real[k] = 0.0
        imag[k] = 0.0
    for i in range(count):
        y = samples[first + i, channel]
        for k in range(bins):
            real[k] += y * cosine[row + i, k]
        for k in range(bins):
            imag[k] -= y * sine[row + i, k]


@njit(cache=True, fastmath=False)
def _accumulate(total, sign, tables, row, state):
    """Add sign * total * exp(-2j pi f_k i / f_s), i the time of table row ``row``, to state, shape (2, bins)."""
    for k in range(total.shape[1]):
        c, s = tables[0, row, k], tables[1, row, k]
        state[0, k] += sign * (total[0, k] * c + total[1, k] * s)
        state[1, k] += sign * (total[1, k] * c - total[0, k] * s)


@njit(cache=True, fastmath=False)
def _spectrum(state, channel, tables, span, position, out):
    """Write X = exp(2j pi f_k position / f_s) [P - Q + exp(-2j pi f_k N / f_s) B] of one channel."""
    last = tables.shape[1] - 1
    fine, coarse = position % span, span + position // span
    for k in range(out.size):
        tc, ts = tables[0, last, k], tables[1, last, k]
        re = state[0, channel, 0, k] + state[1, channel, 0, k] * tc + state[1, channel, 1, k] * ts
        im = state[0, channel, 1, k] + state[1, channel, 1, k] * tc - state[1, channel, 0, k] * ts
        fc, fs = tables[0, fine, k], tables[1, fine, k]
        gc, gs = tables[0, coarse, k], tables[1, coarse, k]
        c, s = fc * gc - fs * gs, fs * gc + fc * gs
        out[k] = complex(re * c - im * s, im * c + re * s)


@njit(cache=True, fastmath=False)
def sliding_dft(block, hop, ring, state, tables, span, position, out):
    """Advance the window over a block; write a spectrum after every hop-th sample.

    Time is counted from the start of the present window-long epoch, the twiddles of a sample that enters and of the
    one that leaves are therefore the same row of the tables: rows [0, span) are single samples, the next ones every
    span-th sample, the last one the whole window.

    Parameters: block (n, channels); ring (window, channels); state (3, channels, 2, bins): P - Q, B and scratch;
    tables (2, span + ceil(window / span) + 1, bins); out (n // hop, channels, bins).
    """
    bad = first_non_finite(block)
    if bad != FINE:
        return bad
    window, channels = ring.shape
    done = 0
    while done < block.shape[0]:
        row = position % span
        count = min(span - row, window - position, hop - done % hop, block.shape[0] - done)
        coarse = span + position // span
        for c in range(channels):
            scratch = state[2, c]
            _project(ring, position, count, c, tables, row, scratch)
            _accumulate(scratch, -1.0, tables, coarse, state[0, c])
            _project(block, done, count, c, tables, row, scratch)
            _accumulate(scratch, 1.0, tables, coarse, state[1, c])
        ring[position : position + count] = block[done : done + count]
        done += count
        position += count
        if position == window:
            position = 0
            state[0] = state[1]
            state[1] = 0.0
        if done % hop == 0 and done // hop <= out.shape[0]:
            for c in range(channels):
                _spectrum(state, c, tables, span, position, out[done // hop - 1, c])
    if block.shape[0] == 0:
        for c in range(channels * out.shape[0]):
            _spectrum(state, c, tables, span, position, out[0, c])
    return FINE


@njit(cache=True, fastmath=False)
def _restart_variance(reference, ring, suffix):
    """Fill suffix (2, window) with the sums of (y - reference) and its square from each place to the end of ring."""
    total, square = 0.0, 0.0
    for i in range(ring.size - 1, 0, -1):
        y = ring[i] - reference
        total += y
        square += y * y
        suffix[0, i] = total
        suffix[1, i] = square


@njit(cache=True, fastmath=False)
def moving_variance(block, seen, ring, suffix, running, out):
    """Write the population variance of the last samples after every sample of a block.

    Sums run forward through the present window-long epoch and backward through the one before, both about the first
    sample of the present epoch: it lies in every window concerned, so the shift never spoils the difference of sums.

    Parameters: block and out (n, channels); ring (channels, window); suffix (channels, 2, window); running
    (channels, 3): reference, sum, sum of squares; seen: samples before this block.
    """
    bad = first_non_finite(block)
    if bad != FINE:
        return bad
    window = ring.shape[1]
    for c in range(block.shape[1]):
        reference, total, square = running[c, 0], running[c, 1], running[c, 2]
        position = seen % window
        for i in range(block.shape[0]):
            y = block[i, c]
            if position == 0:
                reference, total, square = y, 0.0, 0.0
                if seen + i > 0:
                    _restart_variance(reference, ring[c], suffix[c])
            ring[c, position] = y
            y -= reference
            total += y
            square += y * y
            position += 1
            if seen + i < window:
                mean = total / position
                out[i, c] = max(square / position - mean * mean, 0.0)
            elif position == window:
                mean = total / window
                out[i, c] = max(square / window - mean * mean, 0.0)
            else:
                mean = (total + suffix[c, 0, position]) / window
                out[i, c] = max((square + suffix[c, 1, position]) / window - mean * mean, 0.0)
            if position == window:
                position = 0
        running[c, 0], running[c, 1], running[c, 2] = reference, total, square
    return FINE


@njit(cache=True, fastmath=False)
def biquads(block, start, sections, steady, state, out):
    """Filter a block through second-order sections (transposed direct form II).

    Parameters: block and out (n, channels); start: this block is the first of the stream, take the state as steady
    times its first sample; sections (sections, 5): b0 b1 b2 a1 a2; steady (sections, 2); state (channels, sections, 2).
    """
    bad = first_non_finite(block)
    if bad != FINE:
        return bad
    if start and block.shape[0] > 0:
        for c in range(block.shape[1]):
            state[c] = steady * block[0, c]
    for c in range(block.shape[1]):
        for i in range(block.shape[0]):
            out[i, c] = block[i, c]
        for j in range(sections.shape[0]):
            b0, b1, b2, a1, a2 = sections[j]
            z1, z2 = state[c, j, 0], state[c, j, 1]
            for i in range(block.shape[0]):
                x = out[i, c]
                y = b0 * x + z1
                z1 = b1 * x - a1 * y + z2
                z2 = b2 * x - a2 * y
                out[i, c] = y
            state[c, j, 0], state[c, j, 1] = z1, z2
    return FINE
