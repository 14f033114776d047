"""Twiddles of any frequencies with exactly reduced phases, and the tables of the sliding spectrum made from them."""

from fractions import Fraction

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chatter._row_kernels import NEAR, ROW, TILE

Floats = NDArray[np.float64]


def twiddles(
    frequencies_hz: Floats, samples: ArrayLike, sample_rate_hz: float, steps: ArrayLike = 0, window: int = 1
) -> Floats:
    """Return cosine and sine of 2 pi (f / f_s + s / N) i with the phase reduced exactly, shape (2, n, k).

    Parameters
    ----------
    frequencies_hz : ndarray, shape (k,)
        Frequencies f (Hz).
    samples : array_like, shape (n,)
        Sample indices i, whole or half, below 2**26.
    sample_rate_hz : float
        Sampling rate f_s (Hz).
    steps : array_like of int, shape (k,) or ()
        Bins s of the window to either side of each frequency.
    window : int
        Samples N in the window.
    """
    index = np.asarray(samples, dtype=np.float64)[:, None]
    high = frequencies_hz.astype(np.float32).astype(np.float64)  # 24 bits: high * index is exact, and so is the rest
    middle = (frequencies_hz - high).astype(np.float32).astype(np.float64)
    low = frequencies_hz - high - middle
    rest, quarters = 0.0, 0.0
    for part in (low, middle, high):  # each reduced to an eighth of a cycle without rounding, then smallest first
        left, quarter = _reduced(part * index, sample_rate_hz)
        rest, quarters = rest + left, quarters + quarter
    left, quarter = _reduced(np.asarray(steps) * index, float(window))
    angle = 2.0 * np.pi * (rest / sample_rate_hz + left / window)
    cosine, sine = np.cos(angle), np.sin(angle)
    turn = (quarters + quarter).astype(np.int64) % 4
    return np.stack([np.choose(turn, [cosine, -sine, -cosine, sine]), np.choose(turn, [sine, cosine, -sine, -cosine])])


def _reduced(turned: Floats, cycle: float) -> tuple[Floats, Floats]:
    """Return what is left of each number within an eighth of a cycle, and the quarters taken off."""
    left = np.fmod(turned, cycle)
    quarters = np.rint(4.0 * left / cycle)
    return left - quarters * (0.25 * cycle), quarters


def neighbours(frequencies_hz: Floats, window: int, sample_rate_hz: float) -> tuple[Floats, NDArray[np.int64], int]:
    """Return frequencies and steps of all bins that a Hann window needs, shapes (m,) and (m,), and a distance.

    Bin k of the weighted spectrum is made from numbers k, k + distance and k + 2 distance of these.

    Parameters
    ----------
    frequencies_hz : ndarray, shape (k,)
        Frequencies (Hz).
    window : int
        Samples in the window.
    sample_rate_hz : float
        Sampling rate (Hz).
    """
    size = frequencies_hz.size
    exact, spacing = [Fraction(f) for f in frequencies_hz], Fraction(sample_rate_hz) / window
    if all(high - low == spacing for low, high in zip(exact, exact[1:], strict=False)):
        padded = np.pad(frequencies_hz, 1, mode="edge")
        return padded, np.concatenate([[-1], np.zeros(size, dtype=np.int64), [1]]), 1
    return np.tile(frequencies_hz, 3), np.repeat([-1, 0, 1], size), size


def low_rank(half_span: Floats) -> tuple[Floats, Floats]:
    """Return the factors of the twiddles of half a span, for `fold`, shape (2, n, width), and `unfold`, (rank, 2, k).

    The singular values left out lie below the rounding of the twiddles. Both factors are corrected once for what their
    product misses, which is then no more than that rounding. Half a span that has no low rank is its own factor.

    Parameters
    ----------
    half_span : ndarray, shape (2, n, k)
        Cosines and sines, counted from the middle of the span.
    """
    left, values, right = np.linalg.svd(half_span, full_matrices=False)
    rank = int((values > 2.0 * np.finfo(np.float64).eps * values[:, :1]).sum(axis=1).max())
    left, values, right = left[..., :rank], values[:, None, :rank], right[:, :rank]
    product = values.swapaxes(1, 2) * right
    if 2 * rank > half_span.shape[1]:
        rank = half_span.shape[1]
        left, product = np.tile(np.eye(rank), (2, 1, 1)), half_span
    else:
        product = product + left.swapaxes(1, 2) @ _missed(half_span, left, product)
        least = np.finfo(np.float64).eps * values.max()
        left = left + _missed(half_span, left, product) @ (right.swapaxes(1, 2) / np.maximum(values, least))
    rank += rank % 2
    fold = np.zeros((2, half_span.shape[1], TILE * -(-rank // TILE)))
    unfold = np.zeros((rank, 2, half_span.shape[2]))
    fold[..., : left.shape[2]] = left
    unfold[: product.shape[1]] = product.swapaxes(0, 1)
    return fold, unfold


def _missed(whole: Floats, left: Floats, right: Floats) -> Floats:
    """Return a matrix less a product, summed in the longest floats there are."""
    product = left.astype(np.longdouble) @ right.astype(np.longdouble)
    return (whole - product).astype(np.float64)


def tables(
    frequencies_hz: Floats, steps: ArrayLike, window: int, sample_rate_hz: float, span: int
) -> tuple[Floats, Floats, Floats, int, int]:
    """Return the tables of the kernel: for each tile, shape (tiles, rows, 32), of the middles, of `fold`.

    Then the rank, and the distance in the first from a row to that a window later, 0 if they are equal.

    Parameters
    ----------
    frequencies_hz : ndarray, shape (k,)
        Frequencies (Hz).
    steps : array_like of int, shape (k,) or ()
        Bins to either side of each frequency.
    window : int
        Samples in the window.
    sample_rate_hz : float
        Sampling rate (Hz).
    span : int
        Samples in a span, even.
    """

    def at(samples: ArrayLike) -> Floats:
        return twiddles(frequencies_hz, samples, sample_rate_hz, steps, window)

    def tiled(rows: Floats) -> Floats:
        tiles = -(-frequencies_hz.size // TILE)
        padded = np.zeros((len(rows), 2, tiles * TILE))
        padded[..., : frequencies_hz.size] = rows
        return padded.reshape(-1, 2, tiles, TILE).swapaxes(1, 2).reshape(-1, tiles, ROW)

    turn, middle = at([window]), 0.5 * (span - 1)
    periodic = bool((turn[0] == 1.0).all() and (turn[1] == 0.0).all())
    once = np.concatenate([np.arange(span + 1) - middle, np.arange(NEAR + 1)])
    fold, unfold = low_rank(at(np.arange(span // 2) + 0.5))
    sign = np.array([1.0, -1.0])[:, None]
    rows = at(np.concatenate([once, [window], *([] if periodic else [once + window])])).swapaxes(0, 1) * sign
    here = once.size + 1
    table = tiled(np.concatenate([rows[:here], unfold, rows[here:]])).swapaxes(0, 1)
    middles = tiled(at(np.arange(0, window, span) + middle).swapaxes(0, 1) * sign)
    return table, middles, fold, len(unfold), 0 if periodic else (here + len(unfold)) * ROW
