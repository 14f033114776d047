"""Compiled loops of the sliding spectrum.

Time is counted from the start of the present epoch of ``window`` samples, so that the sample that enters and the one
that leaves meet the same twiddle, but for w(window). An epoch is cut into spans, and these go by groups. What the
window holds at the start of a span is the end of the last epoch, summed backward once that was complete, and the start
of this one, summed forward: no sum that lasts has a sample taken out of it. The sum of a span is made from its samples
alone when it is complete, so nothing that lasts depends on how the stream was cut. There are about as many spans in a
group as groups in an epoch: the sums are short, and so are their rounding errors.

Within a span PART is brought up to date when a spectrum is asked for: sample by sample over short ways, by the product
of low rank over long ones. Spans that a block completes wait for each other, a few at most, and meanwhile BASE goes on
with PART: that shares the reading of the tables.

============  ====================  =============================================================================
symbol        name in the API       meaning
============  ====================  =============================================================================
w(i)          (tables)              exp(-2j pi f_k i / f_s)
PART          (state)               sum over the present span of (w(window) entering - leaving) w(i)
BASE          (state)               the window's sum at the start of the span
FRESH         (state)               sum of the finished spans of this group
bank          (state)               a row for each span: its sum, or (for the rest of the group) what the window still
                                    holds of the last epoch, and of this one from before the group
groups        (state)               a row for each group: its sum, or from there to the end of the last epoch
X             spectrum              (BASE + PART) conj(w(i))
============  ====================  =============================================================================

In BASE, PART and X the index i is counted from the middle of the span, in the others from the start of the epoch.

All stands in one array, described by the integers of a `Plan`. Rows of a tile's table: w at the samples of a span and
the one behind, counted from its middle; w(0) ... w(NEAR); w(window); U; unless w(window) is 1 for all bins, the first
two once more, times w(window), ``late`` numbers further. ``middles`` has a row for each span and tile, w at the middle
of the span counted from the epoch. ``series`` has for each channel what changes, entering less leaving (with ``late``:
less leaving), and what enters.
"""

import numpy as np
from numba import njit

from chatter._epoch_kernels import base, carry_base, close_spans, put_base
from chatter._kernels import FINE, first_non_finite
from chatter._row_kernels import (
    MAXIMUM,
    NEAR,
    POWER,
    ROW,
    SPECTRUM,
    TILE,
    Plan,
    add_row,
    emit,
    get_row,
    power,
    put_row,
    turn_row,
    turn_row_back,
)
from chatter._simd import add, fma, get, larger, load, memory, put, splat, spread, store, sub
from chatter._span_kernels import fold_series, unfold

MANY = 3
"""Spans at most that wait to be taken into their group together."""
POSITION, SUMMED, BASED, SEEN, PLAN = range(5)
"""Places in the clock: samples of the epoch, samples of the span in PART, BASE is there, samples in all, the plan."""


@njit(cache=True, fastmath=False, forceinline=True)
def _add(m, sample, span, row, late, a, b, c, d):
    """Return PART with one more sample: what changes, or what leaves and what enters."""
    x = spread(m, sample)
    a, b = fma(x, load(m, row), a), fma(x, load(m, row + 8), b)
    c, d = fma(x, load(m, row + 16), c), fma(x, load(m, row + 24), d)
    if late:
        x = spread(m, sample + span)
        row += late
        a, b = fma(x, load(m, row), a), fma(x, load(m, row + 8), b)
        c, d = fma(x, load(m, row + 16), c), fma(x, load(m, row + 24), d)
    return a, b, c, d


