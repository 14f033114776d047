import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from turning_sim import ForceLaw, steady_chip


@pytest.mark.parametrize(
    ("radius", "depth", "edge"), [(0.4e-3, 0.2e-3, 0.456e-3), (0.2e-3, 0.2e-3, 0.352e-3), (0.2e-3, 0.3e-3, 0.452e-3)]
)
def test_edge_lengths_of_the_model(radius, depth, edge):
    assert steady_chip(depth, 75e-6, radius).edge_length == pytest.approx(edge, abs=1e-6)


@given(st.floats(0.05e-3, 0.35e-3), st.floats(20e-6, 0.13e-3))
def test_area_is_what_lies_between_two_profiles(depth, feed):
    """Independent quadrature: tool profile against the same profile one feed earlier, up to the depth."""
    radius = 0.4e-3
    x = np.linspace(-1.5 * radius, 1.5 * radius, 20001)

    def height(centre):
        away = np.abs(x - centre)
        inside = np.minimum(away, radius)
        return np.where(away < radius, radius - np.sqrt(radius**2 - inside**2), depth)

    # left of the earlier centre the earlier pass has removed everything above its arc
    before = np.minimum(np.where(x > -feed, height(-feed), height(-feed)), depth)
    before = np.where(x < -feed, np.minimum(before, 0.0), before)
    now = np.minimum(height(0.0), depth)
    area = np.trapezoid(np.maximum(before - now, 0.0), x)
    assert steady_chip(depth, feed, radius).area == pytest.approx(area, rel=2e-3)


def test_steady_forces_follow_the_law():
    chip = steady_chip(0.2e-3, 75e-6, 0.4e-3)
    radial, tangential = ForceLaw().forces(chip)
    assert chip.mean_thickness == pytest.approx(33e-6, rel=0.02)
    assert radial == pytest.approx(3.19e9 * chip.area * math.cos(chip.thrust_direction), rel=0.01)
    assert tangential == pytest.approx(3.8e9 * chip.area, rel=0.01)


def test_feed_wider_than_the_nose_is_refused():
    with pytest.raises(ValueError, match="feed_per_tool must be in"):
        steady_chip(0.2e-3, 1e-3, 0.4e-3)
