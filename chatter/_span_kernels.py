"""Sums of a whole span of samples by a product of low rank.

Counted from the middle of a span the cosines are even and the sines odd, so half a span of sums and half a span of
differences of samples is enough, and each half of the matrix of a narrow band has few singular values above rounding:
samples -> few coefficients -> bins costs a fifth of samples -> bins.

======  =============================================================================================
symbol  meaning
======  =============================================================================================
V       (span / 2, width) for cosines, then sines: left singular vectors, rows from the middle outward
U       (rank) rows for each tile: what each coefficient gives in 16 bins
======  =============================================================================================
"""

from numba import njit

from chatter._row_kernels import ROW, TILE
from chatter._simd import fma, get, load, put, splat, spread, store


@njit(cache=True, fastmath=False, forceinline=True)
def _halve(m, samples, span, scratch):
    """Write sums, then differences, of the samples at equal distances from the middle of a span."""
    half = span // 2
    for i in range(half):
        early, late = get(m, samples + half - 1 - i), get(m, samples + half + i)
        put(m, scratch + i, early + late)
        put(m, scratch + half + i, early - late)


@njit(cache=True, fastmath=False)
def _fold(m, plan, first, second, third, coefficients):
    """Write the coefficients of three spans of samples, one after the other: of the sums, then of the differences."""
    span, half, width = plan.span, plan.span // 2, plan.width
    _halve(m, first, span, plan.scratch)
    _halve(m, second, span, plan.scratch + span)
    _halve(m, third, span, plan.scratch + 2 * span)
    for part in range(2):
        y, table = plan.scratch + part * half, plan.halves + part * half * width
        for column in range(0, width, TILE):
            a = b = c = d = e = f = splat(0.0)
            at, place = table + column, coefficients + part * width + column
            for i in range(y, y + half):
                u, v = load(m, at), load(m, at + 8)
                one, two, three = spread(m, i), spread(m, i + span), spread(m, i + 2 * span)
                a, b = fma(one, u, a), fma(one, v, b)
                c, d = fma(two, u, c), fma(two, v, d)
                e, f = fma(three, u, e), fma(three, v, f)
                at += width
            store(m, place, a)
            store(m, place + 8, b)
            store(m, place + 2 * width, c)
            store(m, place + 2 * width + 8, d)
            store(m, place + 4 * width, e)
            store(m, place + 4 * width + 8, f)


@njit(cache=True, fastmath=False)
def _zero(m, plan, end):
    """Empty the series behind what has been seen of the span."""
    for series in range(plan.series, plan.series + 2 * plan.channels * plan.span, plan.span):
        for i in range(series + end, series + plan.span):
            put(m, i, 0.0)


@njit(cache=True, fastmath=False, forceinline=True)
def _finished(plan, number, begin, end, length):
    """Return the place of the samples of a finished span: in the ring, or padded in the series if it is cut short."""
    span, channel = begin + number // plan.channels, number % plan.channels
    if span == end - 1 and length < plan.span:
        return plan.series + (2 * channel + 1) * plan.span
    return plan.ring + channel * plan.window + span * plan.span


@njit(cache=True, fastmath=False)
def fold_spans(m, plan, begin, end, length):
    """Write the coefficients of finished spans, for one after the other those of each channel; length: of the last."""
    last = (end - begin) * plan.channels - 1
    if length < plan.span:
        _zero(m, plan, length)
    for number in range(0, last + 1, 3):
        first = _finished(plan, number, begin, end, length)
        second = _finished(plan, min(number + 1, last), begin, end, length)
        third = _finished(plan, min(number + 2, last), begin, end, length)
        _fold(m, plan, first, second, third, plan.coefficients + number * 2 * plan.width)


@njit(cache=True, fastmath=False)
def fold_series(m, plan, end):
    """Write the coefficients of each channel of the span so far: of what changes, or of what leaves and what enters."""
    apart = plan.span if plan.late else 2 * plan.span
    last = (2 * plan.channels if plan.late else plan.channels) - 1
    _zero(m, plan, end)
    for number in range(0, last + 1, 3):
        second, third = min(number + 1, last), min(number + 2, last)
        at, coefficients = plan.series, plan.coefficients + number * 2 * plan.width
        _fold(m, plan, at + number * apart, at + second * apart, at + third * apart, coefficients)


@njit(cache=True, fastmath=False, forceinline=True)
def unfold(m, plan, number, last, table):
    """Return the rows of three sets of coefficients, from ``number`` on; behind ``last`` that one once more."""
    first, width = plan.coefficients + number * 2 * plan.width, plan.width
    second, third = first + min(last - number, 1) * 2 * width, first + min(last - number, 2) * 2 * width
    a = b = c = d = e = f = g = h = p = q = r = s = splat(0.0)
    for i in range(plan.rank):
        u, v = load(m, table), load(m, table + 8)
        x, y, z = spread(m, first + i), spread(m, second + i), spread(m, third + i)
        a, b = fma(x, u, a), fma(x, v, b)
        e, f = fma(y, u, e), fma(y, v, f)
        p, q = fma(z, u, p), fma(z, v, q)
        u, v = load(m, table + 16), load(m, table + 24)
        x, y, z = spread(m, first + width + i), spread(m, second + width + i), spread(m, third + width + i)
        c, d = fma(x, u, c), fma(x, v, d)
        g, h = fma(y, u, g), fma(y, v, h)
        r, s = fma(z, u, r), fma(z, v, s)
        table += ROW
    return (a, b, c, d), (e, f, g, h), (p, q, r, s)
