"""What a soak counts, without processes."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.soak.growth import LIMIT_MB_H, growth, judged
from services.soak.load import busy, memory_mb
from services.soak.soak import Seen, Wishes, _answer

WISHES = Wishes(duration_s=1.0, load=0.0, cut_every_s=math.inf, dashboards=0)


def said(sent, handled, lost, recorded, missing):
    return {
        "machine": {"blocks": sent, "overruns": 3},
        "monitor": {"handled": handled, "blocks_lost": lost},
        "recorder": {"topics": {"servo/turret1": recorded}, "missing_topics": {"servo/turret1": missing}},
    }


@pytest.mark.parametrize(
    ("numbers", "counted", "silent"),
    [((100, 100, 0, 100, 0), 0, 0), ((100, 98, 2, 99, 1), 3, 0), ((100, 98, 1, 90, 1), 2, 10)],
)
def test_a_block_is_had_or_counted_or_silently_lost(numbers, counted, silent):
    seen = Seen(blocks=100, ages_s=[0.001, 0.002, 0.010])
    found = _answer(seen, said(*numbers), WISHES)
    assert (found["blocks_sent"], found["blocks_lost_counted"], found["blocks_lost_silently"]) == (100, counted, silent)
    assert (found["age_p50_ms"], found["age_max_ms"], found["missed_deadlines"]) == (2.0, 10.0, 3)


def test_memory_that_grows_is_seen_and_what_is_held_from_the_start_is_not():
    time = np.arange(0.0, 100.0, 0.5)
    grown = 200.0 + 36.0 / 3600.0 * time + 50.0 * (time > 10.0)
    assert growth(time, grown) == pytest.approx((36.0, 0.0), abs=1e-6)
    assert growth(time, np.full(time.size, 80.0)) == pytest.approx((0.0, 0.0), abs=1e-6)
    assert growth(time, np.where(time < 90.0, np.nan, grown)) == pytest.approx((36.0, 0.0), abs=1e-6)
    assert growth(time[:4], grown[:4]) is None
    assert growth(time, np.full(time.size, np.nan)) is None


@given(st.floats(-200.0, 200.0), st.integers(0, 2**32 - 1))
def test_the_error_covers_the_slope_as_often_as_it_says(slope, seed):
    """Memory that comes and goes by 1 MB for a quarter of a minute at a time."""
    time, random = np.arange(0.0, 1200.0, 0.5), np.random.default_rng(seed)
    missed = 0
    for _ in range(40):
        walk = np.repeat(random.normal(0.0, 1.0, 80), 30)
        found = growth(time, 100.0 + slope / 3600.0 * time + walk)
        missed += abs(found.slope_mb_h - slope) > found.error_mb_h
    assert missed <= 8, "40 times 5 % is 2"


@pytest.mark.parametrize(
    ("minutes", "slope", "noise", "grows"),
    [(20, 40.0, 0.1, ["a"]), (20, 40.0, 9.0, []), (20, 5.0, 0.1, []), (20, -90.0, 0.1, []), (3, 400.0, 0.1, None)],
)
def test_only_what_surely_grows_too_fast_for_long_enough_is_a_fault(minutes, slope, noise, grows):
    time = np.arange(0.0, 60.0 * minutes + 1.0, 0.5)
    swing = noise * np.sin(2.0 * np.pi * time / 400.0)
    found = judged(list(time), {"a": list(50.0 + slope / 3600.0 * time + swing), "b": list(np.full(time.size, 9.0))})
    assert (found["memory_grows"], found["memory_limit_mb_h"]) == (grows, LIMIT_MB_H)
    assert found["memory_slopes_mb_h"]["b"] == pytest.approx(0.0, abs=1e-9)
    assert found["memory_slope_mb_h"] == max(found["memory_slopes_mb_h"].values())
    assert found["memory_mb"]["b"] == 9.0
    assert judged([], {})["memory_grows"] is None


def test_busy_processes_are_gone_afterwards():
    with busy(0.5) as count:
        assert count >= 1
    with busy(0.0) as count:
        assert count == 0
    assert math.isnan(memory_mb(2**22 + 7))
