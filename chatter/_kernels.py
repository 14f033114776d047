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