@njit(cache=True, fastmath=False, forceinline=True)
def _slide(m, plan, series, begin, end, hop, left, table, place, other, mode, out, at, step):
    """Take samples of a span into PART and write every hop-th spectrum, the first after ``left``, for two channels.

    other: 1 for the next channel, 0 for the same once more.
    """
    late, span, series2, place2 = plan.late, plan.span, series + other * 2 * plan.span, place + other * ROW
    at2 = at + other * plan.tiles * TILE
    a = b = c = d = e = f = g = h = splat(0.0)
    if begin > 0:
        a, b, c, d = get_row(m, place)
        e, f, g, h = get_row(m, place2)
    i = begin
    while True:
        stop = min(end, i + left)
        left -= stop - i
        while i < stop:
            a, b, c, d = _add(m, series + i, span, table + i * ROW, late, a, b, c, d)
            e, f, g, h = _add(m, series2 + i, span, table + i * ROW, late, e, f, g, h)
            i += 1
        if left == 0:
            p, q, r, s = add_row(m, place + plan.base - plan.part, a, b, c, d)
            emit(m, p, q, r, s, table + i * ROW, mode, out, at)
            p, q, r, s = add_row(m, place2 + plan.base - plan.part, e, f, g, h)
            emit(m, p, q, r, s, table + i * ROW, mode, out, at2)
            at, at2, left = at + step, at2 + step, hop
        if i >= end:
            break
    put_row(m, place, a, b, c, d)
    put_row(m, place2, e, f, g, h)


@njit(cache=True, fastmath=False, forceinline=True)
def _each(m, out, count, span, late, mode, step, places, parts, bases, largest):
    """Take a stripe of samples into PART and write the power after each, or keep the largest."""
    sample, sample2, row, row2, at, at2 = places
    a, b, c, d, a2, b2, c2, d2 = parts
    e, f, g, h, e2, f2, g2, h2 = bases
    most, more, most2, more2 = largest
    for i in range(count):
        a, b, c, d = _add(m, sample + i, span, row, late, a, b, c, d)
        a2, b2, c2, d2 = _add(m, sample2 + i, span, row2, late, a2, b2, c2, d2)
        row += ROW
        row2 += ROW
        p, q = power(add(a, e), add(c, g)), power(add(b, f), add(d, h))
        r, s = power(add(a2, e2), add(c2, g2)), power(add(b2, f2), add(d2, h2))
        if mode == MAXIMUM:
            most, more, most2, more2 = larger(p, most), larger(q, more), larger(r, most2), larger(s, more2)
        else:
            store(out, at, p)
            store(out, at + 8, q)
            store(out, at2, r)
            store(out, at2 + 8, s)
            at += step
            at2 += step
    return (a, b, c, d, a2, b2, c2, d2), (most, more, most2, more2)


@njit(cache=True, fastmath=False, forceinline=True)
def _slide_each(m, plan, series, begin, end, table, place, series2, table2, place2, mode, out, at, at2, step):
    """Take samples into PART and write the power after each, or the largest, for two tiles or channels side by side.

    Every NEAR samples the sums are turned on to the present one, so that a few rows of the table do for all.
    """
    near, late, span = (plan.span + 1) * ROW, plan.late, plan.span
    a = b = c = d = a2 = b2 = c2 = d2 = most = more = most2 = more2 = splat(0.0)
    if begin > 0:
        a, b, c, d = get_row(m, place)
        a2, b2, c2, d2 = get_row(m, place2)
    if mode == MAXIMUM:
        most, more, most2, more2 = load(out, at), load(out, at + 8), load(out, at2), load(out, at2 + 8)
    largest = (most, more, most2, more2)
    origin, onward = begin * ROW, begin * ROW
    for start in range(begin, end, NEAR):
        origin, count = start * ROW, min(NEAR, end - start)
        a, b, c, d = turn_row_back(m, table + onward, a, b, c, d)
        a2, b2, c2, d2 = turn_row_back(m, table2 + onward, a2, b2, c2, d2)
        e, f, g, h = get_row(m, place + plan.base - plan.part)
        e, f, g, h = turn_row_back(m, table + origin, e, f, g, h)
        e2, f2, g2, h2 = get_row(m, place2 + plan.base - plan.part)
        e2, f2, g2, h2 = turn_row_back(m, table2 + origin, e2, f2, g2, h2)
        parts, bases = (a, b, c, d, a2, b2, c2, d2), (e, f, g, h, e2, f2, g2, h2)
        places = (series + start, series2 + start, table + near, table2 + near, at, at2)
        if late:
            parts, largest = _each(m, out, count, span, late, mode, step, places, parts, bases, largest)
        elif mode == MAXIMUM:  # twice the same, but for what the compiler then knows
            parts, largest = _each(m, out, count, span, 0, MAXIMUM, step, places, parts, bases, largest)
        else:
            parts, largest = _each(m, out, count, span, 0, POWER, step, places, parts, bases, largest)
        a, b, c, d, a2, b2, c2, d2 = parts
        at += count * step
        at2 += count * step
        onward = near + NEAR * ROW
    a, b, c, d = turn_row(m, table + origin, a, b, c, d)
    put_row(m, place, a, b, c, d)
    a2, b2, c2, d2 = turn_row(m, table2 + origin, a2, b2, c2, d2)
    put_row(m, place2, a2, b2, c2, d2)
    if mode == MAXIMUM:
        most, more, most2, more2 = largest
        store(out, at, most)
        store(out, at + 8, more)
        store(out, at2, most2)
        store(out, at2 + 8, more2)


