"""The robust pitch stands what it promises, and says so when nothing does."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pitch import OneModeProcess, PlannerConfig, roots
from pitch.robust import Spread, robust_for_lines, robust_for_process

CONFIG = PlannerConfig(sample_rate_hz=9000.0)
BAR = OneModeProcess(0.27, 408.0, 0.12, overlap=0.859, process_damping=33.0)
K = 1.06e6


def growth(process, stiffness, difference, speed=20.0):
    """Of the strongest wave of the bar, not of the delays alone."""
    found = roots(process, stiffness, speed, difference, count=12)
    return found.real[found.imag > math.pi * process.natural_frequency_hz].max()


def test_the_worst_of_the_spread_decays_as_promised():
    found = robust_for_process([BAR], K, 20.0, CONFIG, 0.025)
    assert found.found
    w = BAR.natural_frequency_hz
    worst = max(
        growth(dataclasses.replace(BAR, natural_frequency_hz=w + f, damping_ratio=BAR.damping_ratio * w / (w + f)),
               K * k, found.pitch_difference)
        for f in (-10.0, 0.0, 10.0) for k in (0.7, 1.0, 1.3)
    )  # fmt: skip
    assert worst == pytest.approx(found.worst_growth, abs=1e-6)
    assert worst < 0.0
    assert 0.6 < found.phase / math.pi < 1.2


def test_it_stands_more_than_the_rule_for_one_frequency():
    found = robust_for_process([BAR], K, 20.0, CONFIG, 0.025)
    rule = math.pi * 20.0 / found.frequency_hz
    scenes = [(f, k) for f in (-10.0, 0.0, 10.0) for k in (0.7, 1.0, 1.3)]

    def worst(difference):
        return max(
            growth(dataclasses.replace(BAR, natural_frequency_hz=BAR.natural_frequency_hz + f), K * k, difference)
            for f, k in scenes
        )

    assert worst(found.pitch_difference) <= worst(rule) + 1e-6


def test_its_window_ends_where_stability_does():
    found = robust_for_process([BAR], K, 20.0, CONFIG, 0.025, spread=Spread(frequency_hz=0.0, stiffness=0.0))
    step = 0.02 * math.pi * 20.0 / found.frequency_hz
    low, high = found.window
    assert growth(BAR, K, low) < 0.0 <= growth(BAR, K, low - 1.01 * step)
    assert growth(BAR, K, high) < 0.0 <= growth(BAR, K, high + 1.01 * step)
    assert found.margin[0] > 0.0
    assert found.margin[1] > 0.0
    np.testing.assert_allclose(
        np.array(found.margin_hz) / found.frequency_hz, np.array(found.margin_pi) * math.pi / found.phase
    )


def test_the_stretch_ahead_counts():
    softer = dataclasses.replace(BAR, modal_mass=0.4, natural_frequency_hz=408.0)
    both = robust_for_process([BAR, softer], K, 20.0, CONFIG, 0.025)
    alone = robust_for_process([BAR], K, 20.0, CONFIG, 0.025)
    assert both.worst_growth >= alone.worst_growth
    assert growth(softer, 1.3 * K, both.pitch_difference) < 0.0


def test_nothing_within_the_travel_is_said_with_a_speed_that_would_help():
    tight = dataclasses.replace(CONFIG, max_shift=math.radians(1.75))
    none = robust_for_process([BAR], K, 20.0, tight, 0.025)
    assert not none.found
    assert math.isnan(none.pitch_difference)
    assert "no stable pitch within a shift of 1.8 deg" in none.reason
    assert "1/min" in none.reason or "at no speed" in none.reason


def test_a_cut_far_too_stiff_has_none_at_any_speed():
    wild = dataclasses.replace(BAR, damping_ratio=0.002, process_damping=0.0)
    none = robust_for_process([wild], 30.0 * K, 20.0, CONFIG, 0.025)
    assert not none.found
    assert "at no speed within 20 %" in none.reason


@given(line=st.floats(400.0, 900.0), speed=st.floats(12.0, 30.0))
def test_one_line_alone_is_put_near_antiphase(line, speed):
    wide = dataclasses.replace(CONFIG, max_shift=math.radians(18.0), x1_travel=(-9e-3, 9e-3), y1_travel=(-9e-3, 9e-3))
    found = robust_for_lines([line], speed, wide, 0.025)
    assert found.found
    assert found.phase / math.pi == pytest.approx(1.0, abs=0.1)
    assert found.window[0] * line / speed / math.pi == pytest.approx(0.7, abs=0.06)
    assert found.window[1] * line / speed / math.pi == pytest.approx(1.1, abs=0.06)


def test_two_lines_share_the_window_and_three_far_apart_do_not():
    found = robust_for_lines([652.0, 612.0], 20.0, CONFIG, 0.025)
    phases = np.array([652.0, 612.0]) * found.pitch_difference / 20.0 / math.pi
    assert ((phases > 0.7) & (phases < 1.1)).all()
    assert not robust_for_lines([400.0, 700.0], 20.0, CONFIG, 0.025).found
    assert "400..700 Hz" in robust_for_lines([400.0, 700.0], 20.0, CONFIG, 0.025).reason


def test_questions_without_meaning_are_refused():
    with pytest.raises(ValueError, match="processes must be at least one"):
        robust_for_process([], K, 20.0, CONFIG, 0.025)
    with pytest.raises(ValueError, match="lines_hz must be at least one"):
        robust_for_lines([], 20.0, CONFIG, 0.025)
    with pytest.raises(ValueError, match="lines_hz must be > 0"):
        robust_for_lines([-5.0], 20.0, CONFIG, 0.025)
    with pytest.raises(ValueError, match="stiffness must be in"):
        Spread(stiffness=1.0)
