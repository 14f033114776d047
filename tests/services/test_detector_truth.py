"""What the detector is measured against, on signals whose answers are known."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.bench.detector.tally import quantile, rate_bound, share_within
from services.bench.detector.trial import alarms_in
from services.bench.detector.truth import least_time, onset_sample, true_lines
from tests.services.detector_kit import ENTRY_S, RATE_HZ, growing, process, stream

BAND_HZ = (489.0, 815.0)


@given(st.floats(10.0, 60.0), st.floats(1.2, 2.2))
def test_the_onset_is_where_the_vibration_passes_the_threshold(growth, crossing_s):
    made = stream(vibration=process().threshold * growing(growth, crossing_s=crossing_s))
    ripple = 0.03 / growth  # of the envelope: 3 %
    assert onset_sample(made) / RATE_HZ == pytest.approx(crossing_s, abs=1e-3 + ripple)


def test_the_onset_waits_for_a_revolution_and_for_twenty_milliseconds():
    loud = process().threshold * growing(40.0, crossing_s=0.5)
    assert onset_sample(stream(vibration=loud)) == round((ENTRY_S + 0.05) * RATE_HZ)
    blow = np.where(np.abs(np.arange(loud.size) / RATE_HZ - 1.5) < 0.006, loud, 0.0)
    assert onset_sample(stream(vibration=blow)) is None


def test_the_threshold_is_five_percent_of_the_feed_per_tool():
    assert process().threshold == pytest.approx(3.75e-6)
    assert process().band_hz == pytest.approx(BAND_HZ)


@given(st.floats(10.0, 60.0), st.floats(-0.5, 1.5), st.floats(0.0, 3e-3))
def test_the_least_time_is_what_the_growth_needs_to_the_limit(growth, above, latency):
    """Force and vibration pass 1 at 1.5 s; the limit is exp(above): it is reached above / growth later."""
    force = np.column_stack([growing(growth), np.zeros(27000)])
    limit = np.full(300, math.exp(above))
    found = least_time(force, limit, RATE_HZ, BAND_HZ, latency=latency, begin=ENTRY_S, onset=1.5 - latency)
    assert found + latency == pytest.approx(1.5 + above / growth, abs=2.5e-3)


def test_the_least_time_counts_all_axes_and_the_limit_of_the_moment():
    force = np.column_stack([growing(30.0)] * 2) / math.sqrt(2.0)
    both = least_time(force, np.ones(300), RATE_HZ, BAND_HZ, latency=0.0, begin=ENTRY_S, onset=1.5)
    assert both == pytest.approx(1.5, abs=2.5e-3)
    falls = np.where(np.arange(300) < 170, 1e3, 1.0)
    late = least_time(force, falls, RATE_HZ, BAND_HZ, latency=0.0, begin=ENTRY_S, onset=1.5)
    assert late == pytest.approx(1.7, abs=1e-3)
    never = least_time(force, np.full(300, 1e3), RATE_HZ, BAND_HZ, latency=0.0, begin=ENTRY_S, onset=1.5)
    assert never is None


def test_a_limit_reached_long_before_the_onset_counts_from_the_beginning_of_the_growth():
    force = np.column_stack([growing(30.0)] * 2)
    early = least_time(force, np.full(300, 1e-12), RATE_HZ, BAND_HZ, latency=0.0, begin=ENTRY_S, onset=1.5)
    assert early == pytest.approx(ENTRY_S)


@given(st.floats(500.0, 800.0), st.floats(-0.05, 0.05), st.floats(0.0, 40.0))
def test_the_true_line_is_found_within_a_fifth_of_a_hertz(hertz, shift, growth):
    made = stream(vibration=growing(growth, hertz=hertz, crossing_s=1.5 + shift, ceiling=math.inf, duration_s=1.8))
    (line,) = true_lines(made, 1.5)
    assert line == pytest.approx(hertz, abs=0.2)


@pytest.mark.parametrize(("weaker", "count"), [(0.9, 2), (0.6, 2), (0.4, 1)])
def test_a_second_line_counts_when_it_is_half_as_strong(weaker, count):
    two = growing(0.0, hertz=652.0) + weaker * growing(0.0, hertz=690.0)
    lines = true_lines(stream(vibration=two), 1.5, 0.15)
    assert lines == pytest.approx((652.0, 690.0)[:count], abs=1.0)


def test_without_enough_truth_there_is_no_line():
    assert true_lines(stream(vibration=growing(0.0)), 2.95) == ()


@given(st.lists(st.floats(0.0, 60.0), max_size=60), st.data())
def test_more_alarms_never_count_for_less(times, data):
    every = np.array(sorted(times))
    some = np.array(sorted(data.draw(st.lists(st.sampled_from(times)))) if times else [])
    assert alarms_in(some).size <= alarms_in(every).size <= every.size


def test_an_alarm_that_never_stops_counts_each_second():
    assert alarms_in(np.arange(1000) * 0.01).size == 10
    assert alarms_in(np.array([0.0, 0.5, 0.99, 3.0])).tolist() == [0.0, 3.0]


def test_none_in_twenty_hours_bounds_the_rate_at_three_over_twenty():
    assert rate_bound(0, 20.0) == pytest.approx(3.0 / 20.0, rel=0.002)
    assert rate_bound(3, 20.0) == pytest.approx(7.754 / 20.0, rel=1e-3)  # chi-squared with 8 degrees of freedom, 95 %


def test_what_was_missed_is_infinitely_late():
    assert quantile([10.0, None, 30.0, 20.0], 0.5) == 20.0
    assert quantile([10.0, None, 30.0, 20.0], 0.95) == math.inf
    assert math.isnan(quantile([], 0.5))


def test_a_frequency_that_was_not_told_is_wrong():
    assert share_within([0.5, -0.9, None, 3.0], 1.0) == 0.5
