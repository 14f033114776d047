"""Whether a line keeps itself up: how long its phase stays predictable, against what any structure could ring for."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from chatter.separation import reach
from chatter.spectrum import baseband

Floats = NDArray[np.float64]

PERIODS, LONGEST = 50.0, 0.2
"""Periods, and at most so many seconds, over which the phase must be predictable. Noise through a mode forgets its
phase as the mode rings: over 50 periods a damping of 0.5 % leaves exp(-1.6) = 0.2."""
LEAST_WINDOW = 0.25
"""Least length over which that is averaged (s)."""
LONGEST_TURN = 0.2
"""Longest turn that is looked back over (s): the lines of slower ones are not told from noise."""
COHERENT = 0.7
"""Coherence of a line that keeps itself up; half of it would be a damping of 0.1 %, less than any structure has."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Track:
    """A line followed through a recording, on a grid in time.

    Parameters
    ----------
    centre_hz : float
        About where it is (Hz).
    power : ndarray, shape (n,)
        Mean square near that frequency.
    coherence : ndarray, shape (n,)
        How well the phase is predicted, 0...1.
    frequency_hz : ndarray, shape (n,)
        Frequency at every time (Hz).
    """

    centre_hz: float
    power: Floats
    coherence: Floats
    frequency_hz: Floats


def followed(free: Floats, sample_rate_hz: float, centre_hz: float, time: Floats, turn: float | None = None) -> Track:
    """Return a line as it goes through a recording.

    Parameters
    ----------
    free : ndarray, shape (n, channels)
        The recording without forced lines.
    sample_rate_hz : float
        Sampling rate (Hz).
    centre_hz : float
        About where the line is (Hz).
    time : ndarray, shape (m,)
        Times that are asked for (s).
    turn : float or None
        Time of a revolution (s): a cut repeats the wave that the last one left, however the turn modulates it.
    """
    slow, rate = baseband(free, centre_hz, reach(centre_hz), sample_rate_hz)
    half_kernel = 2.0 / rate  # the kernel of `baseband` is four of its samples long
    at = (len(free) - 1) / sample_rate_hz - half_kernel - np.arange(len(slow))[::-1] / rate
    power, frequency = np.zeros(len(time)), np.full(len(time), centre_hz)
    coherence = np.zeros(len(time))
    lags = [predicted_over(centre_hz)]
    if turn is not None and lags[0] < turn <= LONGEST_TURN:
        lags.append(turn)
    for lag in (max(round(t * rate), 1) for t in lags):
        if len(slow) < lag + 2:
            break
        turned = (slow[lag:] * slow[:-lag].conj()).sum(axis=1)
        size = np.sqrt((np.abs(slow[lag:]) ** 2).sum(axis=1) * (np.abs(slow[:-lag]) ** 2).sum(axis=1))
        window = np.ones(min(max(round(LEAST_WINDOW * rate), 3 * lag, 3), len(turned)))
        held = np.convolve(turned, window, "same")
        sure = np.abs(held) / np.maximum(np.convolve(size, window, "same"), np.finfo(np.float64).tiny)
        middle = at[: len(turned)] + 0.5 * lag / rate
        coherence = np.maximum(coherence, np.interp(time, middle, sure))
        if lag == max(round(lags[0] * rate), 1):
            frequency = np.interp(time, middle, centre_hz + np.angle(held) * rate / (2.0 * np.pi * lag))
    if len(slow) > 1:
        gain = np.where(coherence >= COHERENT, _gain((frequency - centre_hz) * 2.0 * half_kernel), 1.0)
        power = np.interp(time, at, 2.0 * (np.abs(slow) ** 2).sum(axis=1)) / gain**2
    return Track(centre_hz=centre_hz, power=power, coherence=coherence, frequency_hz=frequency)


def _gain(bins: Floats) -> Floats:
    """Return what the Hann kernel leaves of a line at a distance from its centre, not less than a third."""
    distance = np.minimum(np.abs(bins), 0.99)
    return np.maximum(np.sinc(distance) / (1.0 - distance**2), 1.0 / 3.0)


def predicted_over(frequency_hz: float) -> float:
    """Return the time over which the phase of a line must be predictable (s).

    Parameters
    ----------
    frequency_hz : float
        Its frequency (Hz).
    """
    return min(PERIODS / frequency_hz, LONGEST)
