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


def of(scores, truth):
    return np.sum([row for name, row in scores.items() if ("stable" in name) == (truth == "stable")], axis=0)


def test_it_is_drawn_and_not_stored():
    one, again, other = made("chatter_milling", 1), made("chatter_milling", 1), made("chatter_milling", 2)
    assert np.array_equal(one.signal, again.signal)
    assert not np.array_equal(one.signal[:1000], other.signal[:1000])

@pytest.mark.parametrize("truth", ["stable", "chatter"])
def test_most_verdicts_are_right(scores, truth):
    """Most are over many seeds (`python -m tests.chatter.battery 1 20`); the floor leaves room for so few as these."""
    cases, right = of(scores, truth)[:2]
    assert right >= 0.8 * cases


def test_chatter_is_found_at_its_frequency_and_what_was_done_is_said(scores):
    _, _, found, at_its_frequency, wanted, noted = np.sum(list(scores.values()), axis=0)
    assert at_its_frequency >= 0.9 * found
    assert noted >= 0.75 * wanted
