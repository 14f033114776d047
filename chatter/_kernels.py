"""Compiled loops of the package.

Every kernel that takes a block looks at all of it before it changes any state and returns ``FINE`` or the row of the
first sample that is not finite.

=========  =====================  =================================================================
symbol     name in the API        meaning
=========  =====================  =================================================================
y          block                  samples
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
