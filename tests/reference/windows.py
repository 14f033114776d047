"""Plain definitions of what the streaming classes compute, in exact phases and exact sums."""

from fractions import Fraction
from math import fsum

import numpy as np


def window_at(stream, stop, window):
    """Last ``window`` rows of stream[:stop], zeros before its start."""
    stream = np.asarray(stream, dtype=float)
    tail = stream[max(0, stop - window) : stop]
    return np.concatenate([np.zeros((window - len(tail), *stream.shape[1:])), tail])


def cycles(frequency_hz, sample_rate_hz, samples):
    """Frequency times index over rate, modulo one, from integers: one rounding."""
    ratio = Fraction(frequency_hz) / Fraction(sample_rate_hz)
    p, q = ratio.numerator, ratio.denominator
    return np.array([p * i % q / q for i in range(samples)])


class ExactDFT:
    """Sum of y[i] exp(-2j pi f_k i / f_s) over a window of one channel, as by hand."""

    def __init__(self, frequencies_hz, window, sample_rate_hz):
        self.cosine, self.sine = [], []
        for frequency_hz in frequencies_hz:
            angle = 2 * np.pi * cycles(float(frequency_hz), float(sample_rate_hz), window).astype(np.longdouble)
            self.cosine.append(np.cos(angle).astype(float))
            self.sine.append(np.sin(angle).astype(float))

    def __call__(self, samples):
        rows = zip(self.cosine, self.sine, strict=True)
        return np.array([complex(fsum(samples * c), -fsum(samples * s)) for c, s in rows])


def spectra(stream, stops, frequencies_hz, window, sample_rate_hz, hann=False):
    """Spectra of the windows that end before each of ``stops``, (stops, channels, bins), by products of long floats."""
    phases = [cycles(float(f), float(sample_rate_hz), window).astype(np.longdouble) for f in frequencies_hz]
    angle = 2 * np.longdouble(np.pi) * np.array(phases)
    weight = np.ones(window, dtype=np.longdouble)
    if hann:
        weight = 0.5 - 0.5 * np.cos(2 * np.longdouble(np.pi) * np.arange(window) / window)
    windows = [window_at(stream, stop, window).T for stop in stops]
    samples = np.array(windows, dtype=np.longdouble).reshape(-1, np.shape(stream)[1], window) * weight
    return (samples @ np.cos(angle).T).astype(float) - 1j * (samples @ np.sin(angle).T).astype(float)


def moving_variance(stream, window):
    """Population variance of the last ``window`` samples (of those seen) after each sample, two passes each."""
    stream = np.asarray(stream, dtype=float)
    out = np.empty(len(stream))
    for i in range(len(stream)):
        tail = stream[max(0, i + 1 - window) : i + 1]
        tail = tail - tail[-1]
        mean = fsum(tail) / len(tail)
        out[i] = fsum((tail - mean) ** 2) / len(tail)
    return out
