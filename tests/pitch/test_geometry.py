"""Turret geometry: the inverse undoes it, the depth of cut stays, and the published rows come out."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pitch import TurretOffset, arc_position, offset_from_slides, slide_set_points, turret_offset

SHIFTS = st.floats(-1.5, 1.5)
DIAMETERS = st.floats(1e-3, 1.0)
AXIS_ANGLES = st.floats(0.2, math.pi - 0.2)


@given(SHIFTS, DIAMETERS, AXIS_ANGLES)
def test_slides_lead_back_to_the_shift(shift, diameter, axis_angle):
    x1, y1 = turret_offset(shift, diameter).slides(axis_angle)
    found = arc_position(offset_from_slides(x1, y1, axis_angle), diameter)
    assert found.shift == pytest.approx(shift, abs=1e-13)
    assert abs(found.radial_deviation) < 1e-14 * diameter


@given(SHIFTS, DIAMETERS)
def test_the_tip_stays_on_the_bar(shift, diameter):
    offset = turret_offset(shift, diameter)
    tip = np.array([-diameter / 2 + offset.dx1, offset.dy1p])
    assert np.hypot(*tip) == pytest.approx(diameter / 2, rel=1e-14)


@given(SHIFTS, DIAMETERS)
def test_mirror(shift, diameter):
    there, back = turret_offset(shift, diameter), turret_offset(-shift, diameter)
    assert (there.dx1, there.dy1p) == (back.dx1, -back.dy1p)


@given(st.floats(-1e-4, 1e-4), SHIFTS, DIAMETERS)
def test_a_tool_off_the_arc_is_seen_with_its_sign(deviation, shift, diameter):
    radius = diameter / 2 * (1 + deviation)
    offset = TurretOffset(diameter / 2 - radius * math.cos(shift), radius * math.sin(shift))
    found = arc_position(offset, diameter)
    assert found.radial_deviation == pytest.approx(deviation * diameter / 2, abs=1e-15 * diameter)


@given(AXIS_ANGLES)
def test_slides_add_up_as_vectors(axis_angle):
    x1, y1 = TurretOffset(2e-5, 5e-4).slides(axis_angle)
    moved = x1 * np.array([1.0, 0.0]) + y1 * np.array([math.cos(axis_angle), math.sin(axis_angle)])
    np.testing.assert_allclose(moved, [2e-5, 5e-4], rtol=1e-12, atol=1e-17)


def test_arrays_like_scalars():
    shifts = np.linspace(-0.1, 0.1, 7)
    x1, y1 = slide_set_points(shifts, 0.025)
    assert [slide_set_points(h, 0.025) for h in shifts] == list(zip(x1.tolist(), y1.tolist(), strict=True))
    assert all(type(value) is float for value in slide_set_points(0.05, 0.025))


@pytest.mark.parametrize(
    ("diameter", "degrees", "dx1", "dy1p", "x1", "y1", "digits"),
    [
        (24.5, 2.21, 9.1, 472.4, -463.3, 668.1, 1),
        (23.4, 1.38, 3.4, 281.8, -278.4, 398.5, 1),
        (24.5, 2.208589, 9.100, 472.086, -462.986, 667.630, 3),
        (22.1, 2.439024, 10.0, 470.2, -460.2, 665.0, 1),
    ],
)
def test_worked_rows(diameter, degrees, dx1, dy1p, x1, y1, digits):
    offset = turret_offset(math.radians(degrees), diameter * 1e-3)
    got = [value * 1e6 for value in (offset.dx1, offset.dy1p, *offset.slides())]
    assert got == pytest.approx([dx1, dy1p, x1, y1], abs=0.52 * 10**-digits)


@pytest.mark.parametrize(
    ("degrees", "diameter", "dx1", "dy1p"),
    [
        (1.38, 23.4, 3.4, 281.8),
        (1.66, 23.7, 5.0, 343.3),
        (1.94, 24.1, 6.9, 407.9),
        (2.21, 24.5, 9.1, 472.4),
        (2.49, 24.5, 11.6, 532.2),
        (3.05, 22.9, 16.2, 609.2),
        (3.19, 22.5, 17.4, 626.0),
        (3.32, 24.9, 20.9, 721.0),
    ],
)
def test_published_table(degrees, diameter, dx1, dy1p):
    """Yamada, PhD thesis, Keio University, 2017, Table 6-4, to the last printed digit."""
    offset = turret_offset(math.radians(degrees), diameter * 1e-3)
    assert (round(offset.dx1 * 1e6, 1), round(offset.dy1p * 1e6, 1)) == (dx1, dy1p)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: turret_offset(0.1, 0.0), "diameter must be > 0, got 0.0"),
        (lambda: turret_offset(0.1, math.nan), "diameter must be finite, got nan"),
        (lambda: turret_offset(2.0, 0.025), "shift must be in"),
        (lambda: turret_offset([0.1, math.inf], 0.025), "shift must be finite"),
        (lambda: turret_offset("wide", 0.025), "shift must be numbers, got 'wide'"),
        (lambda: turret_offset(0.1, None), "diameter must be a number, got None"),
        (lambda: TurretOffset(0.0, 0.0).slides(0.0), "axis_angle must be in"),
        (lambda: offset_from_slides(math.nan, 0.0), "x1 must be finite"),
    ],
)
def test_bad_arguments_name_value_and_rule(call, message):
    with pytest.raises(ValueError, match=message):
        call()
