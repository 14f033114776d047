"""Lines that the encoders and the motor of a moving axis make by themselves, and notches that take them out.

An encoder interpolates between the periods of its signal; its error repeats with each period, so that a feed speed v
makes lines at n v over that period. Where such a line lies within 5 % of a harmonic of tooth passing, the notch would
take out the force that is looked for, and is left out. A reference to compare with passes the same notches.
"""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

CLOSE = 0.05
"""Part of a tooth-pass harmonic within which no notch is set."""


def encoder_lines_hz(speed: float, periods: Iterable[float], orders: int, highest_hz: float) -> Floats:
    """Return the lines n v / period below a frequency (Hz), in order.

    Parameters
    ----------
    speed : float
        Feed speed (m/s).
    periods : iterable of float
        Travel in one period of each signal (m): lead over the periods of the rotary encoder, grating of the scale,
        lead over the poles of the motor.
    orders : int
        Highest n.
    highest_hz : float
        Frequency below which lines count (Hz).
    """
    if orders < 1:
        raise ValueError(f"orders must be at least 1, got {orders}")
    lines = []
    for period in periods:
        if not period > 0.0:
            raise ValueError(f"periods must be positive, got {period}")
        lines.append(abs(speed) / period * np.arange(1, orders + 1))
    every = np.unique(np.concatenate([np.zeros(0), *lines]))
    return every[(every > 0.0) & (every < highest_hz)]


def away_from_tooth_passing(lines_hz: Floats, tooth_pass_hz: float) -> Floats:
    """Return the lines that do not lie close to a harmonic of tooth passing (Hz).

    Parameters
    ----------
    lines_hz : ndarray, shape (n,)
        Lines (Hz).
    tooth_pass_hz : float
        Frequency of tooth passing (Hz); 0 when nothing cuts.
    """
    if tooth_pass_hz <= 0.0:
        return lines_hz
    harmonic = np.maximum(np.round(lines_hz / tooth_pass_hz), 1.0) * tooth_pass_hz
    return lines_hz[np.abs(lines_hz - harmonic) > CLOSE * harmonic]


def notches(lines_hz: Floats, width: float, sample_rate_hz: float) -> Floats:
    """Return sections that take lines out, gain 1 at zero frequency and far away, shape (n, 5): b0 b1 b2 a1 a2.

    Parameters
    ----------
    lines_hz : ndarray, shape (n,)
        Lines (Hz).
    width : float
        Width at -3 dB over the frequency of the line, in (0, 1).
    sample_rate_hz : float
        Sampling rate (Hz).
    """
    if not 0.0 < width < 1.0:
        raise ValueError(f"width must be in (0, 1), got {width}")
    if np.any((lines_hz <= 0.0) | (lines_hz >= 0.5 * sample_rate_hz)):
        raise ValueError(f"lines_hz must be in (0, {0.5 * sample_rate_hz:g}), got {lines_hz}")
    angle = 2.0 * np.pi * lines_hz / sample_rate_hz
    half = np.tan(0.5 * width * angle)
    scale = 1.0 / (1.0 + half)
    middle = -2.0 * np.cos(angle) * scale
    return np.stack([scale, middle, scale, middle, (1.0 - half) * scale], axis=1)
