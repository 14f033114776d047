"""Stability over phase difference, spindle speed and cutting stiffness, by one pass over frequency for each column.

On a border a root is i w. The characteristic equation solved for the cutting stiffness, K(i w), must be real there;
each zero of its imaginary part is a border at K, crossed to the right where that part rises with w. Between borders the
number of unstable roots is constant and it is 0 at K = 0, so one pass over w gives a whole column of the chart, islands
included. The delays are exact: nothing is discretised.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pitch import _chart_kernels as kernels
from pitch._checks import finite
from pitch.stability import OneModeProcess, StabilityUnresolved

Floats = NDArray[np.float64]

_PER_TURN = 24  # samples of the crossing condition per half turn of the spindle
_MOST = 20_000  # borders of one column


@dataclass(frozen=True, slots=True, kw_only=True)
class StabilityChart:
    """Stability of columns of processes over cutting stiffness.

    Attributes
    ----------
    stiffness : ndarray
        Rows (N/m), shape (rows,).
    unstable : ndarray of int
        Pairs of roots that grow, 0 where stable, shape (rows, columns).
    limit : ndarray
        Lowest border of each column (N/m), infinite where there is none below the last row, shape (columns,).
    limit_hz : ndarray
        Its frequency (Hz), nan without one, shape (columns,).
    """

    stiffness: Floats
    unstable: NDArray[np.int64]
    limit: Floats
    limit_hz: Floats

    @property
    def stable(self) -> NDArray[np.bool_]:
        """Whether each cell is stable, shape (rows, columns)."""
        return self.unstable == 0

    @property
    def islands(self) -> NDArray[np.bool_]:
        """Stable cells above an unstable one, shape (rows, columns)."""
        below = np.maximum.accumulate(self.unstable > 0, axis=0)
        return self.stable & below


def stability_chart(
    process: OneModeProcess, spindle_hz: ArrayLike, pitch_difference: ArrayLike, stiffness: ArrayLike
) -> StabilityChart:
    """Return the chart of one bar mode over columns of spindle speed and pitch difference.

    Parameters
    ----------
    process : OneModeProcess
        Bar and cut.
    spindle_hz : array_like
        Spindle speed of each column (Hz), one or shape (columns,).
    pitch_difference : array_like
        Pitch difference of each column (rad), in (-2 pi, 2 pi), one or shape (columns,).
    stiffness : array_like
        Radial stiffness of one tool in each row (N/m), rising, above 0, shape (rows,).

    Returns
    -------
    StabilityChart
        Every cell, and the lowest border of each column.
    """
    speed, difference = np.broadcast_arrays(
        np.atleast_1d(np.asarray(spindle_hz, dtype=np.float64)),
        np.atleast_1d(np.asarray(pitch_difference, dtype=np.float64)),
    )
    rows = np.ascontiguousarray(np.atleast_1d(np.asarray(stiffness, dtype=np.float64)))
    _check(speed, difference, rows)
    omega, w_n = 2.0 * np.pi * speed, 2.0 * np.pi * process.natural_frequency_hz
    m = finite("modal_mass", process.modal_mass)
    damping = 2.0 * process.damping_ratio * m * w_n + 2.0 * process.process_damping
    columns = len(speed)
    unstable, limit, limit_w = np.zeros((len(rows), columns)), np.empty(columns), np.empty(columns)
    status = kernels.chart(
        m, np.full(columns, damping), m * w_n**2, np.full(columns, float(process.overlap)), np.pi / omega,
        0.5 * difference / omega, rows, _PER_TURN, np.empty((_MOST, 3)), np.empty(_MOST, dtype=np.int64), unstable,
        limit, limit_w,
    )  # fmt: skip
    if status != kernels.Status.OK:
        raise StabilityUnresolved(f"more than {_MOST} borders in one column at {speed.min():.4g} turns per second")
    counts = np.rint(unstable).astype(np.int64)
    if counts.min(initial=0) < 0:
        raise StabilityUnresolved("a border was missed: the number of unstable roots became negative")
    return StabilityChart(stiffness=rows, unstable=counts, limit=limit, limit_hz=limit_w / (2.0 * np.pi))


def _check(speed: Floats, difference: Floats, rows: Floats) -> None:
    if speed.ndim != 1 or not (np.isfinite(speed) & (speed > 0.0)).all():
        raise ValueError(f"spindle_hz must be positive and finite, shape (columns,), got {speed}")
    if not (np.abs(difference) < 2.0 * np.pi).all():
        raise ValueError(f"pitch_difference must be in (-2 pi, 2 pi) rad, got {difference}")
    if rows.ndim != 1 or not rows.size or not (np.isfinite(rows) & (rows > 0.0)).all() or (np.diff(rows) <= 0.0).any():
        raise ValueError(f"stiffness must be positive and rising, shape (rows,), got {rows}")
