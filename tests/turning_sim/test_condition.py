"""Depth and feed against stiffness and overlap: quadrature on the nose against the map of the surface."""

import dataclasses

import pytest

from services.config import load_case
from turning_sim import chip_derivatives, condition_change, cut_derivatives

CASE = load_case("thesis-652")


@pytest.mark.parametrize(
    ("depth_mm", "feed_mm"), [(0.05, 0.15), (0.2, 0.15), (0.35, 0.15), (0.2, 0.05), (0.2, 0.25)]
)
def test_it_is_what_the_map_says(depth_mm, feed_mm):
    cut = dataclasses.replace(CASE.cutting, depth_of_cut=1e-3 * depth_mm, feed_per_rev=1e-3 * feed_mm)
    mapped = cut_derivatives(cut, CASE.process)
    stiffness, overlap = chip_derivatives(cut)
    assert stiffness == pytest.approx(mapped.stiffness, rel=5e-4)
    assert overlap == pytest.approx(mapped.overlap, rel=1e-3)


def test_the_same_cut_changes_nothing_and_a_thicker_chip_is_softer():
    assert condition_change(CASE.cutting) == pytest.approx((1.0, 1.0, 1.0), rel=1e-6)
    assert condition_change(CASE.cutting, feed_per_rev=0.25e-3).stiffness < 1.0
    assert condition_change(CASE.cutting, depth_of_cut=0.3e-3).damping > 1.0


def test_beyond_the_nose_it_does_not_know():
    with pytest.raises(ValueError, match="below the height of the nose"):
        condition_change(CASE.cutting, depth_of_cut=0.5e-3)
