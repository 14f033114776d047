"""Signals that no observer should be given."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from chatter.observers.health import even, faults, unwrapped
from tests.chatter.test_observers_family import RATE, A

DRIVE = replace(A, motor_resolution=38.15e-9, stage_resolution=20e-9)
TIME = np.arange(8000) / RATE
TRAVEL = 0.1 + 2e-3 * TIME + 1e-6 * np.sin(2 * np.pi * 30.0 * TIME)


def quantised(position, count):
    return np.rint(position / count) * count


MOTOR, STAGE = quantised(TRAVEL + 1e-7, 38.15e-9), quantised(TRAVEL, 20e-9)


def test_sound_signals_have_no_fault():
    assert faults(DRIVE, RATE, MOTOR, STAGE) == []
    assert faults(DRIVE, RATE, np.full(8000, 0.1), np.full(8000, 0.1)) == []
    shaken = 0.1 + 30e-9 * np.sin(2 * np.pi * 600.0 * TIME)  # a standing axis: the motor counts do not move
    assert faults(DRIVE, RATE, quantised(shaken * 0 + 0.1, 38.15e-9), quantised(shaken, 1e-9)) == []


def test_a_jump_is_named_with_its_place():
    jumped = MOTOR.copy()
    jumped[4000:] += 5e-3
    (fault,) = faults(DRIVE, RATE, jumped, STAGE)
    assert (fault.signal, fault.sample) == ("motor_position", 4000)
    assert "jumps by 5 mm at sample 4000 (200 ms)" in fault.sentence


@given(turns=st.integers(1, 30), start=st.floats(-0.01, 0.01))
def test_a_counter_that_wraps_is_unwrapped(turns, start):
    travel = start + 5e-3 * turns * np.linspace(0.0, 1.0, 4000)
    wrapped = np.mod(travel, 5e-3)
    np.testing.assert_allclose(unwrapped(wrapped, 5e-3) - wrapped[0], travel - travel[0], atol=1e-12)
    with pytest.raises(ValueError, match="period must be positive"):
        unwrapped(wrapped, 0.0)


def test_a_stuck_encoder_is_named():
    stuck = STAGE.copy()
    stuck[3000:] = stuck[3000]
    (fault,) = faults(DRIVE, RATE, MOTOR, stuck)
    assert fault.signal == "stage_position"
    assert 2990 <= fault.sample <= 3010
    assert "stuck or missing encoder" in fault.sentence
    (dead,) = faults(DRIVE, RATE, np.zeros(8000), STAGE)
    assert (dead.signal, dead.sample) == ("motor_position", 0)


def test_a_reversed_sign_is_named():
    (fault,) = faults(DRIVE, RATE, MOTOR, -STAGE)
    assert "runs against motor_position (correlation -1.00)" in fault.sentence


@given(seed=st.integers(0, 20), size=st.floats(0.0, 0.4))
def test_small_jitter_is_resampled(seed, size):
    rng = np.random.default_rng(seed)
    time = (np.arange(2000) + size * rng.uniform(-1.0, 1.0, 2000)) / RATE
    signals = np.stack([np.sin(2 * np.pi * 100.0 * time), np.cos(2 * np.pi * 300.0 * time)], axis=1)
    got, jitter = even(time, signals, RATE)
    grid = time[0] + np.arange(2000) / RATE
    wanted = np.stack([np.sin(2 * np.pi * 100.0 * grid), np.cos(2 * np.pi * 300.0 * grid)], axis=1)
    assert jitter <= 2.0 * size + 1e-9
    np.testing.assert_allclose(got[5:-5], wanted[5:-5], atol=2e-4)


def test_large_jitter_gaps_and_the_past_are_refused():
    time = np.arange(100) / RATE
    time[50:] += 3 / RATE
    with pytest.raises(ValueError, match="got a jitter of 1.5 samples"):
        even(time, np.zeros((100, 2)), RATE)
    with pytest.raises(ValueError, match="time must increase, got 0.0001"):
        even(np.array([0.0, 1.0, 2.0, 1.0001, 3.0]) / 1e4 + np.array([0, 0, 0, 0, 0]), np.zeros((5, 1)), RATE)
    with pytest.raises(ValueError, match="time must be of shape"):
        even([0.0, 1.0], np.zeros((2, 1)), RATE)
