"""Stable stretches of stiffness against the rightmost root, the smallest limit and closed forms."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings

from pitch import (
    Mode,
    OneModeProcess,
    StabilityUnresolved,
    TurningProcess,
    critical_stiffness,
    process_roots,
    rightmost_root,
    stable_intervals,
)
from tests.pitch import test_modes, test_stability

LIGHT = OneModeProcess(0.188, 421.0, 0.03)


def inside(intervals, stiffness):
    return any(low < stiffness < high for low, high in intervals)


def far_from_a_border(intervals, stiffness):
    return all(abs(stiffness / border - 1) > 1e-6 for pair in intervals for border in pair if border)


@settings(max_examples=15)
@given(test_stability.PROCESSES, test_stability.SPINDLES, test_stability.DIFFERENCES)
def test_the_sign_of_the_rightmost_root_over_a_dense_grid(process, spindle, difference):
    own = process.modal_mass * (2 * math.pi * process.natural_frequency_hz) ** 2
    intervals = stable_intervals(process, spindle, difference, 4 * own)
    assert intervals[0][1] == pytest.approx(min(critical_stiffness(process, spindle, difference)[0], 4 * own), rel=1e-9)
    assert intervals == sorted(intervals)
    for stiffness in np.geomspace(2e-3 * own, 3.9 * own, 24).tolist():
        if far_from_a_border(intervals, stiffness):
            growth = rightmost_root(process, stiffness, spindle, difference).real
            assert inside(intervals, stiffness) == (growth < 0.0)


@settings(max_examples=12)
@given(test_modes.PROCESSES, test_modes.SPINDLES, test_modes.DIFFERENCES)
def test_several_modes_and_a_turned_tool(process, spindle, difference):
    ratio = process.tangential_stiffness / process.cutting_stiffness
    intervals = stable_intervals(process, spindle, difference, 6e6)
    for stiffness in np.geomspace(3e4, 5.9e6, 12).tolist():
        cut = replace(process, cutting_stiffness=stiffness, tangential_stiffness=ratio * stiffness)
        if far_from_a_border(intervals, stiffness):
            growth = process_roots(cut, spindle, difference, count=1)[0].real
            assert inside(intervals, stiffness) == (growth < 0.0)


def test_an_island_above_the_smallest_limit():
    """At the pitch difference for 652 Hz a light bar is stable again around 0.9 MN/m: a bisection would not know."""
    difference = math.radians(5.52)
    (_, first), (start, end) = stable_intervals(LIGHT, 20.0, difference)
    assert first == pytest.approx(90073.41, rel=1e-7)
    for border in (first, start, end):
        assert abs(rightmost_root(LIGHT, border, 20.0, difference).real) < 1e-6
    signs = [rightmost_root(LIGHT, K, 20.0, difference).real < 0 for K in np.linspace(5e4, 2e6, 200)]
    borders = np.linspace(5e4, 2e6, 200)[1:][np.diff(signs)]
    assert borders == pytest.approx([first, start, end], abs=1e4)
    assert len(stable_intervals(LIGHT, 20.0, 0.0)) == 1


def test_two_modes_of_a_textbook_tool():
    """250 and 150 Hz at 30 and -45 deg from the thickness: 7.184977 mm at 1000 N/mm2 and 252.98 Hz, one tool."""
    modes = tuple(
        Mode(modal_mass=k / (2 * math.pi * hertz) ** 2, natural_frequency_hz=hertz, damping_ratio=zeta, direction=angle)
        for k, hertz, zeta, angle in ((2.26e8, 250.0, 0.012, math.pi / 6), (2.13e8, 150.0, 0.010, -math.pi / 4))
    )
    process = TurningProcess(modes=modes, cutting_stiffness=1e6, overlap=-1.0)
    s, receptance = 2j * math.pi * 252.980, 0.0
    for mode in modes:
        w = 2 * math.pi * mode.natural_frequency_hz
        bend = mode.modal_mass * (s**2 + 2 * mode.damping_ratio * w * s + w**2)
        receptance += math.cos(mode.direction) ** 2 / bend
    phase = 3 * math.pi + 2 * np.angle(receptance)
    for lobe in (1, 2, 5):
        turns_hz = 252.980 / (lobe + phase / (2 * math.pi))
        # two tools on one side are one tool of twice the width at twice the speed
        first = stable_intervals(process, turns_hz / 2, 0.0)[0][1]
        assert 2 * first / 1e9 == pytest.approx(7.184977e-3, rel=1e-5)


def test_without_regeneration_nothing_ends():
    assert stable_intervals(OneModeProcess(1.0, 100.0, 0.05, overlap=0.0), 20.0, 0.1, 5e6) == [(0.0, 5e6)]
    lone = Mode(modal_mass=0.3, natural_frequency_hz=333.0, damping_ratio=0.05, direction=math.pi / 2)
    assert stable_intervals(TurningProcess(modes=(lone,), cutting_stiffness=1.0), 20.0, 0.0, 5e6) == [(0.0, 5e6)]


def test_bad_arguments():
    with pytest.raises(ValueError, match="highest must be > 0, got 0.0"):
        stable_intervals(LIGHT, 20.0, 0.0, 0.0)
    with pytest.raises(ValueError, match="spindle_hz must be > 0, got -1.0"):
        stable_intervals(LIGHT, -1.0, 0.0)
    with pytest.raises(ValueError, match="cutting_stiffness must be > 0, got 0.0"):
        stable_intervals(TurningProcess(modes=test_modes.plane_bar(0.0).modes, cutting_stiffness=0.0), 20.0, 0.0)
    with pytest.raises(StabilityUnresolved, match="samples are needed"):
        stable_intervals(LIGHT, 1e-3, 0.0)
