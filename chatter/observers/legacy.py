"""The filters of the publications, to set their numbers beside ours; nothing else uses them.

The thesis differentiates by bilinear pseudo-differentiators g s/(s + g), the fitting paper by a low-pass of second
order times M s^2 + C s. At the same edge both are noisier than the kernel of `LinearObserver`.
"""

import numpy as np
from numpy.typing import NDArray

from chatter.observers.balance import motor_balance, stage_balance
from chatter.observers.linear import Drives, LinearObserver, single_or_turret
from chatter.observers.nominal import NominalFeedDrive

Floats = NDArray[np.float64]


def legacy_observer(
    drives: NominalFeedDrive | Drives, sample_rate_hz: float, weight: float, *, cutoff_hz: float = 1000.0,
    derivative_bandwidth: float = 5000.0,
) -> LinearObserver:  # fmt: skip
    """Return a member of the two-encoder family as the thesis discretises it: every channel through both low-passes.

    The bilinear s is 2/T (1 - z)/(1 + z); its (1 + z)^2 is put into the taps, (1, 2, 1)/4 against (1, -2, 1)/T^2, and
    leaves a pole of each low-pass. Yamada, PhD thesis, Keio University, 2017, Table 4-1.

    Parameters
    ----------
    drives : NominalFeedDrive, SingleAxis or NominalTurret
        Nominal drives.
    sample_rate_hz : float
        Sampling rate (Hz).
    weight : float
        lambda of the family.
    cutoff_hz : float
        g_cut of the first-order low-pass of the observer (Hz).
    derivative_bandwidth : float
        g_LPF of the pseudo-differentiators (rad/s).
    """
    system = single_or_turret(drives)
    gains = stage_balance(system, sample_rate_hz) + weight * motor_balance(system, sample_rate_hz)
    gains[:, :, 2] += gains[:, :, 0] * (1.0 / 4.0 - 1.0 / 12.0)
    rows: list[list[float]] = []
    for omega in (derivative_bandwidth, 2.0 * np.pi * cutoff_hz):
        pole = (omega - 2.0 * sample_rate_hz) / (omega + 2.0 * sample_rate_hz)
        rows.append([1.0 + pole, 0.0, 0.0, pole, 0.0])
    return LinearObserver("legacy", system, sample_rate_hz, gains, cutoff_hz=cutoff_hz, sections=np.array(rows))


def smoothed_inertia(edge_hz: float, sample_rate_hz: float, mass: float, damping: float) -> Floats:
    """Return Q (M s^2 + C s) with a Butterworth Q of second order, bilinear with prewarping, shape (1, 5).

    Hayashi, Fujimoto and others, eq. (5) to (7); the print leaves damping and discretisation of Q open.

    Parameters
    ----------
    edge_hz : float
        Edge of Q (Hz).
    sample_rate_hz : float
        Sampling rate (Hz).
    mass : float
        (kg), or an inertia over the travel per radian (kg m).
    damping : float
        (N s/m), likewise.
    """
    if not 0.0 < edge_hz < 0.5 * sample_rate_hz:
        raise ValueError(f"edge_hz must be in (0, {0.5 * sample_rate_hz:g}), got {edge_hz}")
    k = 2.0 * sample_rate_hz
    w = k * np.tan(np.pi * edge_hz / sample_rate_hz)
    root = np.sqrt(2.0) * w * k
    below = np.array([k * k + root + w * w, 2.0 * (w * w - k * k), k * k - root + w * w])
    above = mass * k * k * np.array([1.0, -2.0, 1.0]) + damping * k * np.array([1.0, 0.0, -1.0])
    return np.array([np.concatenate([w * w * above, below[1:]]) / below[0]])
