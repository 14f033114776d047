"""What the monitor is given: the checks of the samples against plain NumPy, and the baseband against one shot."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from chatter.baseband import Baseband
from chatter.input_check import InputCheck
from chatter.spectrum import smoothing
from tests.chatter.signals import RATE, noise
from tests.chatter.test_monitor import ENTRY, after, chattering, monitor, steps
from tests.reference.input_signs import signs


@settings(max_examples=40)
@given(st.integers(0, 10_000), st.integers(1, 2), st.lists(st.sampled_from("nqcdrp"), min_size=3, max_size=14))
def test_signs_are_those_of_plain_numpy(seed, channels, course):
    rng = np.random.default_rng(seed)
    blocks = []
    for what in course:
        block = rng.normal(size=(30, channels))
        if what == "q":  # coarse
            block = np.round(2.0 * block)
        elif what == "c" and blocks:  # stands still
            block = np.repeat(blocks[-1][-1:], 30, axis=0)
        elif what == "d":  # every value twice
            block = np.repeat(block[:15], 2, axis=0)
        elif what == "r" and blocks:  # the block before once more
            block = blocks[-1].copy()
        elif what == "p":  # clipped
            block = np.clip(3.0 * np.sin(np.arange(30) / 3.0 + seed)[:, None] * np.ones(channels), -1.0, 1.0)
        blocks.append(block)
    check = InputCheck(channels)
    assert [set(check.look(block)) for block in blocks] == signs(np.array(blocks))


@given(st.integers(0, 1000), st.integers(3, 9))
def test_baseband_is_that_of_the_whole_signal_at_once(seed, count):
    rng = np.random.default_rng(seed)
    signal = rng.normal(size=(90 * count, 2))
    slow = Baseband(625.0, 150.0, RATE, 90, 2, 1.0)
    for k in range(count):
        slow.update(signal[90 * k : 90 * (k + 1)])
    kernel = smoothing(slow.step)
    turned = signal * np.exp(-2j * np.pi * 625.0 / RATE * np.arange(len(signal)))[:, None]
    first = slow.step - 1
    whole = np.stack([np.convolve(column, kernel, "valid")[first :: slow.step] for column in turned.T], axis=1)
    np.testing.assert_allclose(slow.last(90 * count / RATE)[1:], whole, atol=1e-12)
    short = slow.last(0.02)
    assert len(short) < len(slow.last(0.04))
    state = slow.snapshot()
    slow.update(signal[:90])
    slow.restore(state)
    np.testing.assert_array_equal(slow.last(0.02), short)


@pytest.mark.parametrize(
    ("spoil", "note", "state"),
    [
        (lambda x: np.clip(x, -3.0, 3.0), "clipped", None),
        (lambda x: np.zeros_like(x) + 2.0, "constant", "invalid"),
        (lambda x: np.repeat(x[::2], 2, axis=0), "duplicated", None),
        (lambda x: np.tile(x[:90], (len(x) // 90, 1)), "repeated", "invalid"),
        (lambda x: np.where(np.arange(len(x))[:, None] % 90 == 7, np.nan, x), None, "invalid"),
    ],
)
def test_bad_samples_are_told_and_never_called_chatter(spoil, note, state):
    rng = np.random.default_rng(1)
    time = np.arange(18000) / RATE
    signal = noise(rng, 2.0, 0.35) + 20.0 * np.sin(2.0 * np.pi * 70.0 * time)[:, None]
    begin = 0 if note == "clipped" else 9000  # the range of a sensor is that of all it ever gave
    signal[begin:] = spoil(signal[begin:])
    told = steps(monitor(), signal, in_cut=after(ENTRY), spindle_hz=20.0)[110:]
    assert not any(e.state == "chatter" for e in told)
    assert note is None or any(note in e.notes for e in told)
    assert state is None or told[-1].state == state


def test_chatter_is_found_although_the_sensor_clips_it():
    signal = np.clip(chattering(2, lines=((651.0, 30.0),)) - [63.0, 85.0], -6.0, 6.0)
    out = steps(monitor(), signal, in_cut=after(ENTRY), spindle_hz=20.0)
    assert out[-1].state == "chatter"
    assert abs(out[-1].frequency_hz - 651.0) < 1.0
