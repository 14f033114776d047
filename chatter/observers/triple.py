"""Cutting force of a drive of three inertias: from the sum of all balances, or from one mode.

Yamada, PhD thesis, Keio University, 2017, eq. (2-49) and (2-61) to (2-63); the damping of a mode need not be
proportional: what the modes exchange through it is kept.
"""

import numpy as np
from numpy.typing import NDArray

from chatter.observers.balance import LEVEL, held
from chatter.observers.linear import LinearObserver
from chatter.observers.triple_axis import TripleAxis

MODES = ("rigid", "first", "second")


def triple_observer(
    drive: TripleAxis, sample_rate_hz: float, *, mode: str = "rigid", cutoff_hz: float = 1000.0, order: int = 4,
    compensation: str = "full",
) -> LinearObserver:  # fmt: skip
    """Return the estimate from one mode; the rigid one is the sum of the three balances.

    Its `update` takes the positions of motor and nut as columns of the motor position, shape (n, 2).

    Parameters
    ----------
    drive : TripleAxis
        Nominal drive.
    sample_rate_hz : float
        Sampling rate (Hz).
    mode : {"rigid", "first", "second"}
        Which mode.
    cutoff_hz : float
        Edge of the low-pass (Hz).
    order : int
        Its order.
    compensation : {"full", "thrust", "none", "raw"}
        See `LinearObserver`.
    """
    if mode not in MODES:
        raise ValueError(f"mode must be one of {', '.join(MODES)}, got {mode!r}")
    name = "triple" if mode == "rigid" else f"triple_{mode}"
    gains = modal_balance(drive, sample_rate_hz, MODES.index(mode))
    return LinearObserver(
        name, drive, sample_rate_hz, gains, cutoff_hz=cutoff_hz, order=order, compensation=compensation
    )


def modal_balance(drive: TripleAxis, sample_rate_hz: float, mode: int) -> NDArray[np.float64]:
    """Return (phi_1 u' - phi' (M a + C v + K x))/phi_3 as weights, shape (4, 1, 3).

    Parameters
    ----------
    drive : TripleAxis
        Nominal drive.
    sample_rate_hz : float
        Sampling rate (Hz).
    mode : int
        0 rigid, 1 first, 2 second vibration mode.
    """
    shape = drive.modes()[1][:, mode]
    mass, damping, stiffness = (shape @ matrix / shape[2] for matrix in drive.matrices())
    gains = np.zeros((4, 1, 3))
    gains[:3, 0, 2] = -mass * sample_rate_hz**2
    gains[:3, 0, 1] = -damping * 0.5 * sample_rate_hz
    gains[:3, 0] -= np.outer(stiffness, LEVEL)
    gains[3, 0] = shape[0] / shape[2] * held(drive.omega_current, sample_rate_hz)
    return gains
