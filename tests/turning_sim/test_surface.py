import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from turning_sim.surface import generatrix, mean_roughness, profile


@given(st.floats(40e-6, 200e-6))
def test_roughness_of_a_perfect_cut(spacing):
    """Arcs evenly spaced: Rz = f^2/(8 r), Ra = f^2/(18 sqrt(3) r), for small feeds."""
    radius, z = 0.4e-3, np.arange(0.0, 8e-3, 1e-6)
    centres = np.arange(-2e-3, 10e-3, spacing)
    height = profile(centres, np.zeros(centres.size), radius, z)
    assert np.ptp(height) == pytest.approx(spacing**2 / (8.0 * radius), rel=0.05)
    # sampling lengths end anywhere in an arc
    assert mean_roughness(height, 1e-6) == pytest.approx(spacing**2 / (18.0 * math.sqrt(3.0) * radius), rel=0.06)


def test_the_deeper_tool_makes_the_surface():
    """A setting difference above f^2/(8 r) hides the other tool: the pattern has the full feed."""
    radius, z, feed = 0.4e-3, np.arange(1e-3, 7e-3, 1e-6), 0.15e-3
    one, two = np.arange(0.0, 8e-3, feed), np.arange(feed / 2.0, 8e-3, feed)
    depths = np.concatenate([np.zeros(one.size), np.full(two.size, 8e-6)])
    height = profile(np.concatenate([one, two]), depths, radius, z)
    assert height == pytest.approx(profile(two, np.full(two.size, 8e-6), radius, z), abs=1e-15)


@given(st.floats(0.0, 6.2))
def test_a_line_is_crossed_once_a_turn(angle):
    phase = np.linspace(-1.0, 40.0, 20001)
    position, depth = generatrix(phase, 1e-6 * np.sin(3.0 * phase), 1e-5 * phase, angle)
    assert np.diff(position) == pytest.approx(2.0 * np.pi * 1e-5, rel=1e-9)
    assert depth == pytest.approx(1e-6 * math.sin(3.0 * angle), abs=1e-11)
