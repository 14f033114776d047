"""What lasts of the sliding spectrum: sums of spans and groups of them, from which any window's sum is put together.

Symbols as in `chatter._dft_kernels`. Nothing here has a sample taken out of it again, and nothing depends on how the
stream was cut.
"""

from numba import njit

from chatter._row_kernels import NEAR, ROW, TILE, add_row, emit, get_row, put_row, turn_row, turn_row_back
from chatter._simd import add, load, splat, store
from chatter._span_kernels import fold_spans, unfold


@njit(cache=True, fastmath=False, forceinline=True)
def _sum_backward(m, rows, first, count):
    """Replace rows for each tile and channel by their sums from there to the last of ``count``."""
    size = rows * ROW
    for at in range(first + (count - 2) * size, first - 1, -size):
        for i in range(at, at + size, 8):
            store(m, i, add(load(m, i), load(m, i + size)))


@njit(cache=True, fastmath=False, forceinline=True)
def _close_group(m, plan, group):
    """Keep the sum of a finished group and forget FRESH."""
    rows = plan.tiles * plan.channels
    for row in range(rows):
        place, at = plan.fresh + row * ROW, plan.groups + (group * rows + row) * ROW
        a, b, c, d = get_row(m, place)
        put_row(m, at, a, b, c, d)
        a = b = c = d = splat(0.0)
        put_row(m, place, a, b, c, d)


@njit(cache=True, fastmath=False)
def _start_group(m, plan, span):
    """Close the group before a span, and the epoch before the first, and start the group of the span."""
    rows, group, count = plan.tiles * plan.channels, span // plan.group, -(-plan.spans // plan.group)
    spans = min(plan.group, plan.spans - span)
    _close_group(m, plan, group - 1 if group > 0 else count - 1)
    if group == 0:
        _sum_backward(m, rows, plan.groups, count)
    for row in range(rows):
        a = b = c = d = splat(0.0)
        for at in range(plan.groups + row * ROW, plan.groups + (group * rows + row) * ROW, rows * ROW):
            a, b, c, d = add_row(m, at, a, b, c, d)
        if plan.late:
            a, b, c, d = turn_row(m, row // plan.channels * plan.table + (plan.span + NEAR + 2) * ROW, a, b, c, d)
        if group + 1 < count:
            a, b, c, d = add_row(m, plan.groups + ((group + 1) * rows + row) * ROW, a, b, c, d)
        last = plan.bank + ((span + spans - 1) * rows + row) * ROW
        a, b, c, d = add_row(m, last, a, b, c, d)
        put_row(m, last, a, b, c, d)
    _sum_backward(m, rows, plan.bank + span * rows * ROW, spans)


@njit(cache=True, fastmath=False, forceinline=True)
def base(m, plan, span, row):
    """Return BASE of a span, for one tile of one channel."""
    tile, rows = row // plan.channels, plan.tiles * plan.channels
    a, b, c, d = get_row(m, plan.fresh + row * ROW)
    if plan.late:
        a, b, c, d = turn_row(m, tile * plan.table + (plan.span + NEAR + 2) * ROW, a, b, c, d)
    a, b, c, d = add_row(m, plan.bank + (span * rows + row) * ROW, a, b, c, d)
    return turn_row_back(m, plan.middles + (span * plan.tiles + tile) * ROW, a, b, c, d)


@njit(cache=True, fastmath=False)
def put_base(m, plan, span):
    """Write BASE of a span."""
    for row in range(plan.tiles * plan.channels):
        a, b, c, d = base(m, plan, span, row)
        put_row(m, plan.base + row * ROW, a, b, c, d)


@njit(cache=True, fastmath=False)
def carry_base(m, plan):
    """Make BASE of the next span of what is in the window at the end of this one."""
    for row in range(plan.tiles * plan.channels):
        table, place = row // plan.channels * plan.table, plan.base + row * ROW
        a, b, c, d = get_row(m, plan.part + row * ROW)
        a, b, c, d = add_row(m, place, a, b, c, d)
        a, b, c, d = turn_row_back(m, table + plan.span * ROW, a, b, c, d)
        a, b, c, d = turn_row(m, table, a, b, c, d)
        put_row(m, place, a, b, c, d)


@njit(cache=True, fastmath=False, forceinline=True)
def _close(m, plan, a, b, c, d, fresh, bank, middle, table, asked, mode, out, at):
    """Take a finished span into its group, one tile of one channel, and write the spectrum at its end if asked."""
    a, b, c, d = turn_row(m, middle, a, b, c, d)
    put_row(m, bank, a, b, c, d)
    a, b, c, d = add_row(m, fresh, a, b, c, d)
    put_row(m, fresh, a, b, c, d)
    if asked:
        if plan.late:
            a, b, c, d = turn_row(m, table + (plan.span + NEAR + 2) * ROW, a, b, c, d)
        a, b, c, d = add_row(m, bank + plan.tiles * plan.channels * ROW, a, b, c, d)
        a, b, c, d = turn_row_back(m, middle + plan.tiles * ROW, a, b, c, d)
        emit(m, a, b, c, d, table, mode, out, at)


@njit(cache=True, fastmath=False)
def close_spans(m, plan, begin, end, length, done, hop, mode, out, step):
    """Take finished spans of one group into it and write every spectrum that is asked for at their ends.

    length: samples of the last; done: samples of the block at the end of the first. If the group ends as well, start
    the next one; the spectrum at its start is left to the caller.
    """
    fold_spans(m, plan, begin, end, length)
    ends, sets = end % plan.group == 0 or end == plan.spans, (end - begin) * plan.channels
    due, to = -1, 0  # samples from the end of a span to the next spectrum, and its place
    if hop > NEAR:
        due = (hop - done % hop) % hop
        to = ((done + due) // hop - 1) * step
    rows, basis = plan.channels * ROW, (plan.span + NEAR + 3) * ROW
    for i in range(plan.tiles):
        tile = i if begin % 2 else plan.tiles - 1 - i  # there and back: half of U is still at hand
        table, channel, wait, at = tile * plan.table, 0, due, to + tile * TILE
        fresh, bank = plan.fresh + tile * rows, plan.bank + (begin * plan.tiles + tile) * rows
        middle, last = plan.middles + (begin * plan.tiles + tile) * ROW, plan.middles + (end - 1) * plan.tiles * ROW
        for number in range(0, sets, 3):
            one, two, three = unfold(m, plan, number, sets - 1, table + basis)
            for k in range(min(3, sets - number)):
                a, b, c, d = one if k == 0 else two if k == 1 else three
                asked = wait == 0 and not (ends and middle >= last)
                here = at + channel * plan.tiles * TILE
                _close(m, plan, a, b, c, d, fresh, bank, middle, table, asked, mode, out, here)
                channel, fresh, bank = channel + 1, fresh + ROW, bank + ROW
                if channel == plan.channels:
                    channel, fresh, bank = 0, fresh - rows, bank + (plan.tiles - 1) * rows
                    middle += plan.tiles * ROW
                    if wait == 0:
                        at, wait = at + step, hop
                    wait -= plan.span
    if ends:
        _start_group(m, plan, end % plan.spans)
