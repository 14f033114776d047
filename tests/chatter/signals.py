"""Signals of the monitor's tests, made from the physics that they stand for and from nothing in the package."""

import numpy as np

RATE = 9000.0


def noise(rng, seconds, rms, low_hz=500.0, high_hz=750.0, rate=RATE, channels=2):
    """White noise with a given root mean square between two frequencies, shape (n, channels)."""
    share = (high_hz - low_hz) / (0.5 * rate)
    return rng.normal(size=(round(seconds * rate), channels)) * rms / np.sqrt(share)


def growing(seconds, start, frequency_hz, growth, first, last, rate=RATE, phase=0.3):
    """A line that grows exponentially from an amplitude and saturates, shape (n,)."""
    time = np.arange(round(seconds * rate)) / rate
    since = np.clip(time - start, 0.0, None)
    size = np.where(time >= start, np.minimum(first * np.exp(np.minimum(growth * since, 100.0)), last), 0.0)
    return size * np.sin(2.0 * np.pi * frequency_hz * time + phase)


def resonance(rng, seconds, frequency_hz, damping, rms, rate=RATE, channels=2):
    """Noise shaped by one damped mode: a quiet cut, shape (n, channels)."""
    count = round(seconds * rate)
    frequencies = np.fft.rfftfreq(count, 1.0 / rate)
    ratio = frequencies / frequency_hz
    gain = 1.0 / (1.0 - ratio**2 + 2j * damping * ratio)
    shaped = np.fft.irfft(np.fft.rfft(rng.normal(size=(count, channels)), axis=0) * gain[:, None], count, axis=0)
    return shaped * rms / shaped.std()


def steps(monitor, signal, *, in_cut=lambda _: None, spindle_hz=None, moving=lambda _: False):
    """Estimates of a signal fed block by block."""
    out = []
    for k in range(0, len(signal), monitor.block):
        now = k / monitor.sample_rate_hz
        block = signal[k : k + monitor.block]
        out += monitor.process(block, k, in_cut=in_cut(now), spindle_hz=spindle_hz, moving=moving(now))
    return out


def end(estimate, rate=RATE):
    """Time of the end of a block (s)."""
    return (estimate.first_sample + estimate.samples) / rate
