"""Servo signals as they come from a machine: what is wrong with them is named, what can be put right is.

An observer trusts its signals; these functions stand before it.
"""

from dataclasses import dataclass
from math import isfinite

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicSpline

from chatter.observers.nominal import NominalFeedDrive

Floats = NDArray[np.float64]

FASTEST = 2.0
"""Fastest slide that is believed (m/s)."""
STUCK_COUNTS = 20.0
"""Counts that the other encoder must have moved while one stood still, to call it stuck."""
STUCK_TIME = 0.05
"""For so long (s)."""
MOST_JITTER = 0.5
"""Largest deviation of a time stamp from its place, in samples, that can be resampled."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Fault:
    """Something that makes the signals of an axis useless.

    Parameters
    ----------
    signal : str
        Which.
    sample : int
        Where it was first seen.
    sentence : str
        What and where, for people.
    """

    signal: str
    sample: int
    sentence: str


def unwrapped(position: ArrayLike, period: float) -> Floats:
    """Return a position whose counter wraps as one that goes on, shape (n,).

    Parameters
    ----------
    position : array_like, shape (n,)
        Position (m).
    period : float
        Travel after which the counter begins anew (m).
    """
    if not (isfinite(period) and period > 0.0):
        raise ValueError(f"period must be positive, got {period}")
    return np.asarray(np.unwrap(np.asarray(position, dtype=np.float64), period=period), dtype=np.float64)


def even(time: ArrayLike, signals: ArrayLike, sample_rate_hz: float) -> tuple[Floats, float]:
    """Return signals on an even grid, shape (n, channels), and the largest deviation of a time stamp (samples).

    Small jitter is resampled by cubic splines; observers weigh second differences and can not bear it.

    Parameters
    ----------
    time : array_like, shape (n,)
        Time stamps (s).
    signals : array_like, shape (n, channels)
        Signals.
    sample_rate_hz : float
        Sampling rate (Hz).
    """
    stamps, values = np.asarray(time, dtype=np.float64), np.asarray(signals, dtype=np.float64)
    if stamps.ndim != 1 or values.shape[:1] != stamps.shape or len(stamps) < 4:
        raise ValueError(f"time must be of shape (n,), n >= 4, one for each row, got {stamps.shape} for {values.shape}")
    step = np.diff(stamps)
    if not (step > 0.0).all():
        where = int(np.flatnonzero(~(step > 0.0))[0])
        raise ValueError(f"time must increase, got {stamps[where + 1]:.9g} s after {stamps[where]:.9g} s")
    place = (stamps - stamps[0]) * sample_rate_hz
    deviation = place - np.arange(len(stamps))
    deviation -= 0.5 * (deviation.max() + deviation.min())
    jitter = float(np.abs(deviation).max())
    if jitter > MOST_JITTER:
        raise ValueError(
            f"time must be even within {MOST_JITTER:g} samples of {1e3 / sample_rate_hz:g} ms, got a jitter of"
            f" {jitter:.3g} samples: resample the recording, or give its true rate"
        )
    if jitter < 1e-6:
        return values, jitter
    grid = np.clip(stamps[0] + np.arange(len(stamps)) / sample_rate_hz, stamps[0], stamps[-1])
    return np.asarray(CubicSpline(stamps, values, axis=0)(grid), dtype=np.float64), jitter


def faults(
    drive: NominalFeedDrive, sample_rate_hz: float, motor_position: ArrayLike, stage_position: ArrayLike
) -> list[Fault]:
    """Return what is wrong with the positions of one axis, in order of the sample where it was seen.

    Parameters
    ----------
    drive : NominalFeedDrive
        Nominal drive.
    sample_rate_hz : float
        Sampling rate (Hz).
    motor_position, stage_position : array_like, shape (n,)
        Positions (m).
    """
    motor, stage = (np.asarray(p, dtype=np.float64) for p in (motor_position, stage_position))
    found = [
        *_jumps("motor_position", motor, sample_rate_hz),
        *_jumps("stage_position", stage, sample_rate_hz),
        *_stuck("motor_position", motor, stage, drive.motor_resolution, drive.stage_resolution, sample_rate_hz),
        *_stuck("stage_position", stage, motor, drive.stage_resolution, drive.motor_resolution, sample_rate_hz),
    ]
    if not found:
        found += _against(drive, motor, stage)
    return sorted(found, key=lambda fault: fault.sample)


def _jumps(name: str, position: Floats, rate: float) -> list[Fault]:
    step = np.diff(position)
    far = np.flatnonzero(np.abs(step) * rate > FASTEST)
    if not far.size:
        return []
    k = int(far[0])
    sentence = (
        f"{name} jumps by {1e3 * step[k]:.4g} mm at sample {k + 1} ({1e3 * (k + 1) / rate:.6g} ms): faster than"
        f" {FASTEST:g} m/s; a counter that wraps, or a count that was lost"
    )
    return [Fault(signal=name, sample=k + 1, sentence=sentence)]


def _stuck(name: str, position: Floats, other: Floats, count: float, other_count: float, rate: float) -> list[Fault]:
    window = round(STUCK_TIME * rate)
    if len(position) <= window:
        return []
    still = np.concatenate([[0], np.cumsum(np.diff(position) != 0.0)])
    stands = still[window:] == still[:-window]
    moved = np.abs(other[window:] - other[:-window]) > STUCK_COUNTS * max(count, other_count)
    bad = np.flatnonzero(stands & moved & (max(count, other_count) > 0.0))
    if not bad.size:
        return []
    k = int(bad[0])
    sentence = (
        f"{name} stands still for {1e3 * STUCK_TIME:g} ms from sample {k} while the other encoder moves by"
        f" {1e6 * abs(other[k + window] - other[k]):.4g} um: a stuck or missing encoder"
    )
    return [Fault(signal=name, sample=k, sentence=sentence)]


def _against(drive: NominalFeedDrive, motor: Floats, stage: Floats) -> list[Fault]:
    """Say when both encoders run in opposite directions, once they have moved far enough to tell."""
    travel = motor - motor[:1], stage - stage[:1]
    least = STUCK_COUNTS * max(drive.motor_resolution, drive.stage_resolution, 1e-9)
    far = np.flatnonzero((np.abs(travel[0]) > least) & (np.abs(travel[1]) > least))
    if not far.size:
        return []
    k = int(far[0])
    both = float((travel[0] * travel[1]).sum() / np.sqrt((travel[0] ** 2).sum() * (travel[1] ** 2).sum()))
    if both > -0.5:
        return []
    sentence = f"stage_position runs against motor_position (correlation {both:.2f}): one of them has the wrong sign"
    return [Fault(signal="stage_position", sample=k, sentence=sentence)]
