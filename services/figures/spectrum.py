"""Short-time spectra, and how they are drawn."""

# pyright: reportUnknownMemberType=false

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from matplotlib.axes import Axes
from matplotlib.image import AxesImage

from services.figures.style import POWER
from services.messages import Floats

WINDOW_S = 0.050
COLUMNS = 640


@dataclass(frozen=True, slots=True, kw_only=True)
class Spectrogram:
    """Amplitude of a signal over time and frequency.

    Attributes
    ----------
    time_s, frequency_hz
        Middle of each window (s), shape (k,), and the bins (Hz), shape (f,).
    level_db
        Amplitude in dB over 1 unit of the signal, shape (f, k).
    """

    time_s: Floats
    frequency_hz: Floats
    level_db: Floats


def spectrogram(
    values: Floats, sample_rate_hz: float, window_s: tuple[float, float], top_hz: float, length_s: float = WINDOW_S
) -> Spectrogram | None:
    """Compute Hann-windowed spectra of one stretch of a signal, None when it is shorter than two windows."""
    size = max(round(length_s * sample_rate_hz), 16)
    first = max(round(window_s[0] * sample_rate_hz) - size // 2, 0)
    part = values[first : round(window_s[1] * sample_rate_hz) + size // 2]
    if part.size < 2 * size:
        return None
    hop = max((part.size - size) // COLUMNS, 1)
    frames = np.lib.stride_tricks.sliding_window_view(part, size)[::hop]
    taper = np.hanning(size)
    spectra = np.fft.rfft((frames - frames.mean(axis=1, keepdims=True)) * taper, n=4 * size, axis=1)
    frequency = np.arange(2 * size + 1, dtype=np.float64) * (0.25 * sample_rate_hz / size)
    keep = frequency <= top_hz
    amplitude = np.abs(spectra[:, keep]) * (2.0 / taper.sum())
    time_s = (first + np.arange(len(frames), dtype=np.float64) * hop + 0.5 * size) / sample_rate_hz
    level = 20.0 * np.log10(np.maximum(amplitude.T, 1e-12))
    return Spectrogram(time_s=time_s, frequency_hz=frequency[keep], level_db=level)


def together(pictures: Sequence[Spectrogram | None]) -> Spectrogram | None:
    """Return the spectrogram of several channels of one length: their powers added."""
    shown = [picture for picture in pictures if picture is not None]
    if len(shown) < 2:
        return shown[0] if shown else None
    power = sum(10.0 ** (picture.level_db / 10.0) for picture in shown)
    return replace(shown[0], level_db=10.0 * np.log10(power))


def scale_of(*pictures: Spectrogram | None, least_top_db: float = -200.0) -> tuple[float, float]:
    """Find one colour scale (dB) for several spectrograms: from the common floor to the strongest line.

    `least_top_db` keeps plain noise from being stretched until it looks like something.
    """
    shown = [picture for picture in pictures if picture is not None]
    if not shown:
        return -40.0, 20.0
    top = max(float(np.percentile(picture.level_db, 99.97)) for picture in shown)
    floor = min(float(np.percentile(picture.level_db, 55.0)) for picture in shown)
    high = max(5.0 * np.ceil(top / 5.0), least_top_db)
    return float(max(min(5.0 * np.floor(floor / 5.0), high - 40.0), high - 60.0)), float(high)


def draw_spectrogram(axes: Axes, picture: Spectrogram, scale_db: tuple[float, float]) -> AxesImage:
    """Lay a spectrogram into axes whose limits it sets."""
    half_t = 0.5 * (picture.time_s[1] - picture.time_s[0])
    half_f = 0.5 * (picture.frequency_hz[1] - picture.frequency_hz[0])
    extent = (
        picture.time_s[0] - half_t, picture.time_s[-1] + half_t,
        picture.frequency_hz[0] - half_f, picture.frequency_hz[-1] + half_f,
    )  # fmt: skip
    image = axes.imshow(
        picture.level_db, origin="lower", aspect="auto", extent=extent, cmap=POWER,
        vmin=scale_db[0], vmax=scale_db[1], interpolation="bilinear", interpolation_stage="data",
    )  # fmt: skip
    axes.grid(visible=False)
    return image
