"""What a recording is put together from: noise, tones, blows, and what recorders do to a signal."""

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Truth = Literal["chatter", "stable"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Sample:
    """A recording with its truth."""

    signal: Floats
    rate_hz: float
    truth: Truth
    frequencies_hz: tuple[float, ...] = ()
    """Lines of the chatter; empty when stable."""
    span: tuple[float, float] | None = None
    """When it chatters (s)."""
    spindle_hz: float | None = None
    tools: int | None = None
    told: dict[str, object] = field(default_factory=dict)
    """What the judge is told."""
    must_note: str = ""
    """Text that a note must hold."""


def seconds(length: float, rate: float) -> Floats:
    return np.arange(int(length * rate)) / rate


def loguniform(rng: np.random.Generator, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def rms(signal: Floats) -> float:
    return float(np.sqrt(np.mean(signal**2))) or 1.0


def coloured(rng: np.random.Generator, count: int, slope: float) -> Floats:
    """Noise whose power falls as 1 / f**slope, of unit rms."""
    frequency = np.fft.rfftfreq(count, 1.0)
    frequency[0] = frequency[1]
    shaped = np.fft.irfft(np.fft.rfft(rng.normal(size=count)) * frequency ** (-0.5 * slope), count)
    return shaped / rms(shaped)


def mode(signal: Floats, rate: float, frequency_hz: float, damping: float) -> Floats:
    """A signal through one mode (acceleration over force)."""
    frequency = np.fft.rfftfreq(len(signal), 1.0 / rate)
    ratio = frequency / frequency_hz
    gain = -(ratio**2) / (1.0 - ratio**2 + 2j * damping * ratio)
    return np.fft.irfft(np.fft.rfft(signal) * gain, len(signal))


def room(rng: np.random.Generator, signal: Floats, rate: float) -> Floats:
    """A signal through structure and room: some broad resonances that raise and lower what passes by +-10 dB."""
    frequency = np.fft.rfftfreq(len(signal), 1.0 / rate)
    knots = np.exp(np.linspace(np.log(50.0), np.log(0.5 * rate), 14))
    level = rng.normal(0.0, 6.0, len(knots))
    gain = 10.0 ** (np.interp(np.log(np.maximum(frequency, 50.0)), np.log(knots), level) / 20.0)
    return np.fft.irfft(np.fft.rfft(signal) * gain, len(signal))


def wandering(rng: np.random.Generator, time: Floats, frequency_hz: float, relative: float, slowness: float) -> Floats:
    """Phase (cycles) of a line whose frequency wanders by a relative rms over a time."""
    rate = 1.0 / (time[1] - time[0])
    knots = max(int(time[-1] / slowness) + 2, 3)
    drift = np.interp(time, np.linspace(0.0, time[-1], knots), rng.normal(size=knots)) * relative
    return np.cumsum(frequency_hz * (1.0 + drift)) / rate


def fluctuating(rng: np.random.Generator, time: Floats, relative: float, slowness: float) -> Floats:
    knots = max(int(time[-1] / slowness) + 2, 3)
    return np.maximum(1.0 + relative * np.interp(time, np.linspace(0.0, time[-1], knots), rng.normal(size=knots)), 0.1)


def gate(time: Floats, start: float, end: float, edge: float) -> Floats:
    """One between two times, with edges of some length."""
    return np.clip((time - start) / edge + 0.5, 0.0, 1.0) * np.clip((end - time) / edge + 0.5, 0.0, 1.0)


def growing(time: Floats, start: float, growth: float) -> Floats:
    """An envelope that grows exponentially from -60 dB to one and stays."""
    return np.where(time < start, 0.0, np.exp(np.minimum(growth * (time - start) - 6.9, 0.0)))


def knocks(rng: np.random.Generator, time: Floats, rate: float, number: int, size: float) -> Floats:
    out = np.zeros_like(time)
    for _ in range(number):
        at = rng.integers(0, len(time))
        ring = time[: len(time) - at]
        for _ in range(rng.integers(1, 4)):
            frequency, damping = loguniform(rng, 150.0, 0.3 * rate), loguniform(rng, 0.004, 0.06)
            wave = np.exp(-2 * np.pi * damping * frequency * ring) * np.sin(2 * np.pi * frequency * ring)
            out[at:] += size * rng.uniform(0.3, 1.0) * wave
    return out


def tones(rng: np.random.Generator, time: Floats, rate: float, number: int, size: float) -> Floats:
    """Steady tones of fans, pumps and converters."""
    out = np.zeros_like(time)
    for _ in range(number):
        frequency = loguniform(rng, 60.0, 0.4 * rate)
        out += size * loguniform(rng, 0.1, 1.0) * np.sin(2 * np.pi * frequency * time + rng.uniform(0, 6.28))
    return out


def hum(rng: np.random.Generator, time: Floats, size: float) -> Floats:
    """Mains: 50 or 60 Hz and multiples."""
    base = rng.choice([50.0, 60.0]) * (1.0 + rng.normal(0.0, 2e-4))
    return sum(
        (size * rng.uniform(0.2, 1.0) / k**0.7 * np.sin(2 * np.pi * base * k * time + rng.uniform(0, 6.28))
         for k in (1, 2, 3, 4, 5, 6, 7, 9, 11, 12, 13)), np.zeros_like(time)
    )  # fmt: skip


def train(
    rng: np.random.Generator, turn: Floats, teeth: int, runout: float, steep: float, orders: int = 1500
) -> Floats:
    """A force that repeats with the spindle: pulses of teeth of unequal height; `turn` counts revolutions.

    Nothing in it is faster than 45 % of the sampling rate: recorders have a filter.
    """
    orders = min(orders, int(0.45 / np.diff(turn).max()) + 1)
    angle = np.linspace(0.0, 1.0, 4096, endpoint=False)
    pulse = np.zeros_like(angle)
    for j in range(teeth):
        height = 1.0 + runout * rng.normal()
        away = (angle - j / teeth) % 1.0
        pulse += max(height, 0.1) * np.where(away < steep / teeth, np.sin(np.pi * away * teeth / steep), 0.0)
    lines = np.fft.rfft(pulse)
    lines[min(orders, len(lines) - 1) :] = 0.0
    smooth = np.fft.irfft(lines, 4096)
    return np.interp(turn % 1.0, np.append(angle, 1.0), np.append(smooth, smooth[0]))
