"""Independent look at the one-mode process: counts roots by the argument principle, steps the equation in time."""

import numpy as np


def characteristic(s, mass, natural_hz, zeta, overlap, flank, stiffness, spindle_hz, pitch_difference):
    """D(s), written with its two delays rather than with cosh."""
    w = 2 * np.pi * natural_hz
    turn = 1 / spindle_hz
    delays = [(0.5 + sign * pitch_difference / (4 * np.pi)) * turn for sign in (1, -1)]
    met_again = sum(1 + overlap * np.exp(-s * delay) for delay in delays)
    return mass * (s**2 + 2 * zeta * w * s + w**2) + 2 * flank * s + stiffness * met_again


def count_roots(function, left, right, top):
    """Roots in the rectangle left..right, -top..top: turns of the function round its border."""
    corners = [left - 1j * top, right - 1j * top, right + 1j * top, left + 1j * top, left - 1j * top]
    total = 0.0
    for start, end in zip(corners, corners[1:], strict=False):
        points = np.linspace(0.0, 1.0, 2001)
        while True:
            values = function(start + (end - start) * points)
            turns = np.angle(values[1:] / values[:-1])
            rough = np.abs(turns) > 0.5
            if not rough.any():
                break
            if len(points) > 1_000_000:
                raise AssertionError("a root lies on the border of the rectangle")
            points = np.sort(np.concatenate((points, (points[1:] + points[:-1])[rough] / 2)))
        total += turns.sum()
    return round(total / (2 * np.pi))
