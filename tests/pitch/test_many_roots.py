"""Many roots at once are those that are found one by one."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pitch import OneModeProcess, rightmost_root
from pitch.many_roots import growth_rates, numbers_of


@given(
    mass=st.floats(0.05, 1.0), hz=st.floats(250.0, 900.0), zeta=st.floats(0.005, 0.15), mu=st.floats(0.3, 1.0),
    ratio=st.floats(0.05, 1.5), rpm=st.floats(500.0, 3000.0), degrees=st.floats(-20.0, 20.0),
)  # fmt: skip
def test_the_strongest_root_is_found(mass, hz, zeta, mu, ratio, rpm, degrees):
    process = OneModeProcess(mass, hz, zeta, overlap=mu)
    K = ratio * mass * (2 * math.pi * hz) ** 2
    one = rightmost_root(process, K, rpm / 60.0, math.radians(degrees))
    many = complex(growth_rates(*numbers_of(process), K, rpm / 60.0, math.radians(degrees)))
    assert many.real == pytest.approx(one.real, abs=1e-6 * abs(one))


def test_axes_broadcast_and_pieces_do_not_matter():
    numbers = numbers_of(OneModeProcess(0.188, 421.0, 0.03, overlap=0.86))
    K, d = np.linspace(2e5, 1.5e6, 5)[:, None], np.radians(np.linspace(0.0, 10.0, 7))
    table = growth_rates(*numbers, K, 20.0, d)
    assert table.shape == (5, 7)
    for i, j in ((0, 0), (4, 6), (2, 3)):
        one = complex(growth_rates(*numbers, float(K[i, 0]), 20.0, float(d[j])))
        assert table[i, j] == pytest.approx(one, rel=1e-9)


def test_what_has_no_meaning_is_refused():
    numbers = numbers_of(OneModeProcess(0.188, 421.0, 0.03))
    with pytest.raises(ValueError, match="cutting_stiffness >= 0"):
        growth_rates(*numbers, -1.0, 20.0, 0.0)
    with pytest.raises(ValueError, match="spindle_hz must be > 0"):
        growth_rates(*numbers, 1e6, 0.0, 0.0)
    with pytest.raises(ValueError, match="pitch_difference in"):
        growth_rates(*numbers, 1e6, 20.0, 7.0)
