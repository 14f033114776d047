"""Compiled loops of the sliding spectrum.

Time is counted from the start of the present epoch of ``window`` samples, so that the sample that enters and the one
that leaves meet the same twiddle. An epoch is cut into spans; within one, the sums of both run with the twiddles of
its first samples. At its end they are turned to the start of the epoch and added there with the rounding error
carried along. At the end of the epoch what came in replaces what had been kept: nothing lasts longer than that.

=============  ======================  ==============================================================
symbol         name in the API         meaning
=============  ======================  ==============================================================
w(i)           (tables)                exp(-2j pi f_k i / f_s): rows 0 ... span, then every span-th, then window
OLD, NEW       (state)                 sums of y w over the present span, of samples leaving and entering
BASE           (state)                 the window's sum at the start of the span, turned to it
KEPT, FRESH    (state)                 last epoch's sum less what left, sum of what entered; each with its error
X, T           spectrum                X = T conj(w), T = BASE - OLD + w(window) NEW
=============  ======================  ==============================================================

All arrays run by tiles of 16 bins: tables [tile][row][cos, -sin][16], state [tile][channel][part][re, im][16].
"""

from numba import njit

from chatter._kernels import FINE, first_non_finite
from chatter._simd import add, fma, load, mul, splat, store, store_pairs, sub

TILE = 16
PAIR = 2 * TILE
OLD, NEW, BASE, KEPT, KEPT_ERROR, FRESH, FRESH_ERROR, PARTS = 0, 1, 2, 3, 4, 5, 6, 7


@njit(cache=True, fastmath=False)
def _emit(old_re, old_im, new_re, new_im, state, base, tables, turn, fine, power, out, at):
    """Write eight bins of the spectrum, or of its squared size."""
    c, s = load(tables, turn), load(tables, turn + TILE)
    re = sub(load(state, base), old_re)
    im = sub(load(state, base + TILE), old_im)
    re = sub(fma(c, new_re, re), mul(s, new_im))
    im = fma(c, new_im, fma(s, new_re, im))
    if power:
        store(out, at, fma(re, re, mul(im, im)))
    else:
        c, s = load(tables, fine), load(tables, fine + TILE)
        store_pairs(out, 2 * at, fma(re, c, mul(im, s)), sub(mul(im, c), mul(re, s)))


@njit(cache=True, fastmath=False)
def _put(state, at, a, b, c, d):
    """Write one part of the state of a tile."""
    store(state, at, a)
    store(state, at + 8, b)
    store(state, at + 16, c)
    store(state, at + 24, d)


@njit(cache=True, fastmath=False)
def _slide(series, channel, count, hop, left, tables, row, turn, state, place, power, out, at, step):
    """Advance one channel in one tile by ``count`` samples; write every hop-th, the first after ``left``."""
    o, n, b = place + OLD * PAIR, place + NEW * PAIR, place + BASE * PAIR
    o0, o1, o2, o3 = load(state, o), load(state, o + 8), load(state, o + 16), load(state, o + 24)
    n0, n1, n2, n3 = load(state, n), load(state, n + 8), load(state, n + 16), load(state, n + 24)
    i = 0
    while True:
        stop = min(count, i + left)
        left -= stop - i
        while i < stop:
            leaving, entering = splat(series[channel, 0, i]), splat(series[channel, 1, i])
            c0, c1, s0, s1 = load(tables, row), load(tables, row + 8), load(tables, row + 16), load(tables, row + 24)
            o0, o1, o2, o3 = fma(leaving, c0, o0), fma(leaving, c1, o1), fma(leaving, s0, o2), fma(leaving, s1, o3)
            n0, n1, n2, n3 = fma(entering, c0, n0), fma(entering, c1, n1), fma(entering, s0, n2), fma(entering, s1, n3)
            row += PAIR
            i += 1
        if left == 0:
            _emit(o0, o2, n0, n2, state, b, tables, turn, row, power, out, at)
            _emit(o1, o3, n1, n3, state, b + 8, tables, turn + 8, row + 8, power, out, at + 8)
            at += step
            left = hop
        if i >= count:
            break
    _put(state, o, o0, o1, o2, o3)
    _put(state, n, n0, n1, n2, n3)


