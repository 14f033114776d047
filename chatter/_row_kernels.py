"""Rows of sixteen complex numbers, and where in memory they stand.

A row is [re 16][im 16] or, in a table of twiddles, [cos 16][-sin 16]; in registers it is four times eight lanes, a b
the real and c d the imaginary parts.
"""

from typing import NamedTuple

from numba import njit

from chatter._simd import add, fma, load, mul, store, store_pairs, sub

TILE = 16
ROW = 2 * TILE
NEAR = 18
"""Samples up to which it is cheaper to add them one by one than to take the whole span by its low rank."""
SPECTRUM, POWER, MAXIMUM = range(3)


class Plan(NamedTuple):
    """Numbers of things and places in memory of the sliding spectrum; `chatter._dft_kernels` says what they mean."""

    window: int
    channels: int
    tiles: int
    span: int
    spans: int
    group: int
    late: int
    rank: int
    width: int
    table: int
    middles: int
    halves: int
    scratch: int
    coefficients: int
    part: int
    base: int
    fresh: int
    bank: int
    groups: int
    ring: int
    series: int


@njit(cache=True, fastmath=False, forceinline=True)
def turn(re, im, m, row):
    """Return eight products with w."""
    c, s = load(m, row), load(m, row + TILE)
    return sub(mul(re, c), mul(im, s)), fma(re, s, mul(im, c))


@njit(cache=True, fastmath=False, forceinline=True)
def turn_back(re, im, m, row):
    """Return eight products with the conjugate of w."""
    c, s = load(m, row), load(m, row + TILE)
    return fma(re, c, mul(im, s)), sub(mul(im, c), mul(re, s))


@njit(cache=True, fastmath=False, forceinline=True)
def turn_row(m, row, a, b, c, d):
    """Return the product of a row with w."""
    a, c = turn(a, c, m, row)
    b, d = turn(b, d, m, row + 8)
    return a, b, c, d


@njit(cache=True, fastmath=False, forceinline=True)
def turn_row_back(m, row, a, b, c, d):
    """Return the product of a row with the conjugate of w."""
    a, c = turn_back(a, c, m, row)
    b, d = turn_back(b, d, m, row + 8)
    return a, b, c, d


@njit(cache=True, fastmath=False, forceinline=True)
def get_row(m, at):
    """Return the row that stands there."""
    return load(m, at), load(m, at + 8), load(m, at + 16), load(m, at + 24)


@njit(cache=True, fastmath=False, forceinline=True)
def add_row(m, at, a, b, c, d):
    """Return the sum of a row and the one that stands there."""
    return add(a, load(m, at)), add(b, load(m, at + 8)), add(c, load(m, at + 16)), add(d, load(m, at + 24))


@njit(cache=True, fastmath=False, forceinline=True)
def put_row(m, at, a, b, c, d):
    """Write a row."""
    store(m, at, a)
    store(m, at + 8, b)
    store(m, at + 16, c)
    store(m, at + 24, d)


@njit(cache=True, fastmath=False, forceinline=True)
def power(re, im):
    """Return eight squared sizes."""
    return fma(re, re, mul(im, im))


@njit(cache=True, fastmath=False, forceinline=True)
def emit(m, a, b, c, d, row, mode, out, at):
    """Write sixteen bins of the spectrum, or of its squared size."""
    if mode == SPECTRUM:
        re, im = turn_back(a, c, m, row)
        store_pairs(out, 2 * at, re, im)
        re, im = turn_back(b, d, m, row + 8)
        store_pairs(out, 2 * at + 16, re, im)
    else:
        store(out, at, power(a, c))
        store(out, at + 8, power(b, d))
