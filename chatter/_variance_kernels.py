"""Compiled loops of the moving variance.

Sums run forward through the present window-long epoch and backward through the one before, both about the first sample
of the present epoch: it lies in every window concerned, so the shift never spoils the difference of sums. Eight samples
are summed at a time; a block that ends between them leaves the sums before them, and the next one takes them up again,
so that the cutting of the stream changes no bit.

==========  =============================================================================
symbol      meaning
==========  =============================================================================
ring        (channels, padded): samples of the present epoch, then the rest of the last
sums        (channels, 2, padded): of the deviations, and of their squares, behind a sample
running     (channels, 3): reference; sum and sum of squares before the present eight
==========  =============================================================================
"""

from numba import njit

from chatter._kernels import FINE, first_non_finite
from chatter._simd import add, first, get, larger, last, load, memory, mul, put, scan, scan_back, splat, store, sub


@njit(cache=True, fastmath=False)
def _sum_backward(m, reference, ring, sums, window, padded):
    """Write the sums behind each sample of a finished epoch: a place before those from it on."""
    for i in range(ring + window, ring + padded):
        put(m, i, reference)
    origin, total, square = splat(reference), splat(0.0), splat(0.0)
    squares = sums + padded
    for i in range(padded - 8, -1, -8):
        y = sub(load(m, ring + i), origin)
        s, q = add(scan_back(y), total), add(scan_back(mul(y, y)), square)
        store(m, sums + i - 1, s)
        store(m, squares + i - 1, q)
        total, square = first(s), first(q)
    put(m, squares - 1, 0.0)  # nothing is behind the last sample
    put(m, squares + padded - 1, 0.0)


@njit(cache=True, fastmath=False)
def _take(m, block, at, channels, ring, count):
    """Copy samples of one channel into the ring."""
    i = 0
    while channels == 1 and i + 8 <= count:
        store(m, ring + i, load(block, at + i))
        i += 8
    while i < count:
        put(m, ring + i, get(block, at + i * channels))
        i += 1


@njit(cache=True, fastmath=False)
def _run(m, ring, sums, padded, window, begin, end, grows, running, out, to):
    """Write the variance after each sample of the epoch, from the eight that hold ``begin`` on; ``to``: its place."""
    origin, total, square = splat(get(m, running)), splat(get(m, running + 1)), splat(get(m, running + 2))
    share, i = splat(1.0 / window), begin - begin % 8
    to += i - begin
    while i < end:
        y = sub(load(m, ring + i), origin)
        s, q = add(total, scan(y)), add(square, scan(mul(y, y)))
        if i + 8 <= end:
            total, square = last(s), last(q)
        if grows:
            store(out, to, s)
            store(m, sums, q)  # nobody has written there yet
            for k in range(8):
                seen = i + k + 1
                mean = get(out, to + k) / seen
                put(out, to + k, max(get(m, sums + k) / seen - mean * mean, 0.0))
        else:
            mean = mul(add(s, load(m, sums + i)), share)
            variance = sub(mul(add(q, load(m, sums + padded + i)), share), mul(mean, mean))
            store(out, to, larger(variance, splat(0.0)))
        i += 8
        to += 8
    store(out, to, total)  # behind what is returned
    put(m, running + 1, get(out, to))
    store(out, to, square)
    put(m, running + 2, get(out, to))


@njit(cache=True, fastmath=False)
def moving_variance(block, seen, window, work, out):
    """Write the population variance of the last samples after every sample of a block.

    Parameters: block (n, channels); seen: samples before this block; work (channels, 3 padded + 8): ring, sums and
    running; out (channels, n + 24): from place 8 on what is wanted, scratch around it.
    """
    bad = first_non_finite(block)
    if bad != FINE:
        return bad
    count, channels = block.shape
    padded = (work.shape[1] - 8) // 3
    m, y, o = memory(work), memory(block), memory(out)
    for channel in range(channels):
        ring = channel * work.shape[1]
        sums, running, start = ring + padded, ring + 3 * padded, 0
        while start < count:
            position = (seen + start) % window
            taken = min(window - position, count - start)
            if position == 0:
                reference = block[start, channel]
                if seen + start > 0:
                    _sum_backward(m, reference, ring, sums, window, padded)
                put(m, running, reference)
                put(m, running + 1, 0.0)
                put(m, running + 2, 0.0)
            _take(m, y, start * channels + channel, channels, ring + position, taken)
            grows, to = seen + start < window, channel * out.shape[1] + 8 + start
            _run(m, ring, sums, padded, window, position, position + taken, grows, running, o, to)
            start += taken
    return FINE
