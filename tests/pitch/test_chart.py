"""The chart beside roots, beside counting on the imaginary axis, and beside textbook limits."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pitch import OneModeProcess, critical_stiffness, rightmost_root
from pitch.chart import stability_chart

BAR = OneModeProcess(0.188, 421.0, 0.03)
ONE = OneModeProcess(3.01333e8 / (2 * math.pi * 250.0) ** 2, 250.0, 0.012, overlap=1.0)
SAME_SIDE = OneModeProcess(ONE.modal_mass, 250.0, 0.012, overlap=-1.0)
ANGLES = (180, 175, 170, 165, 160, 150, 140, 120)


def encirclements(process, K, spindle_hz, difference):
    """Unstable pairs by the argument principle: turns of D(i w), two dimensions, no crossing ever looked for."""
    m, w_n = process.modal_mass, 2 * np.pi * process.natural_frequency_hz
    c, k = 2 * process.damping_ratio * m * w_n + 2 * process.process_damping, m * w_n**2
    T, h = 0.5 / spindle_hz, 0.5 * difference / (2 * np.pi * spindle_hz)
    top = 40.0 * math.sqrt((k + 4 * K) / m)
    w = np.concatenate([np.linspace(0.0, top / 20, 40_001), np.geomspace(top / 20, top, 4000)[1:]])
    D = k - m * w**2 + 1j * c * w + 2 * K * (1 + process.overlap * np.exp(-1j * w * T) * np.cos(w * h))
    turned = np.unwrap(np.angle(D))
    return round((np.pi - (turned[-1] - turned[0])) / (2 * np.pi))


def test_every_kind_of_cell_is_as_counted():
    stiffness = np.geomspace(3e4, 3e6, 12)
    for speed, differences in ((20.0, np.radians([0.0, 2.0, 5.52, 9.0, 16.0])), (33.3, np.radians([0.0, 7.0]))):
        chart = stability_chart(BAR, speed, differences, stiffness)
        counted = [[encirclements(BAR, K, speed, d) for d in differences] for K in stiffness]
        np.testing.assert_array_equal(chart.unstable, counted)


@given(
    speed=st.floats(5.0, 60.0), degrees=st.floats(-40.0, 40.0),
    overlap=st.floats(-1.0, 1.0).filter(lambda m: abs(m) > 1e-3),
    damping=st.floats(0.003, 0.2), K=st.floats(1e4, 3e6), cp=st.sampled_from([0.0, 33.0]),
)  # fmt: skip
def test_any_cell_is_as_its_rightmost_root(speed, degrees, overlap, damping, K, cp):
    process = OneModeProcess(0.2, 430.0, damping, overlap=overlap, process_damping=cp)
    difference = math.radians(degrees)
    chart = stability_chart(process, speed, difference, [K])
    root = rightmost_root(process, K, speed, difference)
    assert abs(root.real) < 1e-6 * abs(root) or bool(chart.stable[0, 0]) == (root.real < 0.0)


@given(speed=st.floats(5.0, 60.0), degrees=st.floats(-20.0, 20.0), overlap=st.floats(0.2, 1.0))
def test_lowest_border_is_the_critical_stiffness(speed, degrees, overlap):
    process = OneModeProcess(0.2, 430.0, 0.03, overlap=overlap)
    K, hz = critical_stiffness(process, speed, math.radians(degrees))
    chart = stability_chart(process, speed, math.radians(degrees), [1.01 * K])
    assert chart.limit[0] == pytest.approx(K, rel=1e-9)
    assert chart.limit_hz[0] == pytest.approx(hz, rel=1e-9)


@pytest.mark.parametrize(
    ("speed_rpm", "limits"),
    [
        (1000, (11.848, 29.749, 4.749, 6.291, 13.423, 12.937, 20.234, 4.556)),
        (2000, (12.810, 14.938, 81.468, 10.570, 4.297, 5.884, 14.405, 34.282)),
        (3000, (34.740, 37.403, 47.666, 117.459, 16.646, 7.031, 7.218, 34.756)),
        (4000, (14.460, 15.046, 17.086, 22.043, 104.947, 64.252, 6.443, 9.518)),
    ],
)
def test_opposed_tools_have_the_limits_of_the_table(speed_rpm, limits):
    differences = 2.0 * np.radians(np.array(ANGLES) - 180.0)
    chart = stability_chart(ONE, speed_rpm / 60.0, differences, [2e11])
    np.testing.assert_allclose(chart.limit / 1e6, limits, rtol=2e-4)


@pytest.mark.parametrize(
    ("speed_rpm", "limits"),
    [
        (1000, (4.332, 101.70, 12.217, 17.267, 6.471, 15.823, 24.959, 21.201)),
        (2000, (3.745, 4.846, 102.87, 17.936, 13.186, 19.826, 6.960, 16.752)),
        (3000, (6.556, 7.118, 9.486, 27.917, 46.727, 34.744, 48.745, 8.755)),
        (4000, (5.439, 5.827, 7.396, 15.032, 86.355, 20.311, 14.833, 25.097)),
    ],
)
def test_tools_on_one_side_have_the_limits_of_the_table(speed_rpm, limits):
    differences = 2.0 * np.radians(np.array(ANGLES) - 180.0)
    chart = stability_chart(SAME_SIDE, speed_rpm / 60.0, differences, [2e11])
    np.testing.assert_allclose(chart.limit / 1e6, limits, rtol=2e-3)  # as exact as the table is


def one_tool(rpm):
    """Least depth (mm) of one tool and its frequency (Hz) by the closed form: -1/(2 Kf Re G) on every lobe."""
    hz = np.linspace(250.0 + 1e-6, 420.0, 400_001)
    r = hz / 250.0
    G = 1.0 / (3.01333e8 * (1.0 - r**2 + 2j * 0.012 * r))
    turns = 1.5 + np.angle(G) / np.pi  # of the wave between two passes, less whole ones
    excess = hz * 60.0 / rpm - turns
    j = np.floor(excess)
    at = np.flatnonzero((np.diff(j) == 1.0) & (G.real[:-1] < 0.0))
    part = (j[at + 1] - excess[at]) / (excess[at + 1] - excess[at])
    depth = np.array([np.interp(part[n], [0, 1], -1e-6 / (2.0 * G.real[[i, i + 1]])) for n, i in enumerate(at)])
    return depth.min(), hz[at[depth.argmin()]]


@pytest.mark.parametrize("rpm", [2000, 3000, 4000, 5000, 6000, 7500, 9000, 10000, 12000, 14000])
def test_equal_pitch_on_one_side_is_one_tool_of_twice_the_width_at_twice_the_speed(rpm):
    depth, hz = one_tool(rpm)
    chart = stability_chart(SAME_SIDE, rpm / 120.0, 0.0, [2e11])
    assert 2.0 * chart.limit[0] / 1e6 == pytest.approx(depth, rel=1e-6)
    assert chart.limit_hz[0] == pytest.approx(hz, abs=1e-3)


def test_lobes_touch_the_closed_form():
    least = 2.0 * 3.01333e8 * 0.012 * 1.012
    minima = np.array([20187.46, 8664.27, 5515.80, 4045.66, 3194.29]) / 120.0
    chart = stability_chart(SAME_SIDE, minima, 0.0, [1e10])
    np.testing.assert_allclose(2.0 * chart.limit, least, rtol=1e-5)


def test_islands_lie_above_unstable_cells():
    chart = stability_chart(BAR, 20.0, np.radians(np.linspace(0.0, 12.0, 60)), np.linspace(2e4, 2e6, 80))
    assert chart.islands.any()
    row, column = np.argwhere(chart.islands)[0]
    assert chart.unstable[:row, column].any()
    assert rightmost_root(BAR, chart.stiffness[row], 20.0, math.radians(12.0 * column / 59)).real < 0.0


def test_without_regeneration_everything_is_stable():
    chart = stability_chart(OneModeProcess(0.2, 430.0, 0.03, overlap=0.0), 20.0, 0.0, [1e5, 1e8])
    assert chart.stable.all()
    assert np.isinf(chart.limit[0])
    assert np.isnan(chart.limit_hz[0])


@pytest.mark.parametrize(
    ("speed", "difference", "rows", "message"),
    [
        (0.0, 0.0, [1e5], "spindle_hz must be positive"),
        ([20.0, np.nan], 0.0, [1e5], "spindle_hz must be positive"),
        (20.0, 7.0, [1e5], "pitch_difference must be in"),
        (20.0, 0.0, [2e5, 1e5], "stiffness must be positive and rising"),
        (20.0, 0.0, [], "stiffness must be positive and rising"),
        (20.0, 0.0, [-1.0], "stiffness must be positive and rising"),
    ],
)
def test_wrong_axes_are_refused(speed, difference, rows, message):
    with pytest.raises(ValueError, match=message):
        stability_chart(BAR, speed, difference, rows)