@njit(cache=True, fastmath=False)
def _run(m, plan, begin, end, hop, left, mode, out, at, step):
    """Take samples of the span into PART, for all tiles and channels; write every hop-th spectrum."""
    for tile in range(plan.tiles):
        for channel in range(0, plan.channels, 2):
            other = 1 if channel + 1 < plan.channels else 0
            place, series = plan.part + (tile * plan.channels + channel) * ROW, plan.series + channel * 2 * plan.span
            to = at + (channel * plan.tiles + tile) * TILE
            _slide(m, plan, series, begin, end, hop, left, tile * plan.table, place, other, mode, out, to, step)


@njit(cache=True, fastmath=False)
def _run_each(m, plan, begin, end, mode, out, at, step):
    """Take samples of the span into PART, for all tiles and channels; write the power after each, or the largest."""
    rows = plan.tiles * plan.channels
    for row in range(0, rows, 2):
        other = min(row + 1, rows - 1)
        tile, channel = row // plan.channels, row % plan.channels
        tile2, channel2 = other // plan.channels, other % plan.channels
        _slide_each(
            m, plan, plan.series + channel * 2 * plan.span, begin, end, tile * plan.table, plan.part + row * ROW,
            plan.series + channel2 * 2 * plan.span, tile2 * plan.table, plan.part + other * ROW, mode, out,
            at + (channel * plan.tiles + tile) * TILE, at + (channel2 * plan.tiles + tile2) * TILE, step,
        )  # fmt: skip


@njit(cache=True, fastmath=False)
def _show_far(m, plan, end, mode, out, at):
    """Make PART of the first ``end`` samples of a span in one go, and write the spectrum."""
    fold_series(m, plan, end)
    apart, many = plan.base - plan.part, 1 if plan.late else 3
    for tile in range(plan.tiles):
        table, place = tile * plan.table, plan.part + tile * plan.channels * ROW
        turn = table + (plan.span + NEAR + 2) * ROW
        for channel in range(0, plan.channels, many):
            if plan.late:
                one, two, three = unfold(m, plan, 2 * channel, 2 * channel + 1, turn + ROW)
                e, f, g, h = turn_row(m, turn, *two)
                a, b, c, d = one
                one = (add(a, e), add(b, f), add(c, g), add(d, h))
            else:
                one, two, three = unfold(m, plan, channel, plan.channels - 1, turn + ROW)
            for k in range(min(many, plan.channels - channel)):
                a, b, c, d = one if k == 0 else two if k == 1 else three
                put_row(m, place, a, b, c, d)
                a, b, c, d = add_row(m, place + apart, a, b, c, d)
                emit(m, a, b, c, d, table + end * ROW, mode, out, at + ((channel + k) * plan.tiles + tile) * TILE)
                place += ROW


@njit(cache=True, fastmath=False)
def _show_start(m, plan, span, mode, out, at):
    """Write the spectrum at the start of a span."""
    for tile in range(plan.tiles):
        for channel in range(plan.channels):
            a, b, c, d = base(m, plan, span, tile * plan.channels + channel)
            emit(m, a, b, c, d, tile * plan.table, mode, out, at + (channel * plan.tiles + tile) * TILE)


@njit(cache=True, fastmath=False)
def _exchange(block, done, count, m, plan, position):
    """Take samples into the ring, and what changes and what enters into the series of the span."""
    first = position % plan.span
    for channel in range(plan.channels):
        ring, changes = plan.ring + channel * plan.window + position, plan.series + channel * 2 * plan.span + first
        entering, i = changes + plan.span, 0
        for k in range(count):
            put(m, entering + k, get(block, (done + k) * plan.channels + channel))
        while i + 8 <= count:
            come, gone = load(m, entering + i), load(m, ring + i)
            store(m, ring + i, come)
            store(m, changes + i, sub(splat(0.0) if plan.late else come, gone))
            i += 8
        while i < count:
            come, gone = get(m, entering + i), get(m, ring + i)
            put(m, ring + i, come)
            put(m, changes + i, (0.0 if plan.late else come) - gone)
            i += 1


