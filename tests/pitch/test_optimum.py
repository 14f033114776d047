"""Optimum pitch difference: phase and difference undo each other, and the published value comes out."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

import pitch

FREQUENCIES = st.floats(50.0, 5000.0)
SPINDLES = st.floats(1.0, 200.0)


@given(FREQUENCIES, SPINDLES, st.integers(0, 20))
def test_the_optimum_is_an_odd_multiple_of_pi(frequency, spindle, order):
    difference = pitch.optimal_pitch_difference(frequency, spindle, order)
    phase = pitch.regenerative_phase(frequency, spindle, difference)
    assert phase == pytest.approx((2 * order + 1) * math.pi, rel=1e-14)


@given(FREQUENCIES, SPINDLES, st.floats(-20.0, 20.0))
def test_any_phase_comes_back(frequency, spindle, phase):
    difference = pitch.pitch_difference_for_phase(frequency, spindle, phase)
    assert pitch.regenerative_phase(frequency, spindle, difference) == pytest.approx(phase, rel=1e-14)


@given(FREQUENCIES, SPINDLES)
def test_it_is_the_difference_of_the_delays(frequency, spindle):
    shift = pitch.optimal_pitch_difference(frequency, spindle) / 2
    to_tool_1, to_tool_2 = (math.pi + shift) / (2 * math.pi * spindle), (math.pi - shift) / (2 * math.pi * spindle)
    assert frequency * (to_tool_1 - to_tool_2) == pytest.approx(0.5, rel=1e-9)


@pytest.mark.parametrize(
    ("frequency", "phase_pi", "degrees"),
    [(652, 1.0, 2.760736), (652, 0.8, 2.208589), (652, 3.0, 8.282209), (738, 1.0, 2.439024)],
)
def test_published_shifts(frequency, phase_pi, degrees):
    """Yamada, PhD thesis, Keio University, 2017, section 6.5 (8.28 deg is printed there as 8.2)."""
    shift = pitch.pitch_difference_for_phase(frequency, 20.0, phase_pi * math.pi) / 2
    assert math.degrees(shift) == pytest.approx(degrees, rel=1e-6)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: pitch.optimal_pitch_difference(-5, 20), "chatter_frequency_hz must be > 0, got -5.0"),
        (lambda: pitch.optimal_pitch_difference(652, 0), "spindle_hz must be > 0, got 0.0"),
        (lambda: pitch.optimal_pitch_difference(math.nan, 20), "chatter_frequency_hz must be finite, got nan"),
        (lambda: pitch.optimal_pitch_difference(652, 20, 0.5), "order must be a whole number >= 0, got 0.5"),
        (lambda: pitch.optimal_pitch_difference(652, 20, -1), "order must be a whole number >= 0, got -1"),
        (lambda: pitch.regenerative_phase(652, 20, math.inf), "pitch_difference must be finite, got inf"),
        (lambda: pitch.pitch_difference_for_phase(652, 20, None), "phase must be a number, got None"),
    ],
)
def test_bad_arguments_name_value_and_rule(call, message):
    with pytest.raises(ValueError, match=message):
        call()
