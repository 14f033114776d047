"""The stiffness for a growth rate: the rightmost root comes out as asked, and zero growth is the critical stiffness."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import pitch

PROCESSES = st.builds(
    pitch.OneModeProcess,
    modal_mass=st.floats(0.05, 2.0),
    natural_frequency_hz=st.floats(250.0, 900.0),
    damping_ratio=st.floats(0.01, 0.15),
    overlap=st.floats(0.5, 1.0),
    process_damping=st.floats(0.0, 100.0),
)


@settings(max_examples=12)
@given(PROCESSES, st.floats(-30.0, 60.0), st.floats(15.0, 40.0), st.sampled_from([0.0, 0.05]))
def test_the_rightmost_root_has_the_growth_that_was_asked_for(process, growth, spindle_hz, difference):
    stiffness, frequency_hz = pitch.stiffness_for_growth(process, growth, spindle_hz, difference, 1e8)
    if stiffness.size == 0:
        return
    root = pitch.rightmost_root(process, stiffness[0], spindle_hz, difference)
    assert root.real == pytest.approx(growth, abs=1e-6)
    assert root.imag / (2 * math.pi) == pytest.approx(frequency_hz[0], rel=1e-9)


@given(PROCESSES, st.floats(10.0, 40.0))
def test_without_growth_it_is_the_critical_stiffness(process, spindle_hz):
    critical, critical_hz = pitch.critical_stiffness(process, spindle_hz, 0.0)
    stiffness, frequency_hz = pitch.stiffness_for_growth(process, 0.0, spindle_hz, 0.0, 1.01 * critical)
    assert stiffness[0] == pytest.approx(critical, rel=1e-9)
    assert frequency_hz[0] == pytest.approx(critical_hz, rel=1e-9)


@given(PROCESSES, st.floats(-20.0, 40.0), st.floats(10.0, 40.0))
def test_the_stiffnesses_rise_up_to_the_largest(process, growth, spindle_hz):
    stiffness, frequency_hz = pitch.stiffness_for_growth(process, growth, spindle_hz, 0.0, 5e6)
    assert stiffness.shape == frequency_hz.shape
    assert np.all(np.diff(stiffness) >= 0.0)
    assert np.all((stiffness > 0.0) & (stiffness <= 5e6))


def test_the_thesis_case_has_two_roots_of_nearly_the_same_stiffness():
    process = pitch.OneModeProcess(0.19, 421.0, 0.12, 0.859, 33.0)
    stiffness, frequency_hz = pitch.stiffness_for_growth(process, 30.0, 20.0, 0.0, 2e6)
    assert stiffness[1] / stiffness[0] - 1.0 < 0.03
    assert 35.0 < frequency_hz[1] - frequency_hz[0] < 41.0


def test_a_bad_argument_is_named():
    process = pitch.OneModeProcess(0.2, 420.0, 0.1)
    with pytest.raises(ValueError, match="largest must be > 0, got 0.0"):
        pitch.stiffness_for_growth(process, 0.0, 20.0, 0.0, 0.0)
    with pytest.raises(ValueError, match="growth must be finite, got nan"):
        pitch.stiffness_for_growth(process, math.nan, 20.0, 0.0, 1e6)
