"""Forces over position and lines over speed: what an idling axis teaches, and where it must not be used."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from chatter import BiquadFilter
from chatter.filters import response
from chatter.observers.idling import IdlingTable, learn_idling, left_of_ripple
from chatter.observers.notch import away_from_tooth_passing, encoder_lines_hz, notches

RATE = 10_000.0
SPEED = 5e-3


def run(ripple=1e-3, seed=0, velocity=SPEED, offset=0.0, noise=0.5):
    rng = np.random.default_rng(seed)
    position = 0.01 + offset + velocity * np.arange(8000) / RATE
    return position, 4.0 + 3.0 * np.sin(2 * np.pi * position / ripple) + noise * rng.standard_normal(8000)


def table(**changes):
    runs = [run(seed=k, offset=1e-5 * k) for k in range(4)]
    return learn_idling([p for p, _ in runs], [f for _, f in runs], RATE, **changes)


def test_what_repeats_over_position_is_taken_off():
    learned = table(bin_width=2e-5)
    position, force = run(seed=9, offset=5e-5, noise=0.0)
    inside = position < 0.0139
    left = force[inside] - learned.at(position[inside], SPEED)
    assert np.std(left) < 0.05 * np.std(force)
    assert abs(left.mean()) < 0.02


@given(part=st.floats(0.0, 0.5))
def test_beside_its_place_a_ripple_leaves_as_much_as_said(part):
    wave = 1e-3
    place = np.linspace(0.0, 10 * wave, 5001)[:-1]
    exact = IdlingTable(start=0.0, bin=1e-6, force=np.sin(2 * np.pi * np.arange(20_000) * 1e-6 / wave), velocity=SPEED)
    left = exact.at(place + part * wave, SPEED) - exact.at(place, SPEED)
    assert np.sqrt(2) * np.std(left) == pytest.approx(left_of_ripple(part * wave, wave), abs=1e-3)


def test_beyond_a_sixth_of_the_wave_compensation_harms():
    assert left_of_ripple(1 / 6, 1.0) == pytest.approx(1.0)


def test_a_table_for_another_speed_or_place_is_refused():
    learned = table()
    with pytest.raises(ValueError, match="velocity must be within 5% of 0.005 m/s.*got -0.005"):
        learned.at([0.011], -SPEED)
    with pytest.raises(ValueError, match="velocity must be within"):
        learned.at([0.011], 1.1 * SPEED)
    with pytest.raises(ValueError, match="position must be within the idling table"):
        learned.at([0.011, 0.5], SPEED)


def test_runs_that_do_not_belong_together_are_refused():
    p, f = run()
    with pytest.raises(ValueError, match="at least 3 runs, got 2"):
        learn_idling([p] * 2, [f] * 2, RATE)
    with pytest.raises(ValueError, match="runs at one speed"):
        learn_idling([p, p, p[::-1]], [f] * 3, RATE)
    with pytest.raises(ValueError, match="bin_width must be at least the travel in one sample"):
        table(bin_width=1e-9)
    with pytest.raises(ValueError, match="common stretch"):
        learn_idling([p, p, p + 1.0], [f] * 3, RATE)


def test_bins_without_a_sample_are_filled_and_gaps_left_out():
    p, f = run(noise=0.0)
    holes = f.copy()
    holes[100:140] = np.nan
    learned = learn_idling([p] * 3, [holes] * 3, RATE)
    assert np.isfinite(learned.force).all()


def test_encoder_lines_follow_the_speed():
    lines = encoder_lines_hz(SPEED, [5e-3 / 512, 20e-6], 3, 1600.0)
    np.testing.assert_allclose(lines, [250.0, 500.0, 512.0, 750.0, 1024.0, 1536.0])
    np.testing.assert_allclose(encoder_lines_hz(-2 * SPEED, [20e-6], 1, 1600.0), [500.0])
    assert encoder_lines_hz(0.0, [20e-6], 3, 1600.0).size == 0


def test_no_notch_where_the_teeth_pass():
    lines = np.array([100.0, 250.0, 333.0, 512.0])
    np.testing.assert_allclose(away_from_tooth_passing(lines, 83.0), [100.0])
    np.testing.assert_allclose(away_from_tooth_passing(lines, 0.0), lines)


def test_a_notch_takes_its_line_and_leaves_the_rest():
    sections = notches(np.array([250.0, 512.0]), 0.05, RATE)
    gain = np.abs(response(sections, [1e-3, 250.0, 512.0, 100.0, 350.0, 4000.0], RATE))
    np.testing.assert_allclose(gain, [1.0, 0.0, 0.0, 1.0, 1.0, 1.0], atol=0.02)
    edge = np.abs(response(notches(np.array([250.0]), 0.05, RATE), [250.0 * 1.025, 250.0 * 0.975], RATE))
    np.testing.assert_allclose(edge, np.sqrt(0.5), rtol=0.02)
    time = np.arange(20_000) / RATE
    left = BiquadFilter(sections).update(np.sin(2 * np.pi * 250.0 * time))
    assert np.abs(left[10_000:]).max() < 1e-6


def test_notches_and_lines_that_cannot_be_are_refused():
    with pytest.raises(ValueError, match="width must be in"):
        notches(np.array([100.0]), 0.0, RATE)
    with pytest.raises(ValueError, match="lines_hz must be in"):
        notches(np.array([6000.0]), 0.1, RATE)
    with pytest.raises(ValueError, match="orders must be at least 1"):
        encoder_lines_hz(1.0, [1e-3], 0, 100.0)
    with pytest.raises(ValueError, match="periods must be positive"):
        encoder_lines_hz(1.0, [0.0], 1, 100.0)
