"""Positions fitted over a short stretch by a line and harmonics of the spindle before they are differentiated.

Hayashi, Fujimoto and others, Fitting-based cutting force estimation, eq. (13) to (26): the centre of a least-squares
fit is a constant symmetric filter, so nothing is fitted while cutting; its taps depend on the spindle speed alone.
"""

import numpy as np
from numpy.typing import NDArray

from chatter.blocks import positive_integer
from chatter.observers.balance import motor_balance, stage_balance
from chatter.observers.linear import Drives, LinearObserver, single_or_turret
from chatter.observers.nominal import NominalFeedDrive

Floats = NDArray[np.float64]

RANK = 1e-10
"""Singular values below this part of the largest are left out: slow spindle, short stretch."""


def fitted_taps(half: int, harmonics: int, spindle_hz: float, sample_rate_hz: float) -> Floats:
    """Return the weights of the samples in the centre of the fit, shape (2 half + 1,).

    Parameters
    ----------
    half : int
        Samples N on either side of the centre.
    harmonics : int
        Highest harmonic N_max of the spindle in the basis [1, t, sin(i omega t), cos(i omega t)].
    spindle_hz : float
        Spindle speed (Hz).
    sample_rate_hz : float
        Sampling rate (Hz).
    """
    half, harmonics = positive_integer("half", half), positive_integer("harmonics", harmonics)
    if not (np.isfinite(spindle_hz) and spindle_hz > 0.0):
        raise ValueError(f"spindle_hz must be positive, got {spindle_hz}")
    if harmonics * spindle_hz >= 0.5 * sample_rate_hz:
        raise ValueError(
            f"harmonics must stay below half the sampling rate ({0.5 * sample_rate_hz:g} Hz), got {harmonics}"
            f" x {spindle_hz:g} Hz"
        )
    index = np.arange(-half, half + 1) / half  # scaled, so that powers of time do not spoil the rank
    angle = 2.0 * np.pi * spindle_hz * half / sample_rate_hz * np.outer(index, np.arange(1, harmonics + 1))
    even = np.column_stack([np.ones(len(index)), np.cos(angle)])  # the odd functions vanish in the centre
    taps = np.linalg.pinv(even, rcond=RANK).T @ np.ones(harmonics + 1)
    return np.asarray(0.5 * (taps + taps[::-1]), dtype=np.float64)


def fitted_observer(
    drives: NominalFeedDrive | Drives, sample_rate_hz: float, *, spindle_hz: float, half: int = 10,
    harmonics: int = 4, cutoff_hz: float = 1000.0, order: int = 4, compensation: str = "full",
) -> LinearObserver:  # fmt: skip
    """Return MEDOB on fitted positions; the thrust is delayed beside them.

    Parameters
    ----------
    drives : NominalFeedDrive, SingleAxis or NominalTurret
        Nominal drives.
    sample_rate_hz : float
        Sampling rate (Hz).
    spindle_hz : float
        Spindle speed (Hz).
    half : int
        Samples N on either side of the centre.
    harmonics : int
        Highest harmonic of the spindle.
    cutoff_hz : float
        Edge of the low-pass (Hz).
    order : int
        Its order.
    compensation : {"full", "thrust", "none", "raw"}
        See `LinearObserver`.
    """
    system = single_or_turret(drives)
    gains = stage_balance(system, sample_rate_hz) + motor_balance(system, sample_rate_hz)
    return LinearObserver(
        "fitted", system, sample_rate_hz, gains, cutoff_hz=cutoff_hz, order=order, compensation=compensation,
        smoothing=fitted_taps(half, harmonics, spindle_hz, sample_rate_hz),
    )  # fmt: skip
