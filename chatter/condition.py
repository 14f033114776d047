"""What a recorder did to a signal: values stored several times, clipping, gaps, more samples than are needed."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import resample_poly

Floats = NDArray[np.float64]

CHANGES = 50
"""Changes of value that must fit, before values count as stored several times."""
PILED, PILED_LEAST, PILED_RATIO = 1e-3, 10, 2.0
"""Part of the samples, and number, that stand still at an extreme, and their ratio to those in the last 5 % before it,
from which a recording counts as clipped."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Conditioned:
    """A signal without gaps, at no higher a rate than is needed.

    Parameters
    ----------
    samples : ndarray, shape (n, channels)
        Samples of at most 2, with mean zero.
    sample_rate_hz : float
        Sampling rate (Hz).
    notes : tuple of str
        What was found.
    """

    samples: Floats
    sample_rate_hz: float
    notes: tuple[str, ...]


def repeats(samples: Floats) -> tuple[int, int]:
    """Return how often every value is stored, and the index of the first one stored as often.

    Parameters
    ----------
    samples : ndarray, shape (n, channels)
        Samples.
    """
    finite = np.where(np.isfinite(samples), samples, 0.0)
    changes = np.flatnonzero((finite[1:] != finite[:-1]).any(axis=1)) + 1
    if len(changes) < CHANGES:
        return 1, 0
    times = int(np.gcd.reduce(np.diff(changes)))
    return times, int(changes[0]) % times


def clipped(samples: Floats) -> float:
    """Return the part of the samples that stand at an extreme for three samples or more, 0 when they do not pile up.

    Parameters
    ----------
    samples : ndarray, shape (n, channels)
        Finite samples.
    """
    worst = 0.0
    for channel in samples.T:
        low, high = float(channel.min()), float(channel.max())
        if low == high:
            continue
        edge = 0.05 * (high - low) / 2.0
        for at, near in ((channel == high, channel >= high - edge), (channel == low, channel <= low + edge)):
            held = int((at[2:] & at[1:-1] & at[:-2]).sum())
            before = int((near & ~at).sum())
            if held >= max(PILED_LEAST, PILED * len(channel)) and at.sum() >= PILED_RATIO * before:
                worst += float(at.sum()) / len(channel)
    return min(worst, 1.0)


def conditioned(samples: Floats, sample_rate_hz: float, high_hz: float) -> Conditioned:
    """Return a signal ready for analysis, gaps bridged, scaled, and thinned to what a band needs.

    Parameters
    ----------
    samples : ndarray, shape (n, channels)
        Samples, at least one of them finite in all channels.
    sample_rate_hz : float
        Sampling rate (Hz).
    high_hz : float
        Upper end of the band (Hz).
    """
    notes = []
    good = np.isfinite(samples).all(axis=1)
    whole = samples
    if not good.all():
        notes.append(f"{int((~good).sum())} samples are not finite and were left out")
        at = np.arange(len(samples))
        whole = np.stack([np.interp(at, at[good], channel[good]) for channel in samples.T], axis=1)
    if (whole == whole[0]).all():
        notes.append("the signal is constant: a dead channel tells nothing")
    largest = float(np.abs(whole).max(initial=0.0))
    if largest > 0.0:
        whole = np.ldexp(whole, -int(np.floor(np.log2(largest))))
    piled = clipped(whole)
    if piled > 0.0:
        notes.append(f"clipped: {100.0 * piled:.2g} % of the samples stand at the limits of the range")
    step = max(int(sample_rate_hz / (2.5 * high_hz)), 1)
    thin = whole - whole.mean(axis=0)
    if step > 1:
        thin = np.asarray(resample_poly(thin, 1, step, axis=0, padtype="line"), dtype=np.float64)
    return Conditioned(samples=thin, sample_rate_hz=sample_rate_hz / step, notes=tuple(notes))
