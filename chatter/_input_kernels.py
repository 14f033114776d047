"""Compiled loops over the samples as they came: signs that they are not what the sensor should give.

=========  =================  ==================================================
symbol     name in the API    meaning
=========  =================  ==================================================
y          block              samples
=========  =================  ==================================================
"""

from numba import njit

CONSTANT, REPEATED, DUPLICATED, CLIPPED = 1, 2, 4, 8
"""Signs, one bit each."""


@njit(cache=True, fastmath=False)
def look(block, last, known, flat, steep, alone, enough, ends, constant, doubled, peaks):
    """Count equal neighbours and clipped peaks of a block, go on with the counts, and return the signs.

    A clipped peak is a run of `flat` equal samples at an end of the range that the signal reached by a step of more
    than `steep` times the range of the block.

    Parameters: block (n, channels); last (n, channels): the block before, if `known`, then this one; alone: part of
    the other neighbours that may be equal where every value is stored twice; enough: clipped peaks that tell; ends (2,
    channels): lowest and highest so far; constant, doubled (channels,): blocks in a row; peaks (patience,): clipped
    peaks of the last blocks, and after so many blocks in a row a sign is told.
    """
    pairs, patience = block.shape[0] - 1, peaks.size
    same, moved, signs, found = known, False, 0, 0
    for c in range(block.shape[1]):
        low, high = block[0, c], block[0, c]
        even, odd = 0, 0
        for i in range(1, pairs + 1):
            y = block[i, c]
            low, high = min(low, y), max(high, y)
            if y == block[i - 1, c]:
                if i % 2 == 1:
                    even += 1
                else:
                    odd += 1
        ends[0, c], ends[1, c] = min(ends[0, c], low), max(ends[1, c], high)
        found += _clipped_peaks(block, c, flat, steep * (high - low), ends)
        still = even + odd == pairs and (not known or block[0, c] == last[pairs, c])
        moved = moved or not still
        constant[c] = constant[c] + 1 if still else 0
        twice = max(even, odd) >= pairs // 2 and min(even, odd) < alone * (pairs // 2)
        doubled[c] = doubled[c] + 1 if twice else 0
        if constant[c] >= patience:
            signs |= CONSTANT
        if doubled[c] >= patience:
            signs |= DUPLICATED
        for i in range(pairs + 1):
            same = same and block[i, c] == last[i, c]
            last[i, c] = block[i, c]
    told = found
    for i in range(1, patience):
        told += peaks[i]
        peaks[i - 1] = peaks[i]
    peaks[patience - 1] = found
    if same and moved:
        signs |= REPEATED
    return signs | CLIPPED if told >= enough else signs


@njit(cache=True, fastmath=False)
def _clipped_peaks(block, c, flat, step, ends):
    peaks, run = 0, 1
    for i in range(1, block.shape[0]):
        y = block[i, c]
        run = run + 1 if y == block[i - 1, c] else 1
        at_end = y == ends[0, c] or y == ends[1, c]
        if run == flat and at_end and i >= flat and abs(y - block[i - flat, c]) > step:
            peaks += 1
    return peaks
