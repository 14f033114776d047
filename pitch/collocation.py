"""Eigenvalues of a linear equation with delays, by collocation of its generator at Chebyshev points.

x'(t) = A x(t) + sum_j B_j x(t - tau_j); Breda, Maset and Vermiglio, Stability of Linear Delay Differential Equations,
Springer 2015, section 5. The state is the piece of the past that the equation needs; time moves it by differentiation.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray


def delay_eigenvalues(
    present: NDArray[np.float64], delayed: Sequence[tuple[NDArray[np.float64], float]], nodes: int
) -> NDArray[np.complex128]:
    """Approximate the rightmost characteristic roots; those with many waves in the longest delay are spurious.

    Parameters
    ----------
    present : ndarray
        Matrix of the present state, shape (d, d).
    delayed : sequence of (ndarray, float)
        Matrices of delayed states, shape (d, d), each with its delay (s), > 0.
    nodes : int
        Degree of the polynomial on the longest delay.

    Returns
    -------
    ndarray
        All eigenvalues of the discretisation (1/s), shape (d + r * nodes,), unordered; r is the number of states whose
        past is read at all, and only their past is carried along.
    """
    size, longest = len(present), max(delay for _, delay in delayed)
    read = np.flatnonzero(sum(np.abs(matrix).sum(axis=0) for matrix, _ in delayed))
    if not len(read):
        return np.linalg.eigvals(present).astype(np.complex128)
    points, weights = _chebyshev(nodes)
    slope = _differentiation(points, weights) * (2 / longest)
    generator = np.zeros((size + len(read) * nodes,) * 2)
    generator[:size, :size] = present
    generator[size:, read] = np.kron(slope[1:, :1], np.eye(len(read)))
    generator[size:, size:] = np.kron(slope[1:, 1:], np.eye(len(read)))
    for matrix, delay in delayed:
        row = _interpolation(points, weights, 1 - 2 * delay / longest)
        generator[:size, read] += row[0, 0] * matrix[:, read]
        generator[:size, size:] += np.kron(row[:, 1:], matrix[:, read])
    return np.linalg.eigvals(generator).astype(np.complex128)


def _chebyshev(nodes: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return points from 1 (now) to -1 (the longest delay ago) and their barycentric weights."""
    weights = ((-1.0) ** np.arange(nodes + 1)).astype(np.float64)
    weights[[0, -1]] /= 2
    points = np.sin(np.pi / 2 * (1 - 2 * np.arange(nodes + 1) / nodes))
    return points.astype(np.float64), weights


def _differentiation(points: NDArray[np.float64], weights: NDArray[np.float64]) -> NDArray[np.float64]:
    gap = points[:, None] - points[None, :] + np.eye(len(points))
    matrix = weights[None, :] / weights[:, None] / gap
    np.fill_diagonal(matrix, 0.0)
    np.fill_diagonal(matrix, -matrix.sum(axis=1))
    return matrix


def _interpolation(points: NDArray[np.float64], weights: NDArray[np.float64], place: float) -> NDArray[np.float64]:
    """Return the row that reads the polynomial at one place, shape (1, n)."""
    gap = place - points
    nearest = int(np.argmin(np.abs(gap)))
    if abs(gap[nearest]) < 1e-14:
        return np.eye(len(points))[nearest : nearest + 1]
    row = weights / gap
    return (row / row.sum())[None, :]
