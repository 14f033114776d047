"""Signs of a bad sensor in plain NumPy, all blocks at once."""

import numpy as np

PATIENCE, FLAT, STEEP, ALONE, CLIPPED = 5, 3, 0.02, 0.75, 2


def signs(blocks):
    """Notes of every block of a stream, shape (blocks, n, channels), as a list of sets."""
    return [_signs(blocks[: k + 1]) for k in range(len(blocks))]


def _signs(blocks):
    found = set()
    recent = range(max(len(blocks) - PATIENCE, 0), len(blocks))
    if len(blocks) >= PATIENCE:
        for channel in range(blocks.shape[2]):
            if all(_still(blocks, k, channel) for k in recent):
                found.add("constant")
            if all(_twice(blocks[k, :, channel]) for k in recent):
                found.add("duplicated")
    moves = not all(_still(blocks, len(blocks) - 1, channel) for channel in range(blocks.shape[2]))
    if len(blocks) > 1 and moves and np.array_equal(blocks[-1], blocks[-2]):
        found.add("repeated")
    if sum(_peaks(blocks[: k + 1]) for k in recent) >= CLIPPED:
        found.add("clipped")
    return found


def _still(blocks, k, channel):
    column = blocks[k, :, channel]
    return np.ptp(column) == 0.0 and (k == 0 or column[0] == blocks[k - 1, -1, channel])


def _twice(column):
    same = np.diff(column) == 0.0
    even, odd = same[0::2].sum(), same[1::2].sum()
    half = (len(column) - 1) // 2
    return max(even, odd) >= half and min(even, odd) < ALONE * half


def _peaks(blocks):
    """Runs of FLAT equal samples at an end of the range so far, reached by a steep step, in the last block."""
    count = 0
    for channel in range(blocks.shape[2]):
        column, so_far = blocks[-1, :, channel], blocks[:, :, channel]
        for i in range(FLAT, len(column)):
            run = column[i - FLAT + 1 : i + 1]
            begins = np.ptp(run) == 0.0 and column[i - FLAT] != run[0]
            at_end = run[0] in (so_far.min(), so_far.max())
            if begins and at_end and abs(run[0] - column[i - FLAT]) > STEEP * np.ptp(column):
                count += 1
    return count
