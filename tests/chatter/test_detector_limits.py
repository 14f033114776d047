"""Learned limits against the distributions that they are derived from."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import f as f_distribution

from chatter.limits import LearnedLevel, ratio_limit
from chatter.peaks import floor_of, peaks


@given(st.floats(2.0, 200.0), st.floats(2.0, 400.0), st.floats(-9.0, -1.0))
def test_ratio_limit_is_the_quantile_of_f(freedom, learned, exponent):
    probability = 10.0**exponent
    limit = ratio_limit(freedom, learned, probability)
    assert f_distribution.logsf(limit, freedom, learned) == pytest.approx(np.log(probability), rel=1e-5)


@given(st.floats(4.0, 400.0), st.floats(-9.0, -1.0))
def test_closed_form_for_a_bin(learned, exponent):
    probability = 10.0**exponent
    limit = ratio_limit(2.0, learned, probability)
    assert f_distribution.logsf(limit, 2.0, learned) == pytest.approx(np.log(probability), rel=1e-6)


def test_learned_mean_is_that_of_what_was_learned_until_the_memory_is_full():
    rng = np.random.default_rng(0)
    level, powers = LearnedLevel(5, 100.0), rng.exponential(size=(80, 5))
    for row in powers:
        level.learn(row, float(row.sum()), 1.0)
    assert level.power == pytest.approx(powers.mean(axis=0))
    assert level.square == pytest.approx(powers.sum(axis=1).mean())
    for _ in range(1000):
        level.learn(np.full(5, 3.0), 15.0, 1.0)
    assert level.windows == 100.0
    assert level.power == pytest.approx(np.full(5, 3.0), rel=1e-3)


def test_false_alarms_of_a_bin_come_as_often_as_stated():
    rng = np.random.default_rng(1)
    probability, excesses, trials = 1e-2, 0, 0
    for _ in range(200):
        level = LearnedLevel(50, 1e9)
        for row in rng.exponential(size=(10, 50)):
            level.learn(row, 1.0, 1.0)
        fresh = rng.exponential(size=(20, 50))
        excesses += int((fresh > level.power * level.line_factor(probability)).sum())
        trials += fresh.size
    assert excesses / trials == pytest.approx(probability, rel=0.15)


def test_more_scatter_than_noise_widens_the_limit():
    rng = np.random.default_rng(2)
    calm, wild = LearnedLevel(1, 1e9), LearnedLevel(1, 1e9)
    for _ in range(200):
        calm.learn(np.ones(1), float(rng.chisquare(25) / 25), 1.0)
        wild.learn(np.ones(1), float(rng.exponential()), 1.0)
    assert calm.square_factor(25.0, 1e-6) < 1.3 * calm.square_factor(25.0, 1e-6, scatters=False)
    assert wild.square_factor(25.0, 1e-6) > 2.0 * calm.square_factor(25.0, 1e-6)


@given(st.integers(0, 50))
def test_the_floor_is_that_of_the_noise_and_lines_do_not_lift_it(seed):
    power = np.random.default_rng(seed).exponential(size=(50, 480))
    calm = np.mean([floor_of(row) for row in power])
    assert calm == pytest.approx(1.0, rel=0.1)  # the upper median of 32 is 5 % high
    power[:, ::40] = 1e6
    assert np.mean([floor_of(row) for row in power]) == pytest.approx(calm, rel=0.1)


def test_peaks_are_interpolated():
    window, true = 900, 65.3
    signal = np.cos(2.0 * np.pi * true * np.arange(window) / window) * np.sin(np.pi * np.arange(window) / window) ** 2
    power = np.abs(np.fft.rfft(signal)) ** 2
    found, away = peaks(power, np.full(power.size, 1e-6 * power.max()))
    best = int(np.argmax(power[found]))
    assert found[best] + away[best] == pytest.approx(true, abs=0.01)
