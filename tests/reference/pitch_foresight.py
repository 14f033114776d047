"""Strongest root of the bar by Newton's method from a dense comb of starts, in plain NumPy."""

import numpy as np


def strongest(m, c, k, mu, cut, spindle_hz, shift):
    """Growth (1/s) and angular frequency (rad/s) of the rightmost root not below 0.97 of the natural frequency."""
    omega = 2 * np.pi * spindle_hz
    one, two = (np.pi + shift) / omega, (np.pi - shift) / omega
    low, high = 0.97 * np.sqrt(k / m), 1.2 * np.sqrt((k + 2 * cut * (1 + mu)) / m)
    along, across = np.meshgrid(np.arange(low, high, omega / 5), omega * np.array([-0.3, -0.1, 0.0, 0.2]))
    s = (across + 1j * along).ravel()
    for _ in range(40):
        waves = cut * mu * np.exp(-s * one), cut * mu * np.exp(-s * two)
        value = m * s**2 + c * s + k + 2 * cut + waves[0] + waves[1]
        slope = 2 * m * s + c - one * waves[0] - two * waves[1]
        step = value / slope
        s = s - step * np.minimum(1.0, 0.2 * omega / np.maximum(np.abs(step), 1e-300))
        s = np.maximum(s.real, -3 * omega) + 1j * s.imag
    good = s[(np.abs(step) < 1e-7 * np.abs(s)) & (s.imag > low)]
    best = good[np.argmax(good.real)]
    return best.real, best.imag
