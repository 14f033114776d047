"""Compiled loops over the samples as they came: what the checks of the input count.

=========  =================  ==================================================
symbol     name in the API    meaning
=========  =================  ==================================================
y          block              samples
=========  =================  ==================================================
"""

from numba import njit

STILL, EVEN, ODD, PEAKS = range(4)
"""Columns of the counts: equal neighbours, those at even and at odd places, clipped peaks."""
COLUMNS = 4


@njit(cache=True, fastmath=False)
def count(block, flat, steep, ends, out):
    """Count equal neighbours and clipped peaks of every channel, and widen the ends of its range.

    A clipped peak is a run of `flat` equal samples at an end of the range that the signal reached by a step of more
    than `steep` times the range of the block.

    Parameters: block (n, channels); ends (2, channels): lowest and highest so far; out (channels, COLUMNS).
    """
    for c in range(block.shape[1]):
        low, high = block[0, c], block[0, c]
        even, odd = 0, 0
        for i in range(1, block.shape[0]):
            y = block[i, c]
            low, high = min(low, y), max(high, y)
            if y == block[i - 1, c]:
                if i % 2 == 1:
                    even += 1
                else:
                    odd += 1
        ends[0, c], ends[1, c] = min(ends[0, c], low), max(ends[1, c], high)
        step, peaks, run = steep * (high - low), 0, 1
        for i in range(1, block.shape[0]):
            y = block[i, c]
            run = run + 1 if y == block[i - 1, c] else 1
            at_end = y == ends[0, c] or y == ends[1, c]
            if run == flat and at_end and i >= flat and abs(y - block[i - flat, c]) > step:
                peaks += 1
        out[c, STILL], out[c, EVEN], out[c, ODD], out[c, PEAKS] = even + odd, even, odd, peaks
