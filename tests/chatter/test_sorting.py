"""Lines sorted into forced and free, in spectra whose truth is known by construction."""

import numpy as np
import pytest

from chatter.comb import evidence, refined, tolerance
from chatter.lines import lines_of
from chatter.sorting import sort_lines

RATE = 12000.0
TIME = np.arange(12000) / RATE
BAND = (100.0, 5000.0)


def lines(*wave, noise=0.02):
    signal = noise * np.random.default_rng(3).normal(size=TIME.size)
    for frequency, amplitude in wave:
        signal = signal + amplitude * np.sin(2 * np.pi * frequency * TIME + frequency)
    return lines_of(signal[:, None], RATE, 15.0)


def kind(found, sorted_lines, frequency):
    k = int(np.argmin(np.abs(found.frequency_hz - frequency)))
    assert found.frequency_hz[k] == pytest.approx(frequency, abs=0.3)
    return "forced" if sorted_lines.forced[k] else "free"


TEETH = [(366.43 * k, a) for k, a in ((1, 1.0), (2, 0.8), (3, 0.7), (4, 0.3))]
RUNOUT = [(91.61 * k, 0.2) for k in (1, 7, 9, 11, 13)]
CHATTER = [(1067.0 + 215.35 * k, a) for k, a in ((0, 1.0), (1, 0.3), (-1, 0.2), (-2, 0.1))]
PASSING = [(215.35 * k, 0.3) for k in (1, 2, 4)]


def test_interpolated_lines_stand_where_they_were_put():
    found = lines((366.43, 1.0), (1067.0, 0.1))
    assert found.frequency_hz == pytest.approx([366.43, 1067.0], abs=0.05)
    assert found.power == pytest.approx([0.5, 0.005], rel=0.05)


@pytest.mark.parametrize("speed", [None, 91.61, 91.61 * 1.005])
def test_tooth_passing_and_runout_are_forced(speed):
    found = lines(*TEETH, *RUNOUT)
    done = sort_lines(found, BAND, spindle_hz=speed, tools=4 if speed else None)
    assert done.forced[(found.frequency_hz > BAND[0]) & (found.power > 0.01)].all()


@pytest.mark.parametrize("speed", [None, 215.35 / 4])
def test_chatter_with_sidebands_is_free_and_what_it_repeats_with_is_not(speed):
    found = lines(*CHATTER, *PASSING, (2134.0, 0.2))
    done = sort_lines(found, BAND, spindle_hz=speed, tools=4 if speed else None)
    assert kind(found, done, 1067.0) == "free"
    assert kind(found, done, 2134.0) == "free"
    assert kind(found, done, 430.7) == "forced"


def test_a_clipped_sine_stands_for_itself():
    clipped = np.clip(np.sin(2 * np.pi * 651.0 * TIME), -0.3, 0.3) + 0.02 * np.random.default_rng(1).normal(size=12000)
    found = lines_of(clipped[:, None], RATE, 15.0)
    assert kind(found, sort_lines(found, BAND), 651.0) == "free"


def test_a_stated_speed_makes_a_lone_harmonic_forced():
    found = lines((600.0, 1.0))
    assert kind(found, sort_lines(found, BAND), 600.0) == "free"
    assert kind(found, sort_lines(found, BAND, spindle_hz=50.0, tools=4), 600.0) == "forced"


def test_evidence_grows_with_places_filled_and_falls_with_places_empty():
    exact = np.zeros((1, 12))
    full = [float(evidence(np.ones((1, n), dtype=bool), exact[:, :n], np.array([float(n)]), 0.1)[0]) for n in (3, 6, 9)]
    assert np.all(np.diff(full) > 2.0)
    fits = np.ones((4, 6), dtype=bool)
    empty = evidence(fits, np.zeros((4, 6)), np.array([6.0, 9.0, 15.0, 60.0]), 0.1)
    assert np.all(np.diff(empty) < 0.0)
    assert empty[-1] == -1.0, "no better than chance"


def test_a_fundamental_is_refined_to_its_lines():
    frequency = 91.61 * np.arange(1.0, 20.0)
    fitted = refined(np.array([91.5, 91.7]), frequency, tolerance(frequency, 1.0))
    assert fitted == pytest.approx([91.61, 91.61], rel=1e-9)
