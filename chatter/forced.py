"""When forced vibration is most of a recording: what a look at its level alone would take for chatter."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from chatter.episodes import GRID, LOUD, SLOW, spans
from chatter.separation import Separated, line_during

Floats = NDArray[np.float64]

MOST, LEAST = 0.5, 0.5
"""Part of the energy in the band that the forced lines hold, and for how long (s)."""
LOUDEST = 0.98
"""Quantile of the level in time that counts as the loudest: a knock does not."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Forced:
    """A stretch in which forced lines dominate.

    Parameters
    ----------
    start, end : float
        Time from the start (s).
    frequency_hz : float
        Frequency of the strongest forced line (Hz).
    share : float
        Part of the energy in the band that forced lines hold, 0...1.
    """

    start: float
    end: float
    frequency_hz: float
    share: float


def forced_episodes(parts: Separated, sample_rate_hz: float) -> list[Forced]:
    """Return the episodes in which forced lines hold most of the band, in order of time.

    Parameters
    ----------
    parts : Separated
        The recording.
    sample_rate_hz : float
        Sampling rate (Hz).
    """
    step = max(round(GRID * sample_rate_hz), 1)
    whole, forced = (_level(x, step) for x in (parts.whole, parts.whole - parts.free))
    if not whole.size:
        return []
    on = (forced >= MOST * whole) & (forced >= LOUD * float(np.quantile(whole, LOUDEST))) & (whole > 0.0)
    found = []
    for a, b in spans(on):
        if (b - a) * GRID < LEAST:
            continue
        line = line_during(parts, sample_rate_hz, (a * GRID, b * GRID), forced=True)
        if line is not None:
            end = b * GRID if b < len(whole) - 5 else len(parts.free) / sample_rate_hz
            share = float(np.clip(forced[a:b].sum() / whole[a:b].sum(), 0.0, 1.0))
            found.append(Forced(start=a * GRID if a > 5 else 0.0, end=end, frequency_hz=line, share=share))
    return found


def _level(signal: Floats, step: int) -> Floats:
    """Return the mean square on the grid, shape (n,)."""
    count = len(signal) // step
    square = (signal[: count * step] ** 2).sum(axis=1).reshape(count, step).mean(axis=1)
    return np.asarray(uniform_filter1d(square, max(round(SLOW / GRID), 1), mode="nearest"), dtype=np.float64)
