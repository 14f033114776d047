"""Hammer tests with known modes: the exact response of modes to a half-sine pulse, sampled."""

import numpy as np


def ringing(force, rate_hz, modes, shapes):
    """Acceleration (m/s^2), shape (n, channels), of modes (frequency_hz, damping_ratio, mass) to a force (N).

    Exact for a force that is linear between the samples; `shapes` (modes, channels) are the mode shapes.
    """
    n = len(force)
    size = 2 * n
    spectrum = np.fft.rfft(force, size)
    out = np.zeros((n, np.shape(shapes)[1]))
    for (f, zeta, mass), shape in zip(modes, shapes, strict=True):
        t = np.arange(n) / rate_hz
        omega = 2 * np.pi * f
        damped = omega * np.sqrt(1 - zeta**2)
        pole = -zeta * omega + 1j * damped
        impulse = np.imag(pole**2 * np.exp(pole * t)) / (mass * damped) / rate_hz
        impulse[0] *= 0.5
        out += np.fft.irfft(np.fft.rfft(impulse, size) * spectrum, size)[:n, None] * np.asarray(shape)
        out += force[:, None] / mass * np.asarray(shape)
    return out


def pulse(n, rate_hz, at, height=500.0, width_s=2e-3):
    """A half-sine pulse (N), shape (n,), that begins at sample `at`."""
    t = (np.arange(n) - at) / rate_hz
    return np.where((t >= 0) & (t <= width_s), height * np.sin(np.pi * t / width_s), 0.0)
