"""Linear least squares whose confidence comes from leaving out one stretch of the record after the other.

The residual of a drive is no white noise: friction drifts, a ripple repeats. The classical formula would then promise
too much; the jackknife over long stretches (Efron, The jackknife, the bootstrap and other resampling plans, SIAM 1982,
ch. 3) sees what really changes from one part of the record to the next.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

Floats = NDArray[np.float64]

BLOCKS = 20


@dataclass(frozen=True, slots=True, kw_only=True)
class Fit:
    """Parameters of a linear model.

    Parameters
    ----------
    value : ndarray, shape (k,)
        The parameters.
    std : ndarray, shape (k,)
        Their standard deviations; infinite where the record does not determine them.
    half_width : ndarray, shape (k,)
        Half of the interval that holds the truth in 95 of 100 cases.
    relative_error : float
        Norm of the residual over the norm of what was fitted.
    """

    value: Floats
    std: Floats
    half_width: Floats
    relative_error: float


def fitted(columns: Floats, target: Floats, blocks: int = BLOCKS) -> Fit:
    """Return the least-squares fit of a target by columns, with standard deviations from stretches left out.

    Parameters
    ----------
    columns : ndarray, shape (n, k)
        In the order of time.
    target : ndarray, shape (n,)
        What they shall explain.
    blocks : int
        Stretches that are left out one by one.
    """
    scale = np.sqrt(np.mean(columns**2, axis=0))
    scale = np.where(scale > 0.0, scale, 1.0)
    scaled = columns / scale
    parts = [(p, target[k]) for p, k in _split(scaled, blocks)]
    grams = np.array([p.T @ p for p, _ in parts])
    sides = np.array([p.T @ y for p, y in parts])
    gram, side = grams.sum(axis=0), sides.sum(axis=0)
    value = _solved(gram, side)
    left_out = np.array([_solved(gram - g, side - s) for g, s in zip(grams, sides, strict=True)])
    count = len(parts)
    spread = np.sqrt((count - 1.0) / count * ((left_out - left_out.mean(axis=0)) ** 2).sum(axis=0))
    spread = np.where(np.isfinite(spread), spread, np.inf)
    residual = target - scaled @ np.nan_to_num(value)
    size = float(np.linalg.norm(target))
    return Fit(
        value=value / scale, std=spread / scale, half_width=float(stdtrit(count - 1.0, 0.975)) * spread / scale,
        relative_error=float(np.linalg.norm(residual)) / size if size > 0.0 else np.inf,
    )  # fmt: skip


def _split(scaled: Floats, blocks: int) -> list[tuple[Floats, slice]]:
    edges = np.linspace(0, len(scaled), blocks + 1).astype(np.int64)
    pieces = [slice(int(a), int(b)) for a, b in zip(edges[:-1], edges[1:], strict=True)]
    return [(scaled[piece], piece) for piece in pieces]


def _solved(gram: Floats, side: Floats) -> Floats:
    """Return the solution, NaN in what the record does not determine."""
    size, turn = np.linalg.eigh(gram)
    free = size <= 1e-12 * max(float(size[-1]), 1e-300)
    inverse = np.where(free, 0.0, 1.0 / np.where(free, 1.0, size))
    value = turn @ (inverse * (turn.T @ side))
    unknown = (turn[:, free] ** 2).sum(axis=1) > 1e-6
    return np.where(unknown, np.nan, value)