@njit(cache=True, fastmath=False)
def _carry(state, total, error, value):
    """Add to eight totals, and to their errors what that rounding lost (Knuth's two-sum)."""
    a = load(state, total)
    t = add(a, value)
    part = sub(t, a)
    lost = add(sub(a, sub(t, part)), sub(value, part))
    store(state, total, t)
    store(state, error, add(load(state, error), lost))


@njit(cache=True, fastmath=False)
def _close_span(tables, coarse, following, turn, state, place, epoch_ends):
    """Take the sums of a finished span into the epoch and start the next, eight bins of one channel."""
    c, s = load(tables, coarse), load(tables, coarse + TILE)
    zero = splat(0.0)
    for part, total, sign in ((NEW, FRESH, 1.0), (OLD, KEPT, -1.0)):
        p, t = place + part * PAIR, place + total * PAIR
        re, im = mul(splat(sign), load(state, p)), mul(splat(sign), load(state, p + TILE))
        _carry(state, t, t + PAIR, sub(mul(re, c), mul(im, s)))
        _carry(state, t + TILE, t + PAIR + TILE, fma(re, s, mul(im, c)))
        store(state, p, zero)
        store(state, p + TILE, zero)
    kept, fresh = place + KEPT * PAIR, place + FRESH * PAIR
    if epoch_ends:
        for i in range(0, 2 * PAIR, TILE):
            store(state, kept + i, load(state, fresh + i))
            store(state, fresh + i, zero)
    re = add(load(state, kept), load(state, kept + PAIR))
    im = add(load(state, kept + TILE), load(state, kept + PAIR + TILE))
    new_re = add(load(state, fresh), load(state, fresh + PAIR))
    new_im = add(load(state, fresh + TILE), load(state, fresh + PAIR + TILE))
    c, s = load(tables, turn), load(tables, turn + TILE)
    re = sub(fma(c, new_re, re), mul(s, new_im))
    im = fma(c, new_im, fma(s, new_re, im))
    c, s = load(tables, following), load(tables, following + TILE)
    store(state, place + BASE * PAIR, fma(re, c, mul(im, s)))
    store(state, place + BASE * PAIR + TILE, sub(mul(im, c), mul(re, s)))


@njit(cache=True, fastmath=False)
def _exchange(block, done, ring, position, count, series):
    """Take samples out of the ring and into ``series``, (channels, leaving and entering, span), and put new ones in."""
    for i in range(count):
        for c in range(ring.shape[1]):
            series[c, 0, i] = ring[position + i, c]
            series[c, 1, i] = block[done + i, c]
            ring[position + i, c] = block[done + i, c]


@njit(cache=True, fastmath=False)
def sliding_dft(block, hop, power, ring, series, tables, state, tiles, position, out):
    """Advance the window over a block; write the spectrum (or its squared size) after every hop-th sample.

    Parameters: block (n, channels); ring (window, channels); series (channels, 2, span): scratch; tables and state as
    above, flat; position: samples into the epoch; out, flat: (spectra, channels, 16 tiles) numbers or pairs of them.
    An empty block with a hop of 0 writes the present spectrum.
    """
    bad = first_non_finite(block)
    if bad != FINE:
        return bad
    window, channels = ring.shape
    span = series.shape[2]
    rows = tables.size // (PAIR * tiles)
    samples, done, step = block.shape[0], 0, channels * tiles * TILE
    while True:
        first = position % span
        count = min(span - first, window - position, samples - done)
        _exchange(block, done, ring, position, count, series)
        index, left = 0, 0
        if hop > 0:
            index, left = done // hop, hop - done % hop
        coarse = span + 1 + position // span
        end = position + count
        closes = end == window or (count > 0 and end % span == 0)
        following = span + 1 if end == window else coarse + 1
        for tile in range(tiles):
            table = tile * rows * PAIR
            turn = table + (rows - 1) * PAIR
            for c in range(channels):
                place = (tile * channels + c) * PARTS * PAIR
                at = index * step + (c * tiles + tile) * TILE
                row = table + first * PAIR
                _slide(series, c, count, hop, left, tables, row, turn, state, place, power, out, at, step)
                if closes:
                    for half in (0, 8):
                        now, then = table + coarse * PAIR + half, table + following * PAIR + half
                        _close_span(tables, now, then, turn + half, state, place + half, end == window)
        done += count
        position = 0 if end == window else end
        if done >= samples:
            return FINE