@njit(cache=True, fastmath=False)
def sliding_dft(block, hop, mode, work, clock, out):
    """Advance the window over a block; write the spectrum, or its squared size, after every hop-th sample.

    Parameters: block (n, channels); work: everything; clock: POSITION ... and the plan; out (m, 16 tiles), complex: the
    spectra of the channels in turn, or their squared sizes as floats in the same memory, or for MAXIMUM only one for
    each channel. An empty block with a hop of 0 writes the present spectrum.
    """
    bad = first_non_finite(block)
    if bad != FINE or (hop > 0 and block.shape[0] == 0):
        return bad
    c, y, m, o = clock, memory(block), memory(work), memory(out)
    plan = Plan(c[4], c[5], c[6], c[7], c[8], c[9], c[10], c[11], c[12], c[13], c[14], c[15], c[16], c[17], c[18],
                c[19], c[20], c[21], c[22], c[23], c[24])  # fmt: skip
    position, summed, based, samples = c[POSITION], c[SUMMED], c[BASED], block.shape[0]
    done = waiting = ended = np.int64(0)  # one type from the start, or the kernels below are compiled twice
    step, short = 0 if mode == MAXIMUM else plan.channels * plan.tiles * TILE, 0 < hop <= NEAR
    while True:
        span, first = position // plan.span, position % plan.span
        at, left = (done // hop * step, hop - done % hop) if hop > 0 else (0, 0)
        room = min(plan.span - first, plan.window - position)
        count = min(room, samples - done if short else min(samples - done, left))
        _exchange(y, done, count, m, plan, position)
        done, end, asked = done + count, first + count, not short and count == left
        position = (position + count) % plan.window
        if short or (asked and count < room):
            if not based:
                put_base(m, plan, span)
                based = 1
            if asked and end - summed > NEAR:
                _show_far(m, plan, end, mode, o, at)
            elif hop == 1 and mode != SPECTRUM:
                if summed < first:
                    _run(m, plan, summed, first, hop, plan.span, mode, o, at, step)
                _run_each(m, plan, first, end, mode, o, at, step)
            else:
                _run(m, plan, summed, end, hop, left + first - summed, mode, o, at, step)
            summed = end
        if count == room:
            ended, waiting, span, summed = done if waiting == 0 else ended, waiting + 1, span + 1, 0
            ends, no_more = span % plan.group == 0 or position == 0, samples - done < plan.span
            if ends or no_more or waiting == MANY or (not short and hop - done % hop < plan.span):
                close_spans(m, plan, span - waiting, span, end, ended, hop, mode, o, step)
                waiting = based = 0
                if ends and asked:
                    _show_start(m, plan, position // plan.span, mode, o, at)
            elif short:
                carry_base(m, plan)
        if done == samples:
            c[POSITION], c[SUMMED], c[BASED] = position, summed, based
            c[SEEN] += samples
            return FINE


@njit(cache=True, fastmath=False)
def weigh_hann(raw, rows, distance, bins, mode, out):
    """Weight spectra by a Hann window: half of each bin less a quarter of its two neighbours.

    Parameters: raw (rows, width), complex, neighbours at 0 and twice the distance; out, flat: a row for each, of pairs
    of numbers or of squared sizes.
    """
    y, o, width, apart = memory(raw), memory(out), raw.shape[1], 2 * distance
    for row in range(rows):
        to = row * bins if mode == POWER else 2 * row * bins
        for k in range(bins):
            at = 2 * (row * width + k)
            re = 0.5 * get(y, at + apart) - 0.25 * (get(y, at) + get(y, at + 2 * apart))
            at += 1
            im = 0.5 * get(y, at + apart) - 0.25 * (get(y, at) + get(y, at + 2 * apart))
            if mode == SPECTRUM:
                put(o, to + 2 * k, re)
                put(o, to + 2 * k + 1, im)
            else:
                put(o, to + k, re * re + im * im)
