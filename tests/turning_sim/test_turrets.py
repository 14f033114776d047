import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from turning_sim import loads_of_force, shift_of_tool, slides_of_shift, tool_of_slides

ANGLE = math.pi / 4.0
SHIFTS = st.floats(math.radians(-20.0), math.radians(20.0))


@pytest.mark.parametrize(
    ("diameter", "degrees", "tool", "slides", "digit"),
    [
        (24.5e-3, 2.21, (9.1, 472.4), (-463.3, 668.1), 0.05),
        (23.4e-3, 1.38, (3.4, 281.8), (-278.4, 398.5), 0.06),
        (24.5e-3, 2.208589, (9.100, 472.086), (-462.986, 667.630), 6e-4),
        (22.1e-3, 2.439024, (10.0, 470.2), (-460.2, 665.0), 0.06),
    ],
)
def test_worked_rows(diameter, degrees, tool, slides, digit):
    """Table 6-4 of the thesis and the digits of the model."""
    x1, y1 = slides_of_shift(math.radians(degrees), diameter, ANGLE)
    assert np.array([x1, y1]) * 1e6 == pytest.approx(np.array(slides), abs=digit)
    assert np.array(tool_of_slides(x1, y1, ANGLE)) * 1e6 == pytest.approx(np.array(tool), abs=digit)


@given(SHIFTS, st.floats(0.5, math.pi / 2.0))
def test_shift_to_slides_and_back(shift, angle):
    x1, y1 = slides_of_shift(shift, 25e-3, angle)
    assert shift_of_tool(*tool_of_slides(x1, y1, angle), 25e-3) == pytest.approx(shift, abs=1e-12)


@given(SHIFTS)
def test_the_depth_of_cut_stays(shift):
    dx1, dy1p = tool_of_slides(*slides_of_shift(shift, 25e-3, ANGLE), ANGLE)
    assert math.hypot(12.5e-3 - dx1, dy1p) == pytest.approx(12.5e-3, rel=1e-14)


@given(st.floats(-100, 100), st.floats(-100, 100), st.floats(-1, 1), st.floats(-1, 1), st.floats(0.5, 1.5))
def test_slides_and_tool_see_the_same_power(force_x, force_y, x_speed, y_speed, angle):
    """F_x pushes against +X1 and F_y' along +Y1'; the loads oppose the slides."""
    load_x, load_y = loads_of_force(force_x, force_y, angle)
    tool_x, tool_y = tool_of_slides(x_speed, y_speed, angle)
    assert -(load_x * x_speed + load_y * y_speed) == pytest.approx(-force_x * tool_x + force_y * tool_y, abs=1e-9)
