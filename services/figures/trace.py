"""How strong a signal is in a band, over time."""

from __future__ import annotations

import numpy as np
from scipy import signal

from chatter import MovingVariance
from services.messages import Floats

WINDOW_S = 0.1
_MOST_POINTS = 2000


def band_level(samples: Floats, sample_rate_hz: float, band_hz: tuple[float, float]) -> tuple[Floats, Floats]:
    """Return time (s) and RMS in a band over the last 0.1 s, all channels together; shape (k,) each.

    Parameters
    ----------
    samples
        shape (n, channels), finite.
    sample_rate_hz
        Sampling rate (Hz).
    band_hz
        The band (Hz), below half the rate.
    """
    high = min(band_hz[1], 0.49 * sample_rate_hz)
    sos = signal.butter(4, (min(band_hz[0], 0.9 * high), high), btype="bandpass", fs=sample_rate_hz, output="sos")
    inside = np.asarray(signal.sosfilt(sos, samples - samples.mean(axis=0), axis=0))
    variance = MovingVariance(_window(sample_rate_hz), channels=samples.shape[1])
    return _thinned(np.sqrt(np.asarray(variance.update(inside)).sum(axis=1)), sample_rate_hz)


def _window(sample_rate_hz: float) -> int:
    return max(round(WINDOW_S * sample_rate_hz), 2)


def _thinned(level: Floats, sample_rate_hz: float) -> tuple[Floats, Floats]:
    """Return some 2000 points; each stands at the middle of its window."""
    window = _window(sample_rate_hz)
    step = max(level.size // _MOST_POINTS, 1)
    at = np.arange(window, level.size, step, dtype=np.intp)
    return np.asarray((at - 0.5 * window) / sample_rate_hz, dtype=np.float64), level[at]
