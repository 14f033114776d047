"""A selection of the battery, from seeds that nothing was chosen by; all of it: `python -m tests.chatter.battery`."""

import numpy as np
import pytest

from chatter import detect_recording
from tests.chatter.battery.recipes import RECIPES, made
from tests.chatter.battery.score import scored

SEEDS = (7001, 7002)


@pytest.fixture(scope="module")
def scores():
    """Cases, right verdicts, chatter found, of those at a right frequency, notes wanted, notes there; by recipe."""
    found = {}
    for name in RECIPES:
        samples = [made(name, seed) for seed in SEEDS]
        found[name] = sum(scored(s, detect_recording(s.signal, s.rate_hz, **s.told)) for s in samples)
    return found


def of(scores, *, chatter):
    unstable = ("chatter", "flip")
    return np.sum([row for name, row in scores.items() if name.endswith(unstable) == chatter], axis=0)


def test_it_is_drawn_and_not_stored():
    one, again, other = made("chatter_milling", 1), made("chatter_milling", 1), made("chatter_milling", 2)
    assert np.array_equal(one.signal, again.signal)
    assert not np.array_equal(one.signal[:1000], other.signal[:1000])
