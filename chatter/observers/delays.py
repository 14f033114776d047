"""Signals of different age brought to one time: whole samples plus a third-order Lagrange fraction."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray


class Alignment(NamedTuple):
    """How far back each signal is read, and with what weights."""

    first: NDArray[np.int64]
    """Samples back of the newest tap of each signal, shape (signals,)."""
    weights: NDArray[np.float64]
    """Weights of the taps, newest first, shape (signals, 1) or (signals, 4)."""
    age: float
    """Age of all signals after alignment (samples)."""

    @property
    def reach(self) -> int:
        """Samples back of the oldest tap of any signal."""
        return int(self.first.max()) + self.weights.shape[1] - 1

    def smoothed(self, taps: NDArray[np.float64], count: int) -> "Alignment":
        """Return the same with the first signals smoothed over symmetric taps and the others delayed beside them.

        Parameters
        ----------
        taps : ndarray, shape (2 n + 1,)
            Weights.
        count : int
            How many signals are smoothed.
        """
        pure = np.zeros(len(taps))
        pure[len(taps) // 2] = 1.0
        rows = [np.convolve(w, taps if j < count else pure) for j, w in enumerate(self.weights)]
        return Alignment(self.first, np.array(rows), self.age + len(taps) // 2)


def lagrange(fraction: float) -> NDArray[np.float64]:
    """Return the weights that delay by 1 + fraction samples, fraction in [0, 1), newest first, shape (4,).

    Parameters
    ----------
    fraction : float
        Part of a sample beyond the second tap: the central interval, where the gain never exceeds one.
    """
    d = fraction
    return np.array(
        [
            -d * (d - 1.0) * (d - 2.0) / 6.0,
            (d + 1.0) * (d - 1.0) * (d - 2.0) / 2.0,
            -(d + 1.0) * d * (d - 2.0) / 2.0,
            (d + 1.0) * d * (d - 1.0) / 6.0,
        ]
    )


def align(ages: ArrayLike) -> Alignment:
    """Return the delays that make all signals as old as the oldest (and one sample more if a fraction needs it).

    Parameters
    ----------
    ages : array_like, shape (signals,)
        Age of each signal when sampled (samples), at least 0.
    """
    old = np.asarray(ages, dtype=np.float64)
    lag = old.max() - old
    whole = np.rint(lag)
    if np.all(np.abs(lag - whole) < 1e-9):
        return Alignment(whole.astype(np.int64), np.ones((lag.size, 1)), float(old.max()))
    extra = 1.0 if np.floor(lag).min() < 1.0 else 0.0
    lag = lag + extra
    floor = np.floor(lag + 1e-9)
    weights = np.array([lagrange(max(d, 0.0)) for d in lag - floor])
    return Alignment((floor - 1.0).astype(np.int64), weights, float(old.max() + extra))
