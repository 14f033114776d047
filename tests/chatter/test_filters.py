"""Biquads and Butterworth designs against scipy."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import signal

from chatter import BiquadFilter, butterworth
from chatter.filters import group_delay, response

RATE = 9000.0
DESIGNS = [
    (order, cutoff, kind)
    for order in range(1, 7)
    for cutoff, kind in [
        (1000.0, "lowpass"),
        (100.0, "highpass"),
        ((500.0, 750.0), "bandpass"),
        ((90.0, 4e3), "bandpass"),
    ]
]


@pytest.mark.parametrize(("order", "cutoff_hz", "kind"), DESIGNS)
def test_design_is_that_of_scipy(order, cutoff_hz, kind):
    frequency_hz = np.linspace(1.0, 4499.0, 200)
    sections = signal.butter(order, cutoff_hz, kind, fs=RATE, output="sos")
    wanted = signal.freqz_sos(sections, frequency_hz, fs=RATE)[1]
    got = response(butterworth(order, cutoff_hz, RATE, kind), frequency_hz, RATE)
    np.testing.assert_allclose(got, wanted, rtol=0, atol=1e-10)


@given(cuts=st.lists(st.integers(0, 90), min_size=1, max_size=6), order=st.integers(1, 5))
def test_any_blocks_give_the_output_of_scipy(cuts, order):
    x = np.random.default_rng(order).standard_normal((sum(cuts), 3))
    sections = butterworth(order, 1000.0, RATE)
    filtered, edges = BiquadFilter(sections, 3, steady_start=False), [0, *np.cumsum(cuts)]
    got = np.concatenate([filtered.update(x[a:b]) for a, b in zip(edges, edges[1:], strict=False)])
    full = np.insert(sections, 3, 1.0, axis=1)
    np.testing.assert_allclose(got, signal.sosfilt(full, x, axis=0) if len(x) else x, rtol=0, atol=1e-13)


def test_constant_input_passes_without_a_transient():
    got = BiquadFilter(butterworth(4, 1000.0, RATE), 2).update(np.full((200, 2), [5.0, -300.0]))
    np.testing.assert_allclose(got, np.full((200, 2), [5.0, -300.0]), rtol=1e-13)
    band = BiquadFilter(butterworth(4, (500.0, 750.0), RATE, "bandpass"), 2)
    np.testing.assert_allclose(band.update(np.full((200, 2), [5.0, -300.0])), 0.0, atol=1e-10)


def test_group_delay_is_that_of_scipy():
    sections = butterworth(4, 1000.0, RATE)
    wanted = signal.group_delay(signal.sos2tf(np.insert(sections, 3, 1.0, axis=1)), 612.0, fs=RATE)[1]
    assert group_delay(sections, 612.0, RATE) == pytest.approx(float(wanted[0]) / RATE, rel=1e-6)


def test_state_can_be_copied_and_put_back():
    x = np.random.default_rng(0).standard_normal((100, 2))
    a, b = (BiquadFilter(butterworth(3, 500.0, RATE), 2) for _ in range(2))
    a.update(x[:40])
    state = a.snapshot()
    wanted = a.update(x[40:])
    b.restore(state)
    np.testing.assert_array_equal(b.update(x[40:]), wanted)
    a.reset()
    np.testing.assert_array_equal(a.update(x), BiquadFilter(butterworth(3, 500.0, RATE), 2).update(x))
    with pytest.raises(ValueError, match="state"):
        BiquadFilter(butterworth(4, 500.0, RATE), 3).restore(state)


def test_a_sample_that_is_not_finite_is_named_and_harms_nothing():
    x = np.random.default_rng(0).standard_normal((100, 2))
    a, b = (BiquadFilter(butterworth(3, 500.0, RATE), 2) for _ in range(2))
    broken = x.copy()
    broken[0, 1] = np.inf
    with pytest.raises(ValueError, match="sample 0 of the stream"):
        a.update(broken)
    np.testing.assert_array_equal(a.update(x), b.update(x))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((0, 500.0, RATE), "order must be"),
        ((2, 4500.0, RATE), "cutoff_hz must be"),
        ((2, (1.0, 2.0), RATE), "cutoff_hz must be"),
        ((2, (2.0, 1.0), RATE, "bandpass"), "cutoff_hz must be"),
        ((2, 5.0, RATE, "notch"), "kind must be one of"),
    ],
)
def test_wrong_designs_are_refused(arguments, message):
    with pytest.raises(ValueError, match=message):
        butterworth(*arguments)
