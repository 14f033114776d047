"""Lines between the bins: their frequency, amplitude and growth from the last stretch of a signal."""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

OVERSAMPLING = 2.5
"""Baseband samples per hertz of half bandwidth: the kernel of `baseband` is 40 dB down where it folds."""
PRESENT = 0.7
"""Least amplitude in a stretch over that in its newer half: less and the line was not there in the older half."""
TAPS = 4
"""Length of the kernel in baseband samples."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Line:
    """One line of a spectrum at the end of the stretch that it was found in.

    Parameters
    ----------
    frequency_hz : float
        Frequency (Hz).
    amplitude : float
        Root sum of squares of the amplitudes in the channels.
    growth : float
        Growth rate (1/s).
    explained : float
        Share of the energy near the line that the fitted lines explain, 0...1.
    span : float
        Length of the stretch (s).
    """

    frequency_hz: float
    amplitude: float
    growth: float
    explained: float
    span: float


def hann_power(spectrum: Complexes, window: int) -> Floats:
    """Return the squared line amplitudes under a Hann window, summed over the channels, shape (bins - 2,).

    The window is applied in the frequency domain, so the first and the last bin only help their neighbours.

    Parameters
    ----------
    spectrum : ndarray, shape (channels, bins)
        Plain spectrum at spacing sample_rate / window.
    window : int
        Samples in the window.
    """
    hann = spectrum[:, 1:-1] - 0.5 * (spectrum[:, :-2] + spectrum[:, 2:])
    parts = hann.view(np.float64)
    parts *= parts
    return parts.reshape(len(hann), -1, 2).sum(axis=(0, 2)) * (2.0 / window) ** 2


def baseband(signal: Floats, centre_hz: float, half_band_hz: float, sample_rate_hz: float) -> tuple[Complexes, float]:
    """Return the end of a signal shifted down by a frequency and thinned out, shape (m, channels), and its rate (Hz).

    Only one side of the spectrum is kept, so there is no image at the negative frequency to bias an estimate. The
    last sample returned is centred half a kernel before the end of the signal.

    Parameters
    ----------
    signal : ndarray, shape (n, channels)
        Samples, the newest last.
    centre_hz : float
        Frequency that becomes zero (Hz).
    half_band_hz : float
        Half of the band kept (Hz).
    sample_rate_hz : float
        Sampling rate (Hz).
    """
    step = max(int(sample_rate_hz / (OVERSAMPLING * half_band_hz)), 1)
    kernel = smoothing(step)
    count = max((len(signal) - len(kernel)) // step + 1, 0)
    used = signal[len(signal) - len(kernel) - (count - 1) * step :] if count else signal[:0]
    turn = np.exp((-2j * np.pi * centre_hz / sample_rate_hz) * np.arange(1 - len(used), 1))
    mixed = used * turn[:, None]
    pieces = np.lib.stride_tricks.sliding_window_view(mixed, len(kernel), axis=0)[::step] if count else mixed
    return np.asarray(pieces @ kernel if count else mixed, dtype=np.complex128), sample_rate_hz / step


@lru_cache(maxsize=16)
def smoothing(step: int) -> Floats:
    """Return the kernel of the baseband, a squared sine, shape (TAPS step + 1,).

    Parameters
    ----------
    step : int
        Samples of the signal for one of the baseband.
    """
    length = TAPS * step + 1
    kernel = np.sin(np.pi * np.arange(1, length + 1) / (length + 1)) ** 2
    return kernel / kernel.sum()


def _kernel_gain(step: int, offset_hz: Floats, sample_rate_hz: float) -> Floats:
    """Return the gain of the kernel at distances (Hz) from the centre."""
    kernel = smoothing(step)
    half = np.arange(len(kernel)) - 0.5 * (len(kernel) - 1)
    return np.cos(2.0 * np.pi / sample_rate_hz * np.outer(offset_hz, half)) @ kernel


def pencil(signal: Floats, centre_hz: float, half_band_hz: float, sample_rate_hz: float, order: int = 4) -> list[Line]:
    """Return the lines near a frequency, strongest at the end first; `fit` of the baseband of a stretch.

    Parameters
    ----------
    signal : ndarray, shape (n, channels)
        Samples, the newest last.
    centre_hz : float
        Where to look (Hz).
    half_band_hz : float
        Half of the band looked at (Hz).
    sample_rate_hz : float
        Sampling rate (Hz).
    order : int
        Lines to fit.
    """
    slow, rate = baseband(signal, centre_hz, half_band_hz, sample_rate_hz)
    step = round(sample_rate_hz / rate)
    return [
        replace(line, frequency_hz=centre_hz + line.frequency_hz, span=len(signal) / sample_rate_hz)
        for line in fit(slow, rate, step, order)
        if abs(line.frequency_hz) <= half_band_hz
    ]


def fit(slow: Complexes, rate: float, step: int, order: int = 4) -> list[Line]:
    """Return the lines of a baseband, strongest at the end first, by the matrix pencil of all channels together.

    Growing and decaying lines are fitted as such, and lines closer than the inverse of the stretch are told apart;
    Hua and Sarkar, IEEE Trans. ASSP 38 (1990) 814, with a truncated singular value decomposition. Frequencies count
    from the centre of the baseband, the span is that of the slow samples.

    Parameters
    ----------
    slow : ndarray, shape (m, channels)
        Samples of the baseband, the newest last.
    rate : float
        Their rate (Hz).
    step : int
        Samples of the signal for one of them.
    order : int
        Lines to fit.
    """
    energy = float((slow.real**2 + slow.imag**2).sum())
    count = len(slow)
    if count < 3 * order or energy < np.finfo(np.float64).tiny / np.finfo(np.float64).eps:
        return []
    slow = slow / np.sqrt(energy)
    poles = _poles(slow, order)
    powers = poles[None, :] ** np.arange(1 - count, 1)[:, None]
    weights = np.linalg.lstsq(powers, slow, rcond=1e-9)[0]
    residual = slow - powers @ weights
    explained = min(max(1.0 - float((residual.real**2 + residual.imag**2).sum()), 0.0), 1.0)
    offset = np.asarray(np.angle(poles) * rate / (2.0 * np.pi), dtype=np.float64)
    gain = np.maximum(_kernel_gain(step, offset, rate * step), 0.05)
    amplitude = 2.0 * np.sqrt(energy * (weights.real**2 + weights.imag**2).sum(axis=1)) / gain
    growth = np.log(np.abs(poles)) * rate
    return [
        Line(
            frequency_hz=float(offset[i]),
            amplitude=float(amplitude[i]),
            growth=float(growth[i]),
            explained=explained,
            span=count / rate,
        )
        for i in np.argsort(-amplitude)
    ]


def _poles(slow: Complexes, order: int) -> Complexes:
    """Return the poles of the signal, each within e^8 over the stretch: what is beyond is a click, not a line."""
    count = len(slow)
    width = count // 2 + 1
    places = np.arange(count - width + 1)[:, None] + np.arange(width)
    rows = slow[places].transpose(2, 0, 1).reshape(-1, width)
    basis = np.linalg.svd(rows, full_matrices=False)[2][:order].T
    last = basis[-1].conj()
    inner = basis[:-1].conj().T @ basis[1:]  # the columns are orthonormal: what is left out is one row
    turn = inner + np.outer(last, basis[-1] @ inner) / max(1.0 - float((last.real**2 + last.imag**2).sum()), 1e-12)
    poles = np.linalg.eigvals(turn)
    size = np.abs(poles)
    bound = np.exp(8.0 / count)
    held = poles / np.maximum(size, np.finfo(np.float64).tiny) * np.clip(size, 1.0 / bound, bound)
    return held.astype(np.complex128)
