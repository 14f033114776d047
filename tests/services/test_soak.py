"""What a soak counts, without processes."""

import math

import numpy as np
import pytest

from services.soak.load import busy, memory_mb, slope_mb_h
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
    assert slope_mb_h(time, grown) == pytest.approx(36.0)
    assert slope_mb_h(time, np.full(time.size, 80.0)) == pytest.approx(0.0, abs=1e-9)
    assert slope_mb_h(time, np.where(time < 90.0, np.nan, grown)) == pytest.approx(36.0)
    assert slope_mb_h(time[:2], grown[:2]) is None


def test_busy_processes_are_gone_afterwards():
    with busy(0.5) as count:
        assert count >= 1
    with busy(0.0) as count:
        assert count == 0
    assert math.isnan(memory_mb(2**22 + 7))
