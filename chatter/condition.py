"""What a recorder did to a signal: values stored several times, clipping, gaps, more samples than are needed."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import resample_poly

Floats = NDArray[np.float64]

CHANGES = 64
"""Changes of value that must be there before their spacing tells anything."""
AGREE, MOST_HELD = 0.98, 64
"""Part of the changes that must lie on a grid for values to count as held, and the longest that is looked for."""
PILED, PILED_RUNS, PILED_RATIO = 1e-4, 10, 2.0
"""Part of the samples at an extreme, number of times that they stay there, and ratio to how often the next value inside
is taken, from which a channel counts as clipped. The rounded crest of a wave has a ratio of 1.4."""


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


def held_for(channel: Floats) -> int:
    """Return for how many samples every value is held: 1 unless the changes lie on such a grid.

    Parameters
    ----------
    channel : ndarray, shape (n,)
        Samples.
    """
    changes = np.flatnonzero(np.diff(np.nan_to_num(channel)) != 0.0) + 1
    if changes.size < CHANGES:
        return 1
    gaps = np.diff(changes)
    for times in range(min(int(np.quantile(gaps, 1.0 - AGREE)), MOST_HELD), 1, -1):
        if (gaps % times == 0).mean() >= AGREE:
            return times
    return 1


def repeats(samples: Floats) -> tuple[int, int]:
    """Return how often every value is stored in all channels that change, and the index of the first stored as often.

    Parameters
    ----------
    samples : ndarray, shape (n, channels)
        Samples.
    """
    finite = np.where(np.isfinite(samples), samples, 0.0)
    changing = [channel for channel in finite.T if channel.size and (channel != channel[0]).any()]
    times = min((held_for(channel) for channel in changing), default=1)
    if times == 1:
        return 1, 0
    return times, int(np.flatnonzero(np.diff(changing[0]) != 0.0)[0] + 1) % times


def clipped(channel: Floats) -> float:
    """Return the part of the samples that stand at the largest or the smallest value, 0 if that is no clipping.

    Parameters
    ----------
    channel : ndarray, shape (n,)
        Samples.
    """
    finite = channel[np.isfinite(channel)]
    if finite.size < 2 or finite.min() == finite.max():
        return 0.0
    share = 0.0
    for wave in (finite, -finite):
        at = wave == wave.max()
        flat = at[1:] & at[:-1]  # a peak that is not clipped has one highest sample
        runs = int(np.count_nonzero(flat[1:] & ~flat[:-1])) + int(flat[:1].sum())
        inside = wave[~at]
        beside = int(np.count_nonzero(inside == inside.max()))
        if runs >= PILED_RUNS and at.sum() >= PILED_RATIO * beside:
            share += float(at.mean())
    return share if share >= PILED else 0.0


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
    for k, share in enumerate(clipped(channel) for channel in samples.T):
        if share > 0.0:
            which = f" of channel {k}" if samples.shape[1] > 1 else ""
            notes.append(
                f"clipped: {100.0 * share:.2g} % of the samples{which} stand at the largest or the smallest value:"
                " harmonics of a strong line are then made by the recorder"
            )
    if not good.all():
        notes.append(f"{int((~good).sum())} samples are not finite and were left out")
        at = np.arange(len(samples))
        whole = np.stack([np.interp(at, at[good], channel[good]) for channel in samples.T], axis=1)
    if (whole == whole[0]).all():
        notes.append("the signal is constant: a dead channel tells nothing")
    largest = float(np.abs(whole).max(initial=0.0))
    if largest > 0.0:
        whole = np.ldexp(whole, -int(np.floor(np.log2(largest))))
    step = max(int(sample_rate_hz / (2.5 * high_hz)), 1)
    thin = whole - whole.mean(axis=0)
    if step > 1:
        thin = np.asarray(resample_poly(thin, 1, step, axis=0, padtype="line"), dtype=np.float64)
    return Conditioned(samples=thin, sample_rate_hz=sample_rate_hz / step, notes=tuple(notes))
