"""What a shift leaves on the part, against geometry done another way."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pitch import Box, clearance, cusp_height, off_arc, side_effects, slide_set_points, turret_offset, wrong_arc

SHIFTS = st.floats(-0.08, 0.08)


@given(SHIFTS)
def test_both_tools_share_the_feed(shift):
    found = side_effects(shift, 25e-3, 0.15e-3, 0.4e-3)
    assert sum(found.mark_widths) == pytest.approx(0.15e-3)
    assert found.mark_widths[0] - found.mark_widths[1] == pytest.approx(0.15e-3 * shift / math.pi, abs=1e-18)
    assert found.extra_height >= -1e-18
    assert found.step == pytest.approx(0.0, abs=1e-18)
    mirrored = side_effects(-shift, 25e-3, 0.15e-3, 0.4e-3)
    assert mirrored.mark_widths == pytest.approx(found.mark_widths[::-1])


def test_without_a_shift_nothing_is_left():
    may_err = {"diameter_error": 4e-4, "path_error": 1e-5, "thrust": 90.0, "bar_stiffness": 1e6}
    found = side_effects(0.0, 25e-3, 0.15e-3, 0.4e-3, **may_err)
    assert (found.step, found.diameter_error, found.extra_height, found.rake_change) == (0.0, 0.0, 0.0, 0.0)


@given(st.floats(1e-6, 3e-4))
def test_the_cusp_is_where_two_circles_meet(width):
    r, z = 0.4e-3, width / 2
    assert cusp_height(width, r) == pytest.approx(r - math.sqrt(r * r - z * z), rel=1e-6, abs=1e-15)


@given(SHIFTS, st.floats(0.02, 0.03))
def test_the_arc_of_another_bar_leaves_a_step(shift, believed):
    """The distance of the tip from the axis of the spindle, by Pythagoras."""
    offset = turret_offset(shift, believed)
    distance = math.hypot(0.0125 - offset.dx1, offset.dy1p)
    assert wrong_arc(shift, believed, 0.025) == pytest.approx(distance - 0.0125, abs=1e-14)
    assert off_arc(offset.dx1, offset.dy1p, 0.025) == wrong_arc(shift, believed, 0.025)
    first_order = 0.5 * (believed - 0.025) * (math.cos(shift) - 1)
    assert wrong_arc(shift, believed, 0.025) == pytest.approx(-first_order, rel=0.6, abs=1e-9)


def test_the_bar_bends_by_the_difference_of_the_thrusts():
    """Chips that differ by 2 h/pi, and the component that the turned tool lacks."""
    h, force, stiffness = 0.05, 100.0, 1.5e6
    found = side_effects(h, 25e-3, 0.15e-3, 0.4e-3, thrust=force, bar_stiffness=stiffness)
    net = force * (1 + h / math.pi) * math.cos(h) - force * (1 - h / math.pi)
    assert found.step == pytest.approx(abs(net) / stiffness)
    assert found.diameter_error == pytest.approx(2 * found.step)


@given(SHIFTS)
def test_the_clearance_is_that_of_the_nearest_corners(shift):
    moving, fixed = Box(-0.1, -0.0125, -0.02, 0.0), Box(-0.01, 0.1, 0.0005, 0.02)
    way = [slide_set_points(shift * part, 0.025, math.pi / 2) for part in np.linspace(0, 1, 65)]
    gaps = [math.hypot(max(-0.01 + 0.0125 - x, 0.0), max(0.0005 - y, 0.0)) for x, y in way]
    assert clearance(shift, 0.025, moving, fixed) == pytest.approx(min(gaps))
    assert clearance(shift, 0.025, moving, Box(-0.05, 0.1, -0.02, 0.02)) == 0.0


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"shift": 1.0}, "shift must be in"),
        ({"diameter": 0.0}, "diameter must be > 0"),
        ({"feed_per_rev": math.nan}, "feed_per_rev must be finite"),
        ({"nose_radius": 1e-5}, "width must be in"),
        ({"diameter_error": 0.03}, "diameter_error must be below"),
    ],
)
def test_what_makes_no_sense_is_refused(change, said):
    known = {"shift": 0.05, "diameter": 0.025, "feed_per_rev": 1.5e-4, "nose_radius": 4e-4} | change
    with pytest.raises(ValueError, match=said):
        side_effects(**known)
