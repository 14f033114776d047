"""The sliding spectrum against its definition: any frequencies, any cutting, no growth of the error."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from chatter import SlidingDFT
from chatter.sliding_dft import twiddles
from tests.reference.windows import ExactDFT, cycles, window_at

RATE = 9000.0


def stream(samples, channels=1, seed=0):
    return np.random.default_rng(seed).standard_normal((samples, channels))


def error(got, wanted):
    return np.abs(got - wanted).max() / np.abs(wanted).max()


@given(
    window=st.integers(1, 200),
    frequencies_hz=st.lists(st.floats(0.0, 4500.0), min_size=1, max_size=12),
    cuts=st.lists(st.integers(0, 130), min_size=1, max_size=8),
    channels=st.integers(1, 3),
)
def test_any_blocks_give_the_definition(window, frequencies_hz, cuts, channels):
    y = stream(sum(cuts), channels)
    sliding = SlidingDFT(frequencies_hz, window, RATE, channels)
    exact = ExactDFT(frequencies_hz, window, RATE)
    stop = 0
    for count in cuts:
        got = sliding.update(y[stop : stop + count])
        stop += count
        wanted = np.array([exact(row) for row in window_at(y, stop, window).T])
        np.testing.assert_allclose(got, wanted, rtol=0, atol=1e-13 * max(window, 1) ** 0.5)


@given(hop=st.integers(1, 150), before=st.integers(0, 150), samples=st.integers(0, 500), power=st.booleans())
def test_hops_of_a_long_block_are_those_of_single_updates(hop, before, samples, power):
    y = stream(before + samples, 2)
    whole, single = (SlidingDFT([500.0, 612.3, 700.0], 93, RATE, 2) for _ in range(2))
    for sliding in (whole, single):
        sliding.update(y[:before])
    got = whole.power(y[before:], hop) if power else whole.spectra(y[before:], hop)
    for i, row in enumerate(got):
        wanted = single.update(y[before + i * hop : before + (i + 1) * hop])
        np.testing.assert_allclose(row, np.abs(wanted) ** 2 if power else wanted, rtol=0, atol=1e-11)
    assert len(got) == samples // hop
    rest = np.vstack([y[before + len(got) * hop :], y[:5]])
    np.testing.assert_allclose(whole.update(y[:5]), single.update(rest), rtol=0, atol=1e-12)


@pytest.mark.parametrize("frequencies_hz", [np.arange(500.0, 701.0, 25.0), np.linspace(500.1, 699.9, 9)])
def test_error_does_not_grow(frequencies_hz):
    sliding = SlidingDFT(frequencies_hz, 9000, RATE)
    exact = ExactDFT(frequencies_hz, 9000, RATE)
    y = stream(200_123)
    errors = []
    for stop in (9000, 17_999, 18_000, 100_001, 200_123):
        got = sliding.update(y[sliding.seen : stop])[0]
        errors.append(error(got, exact(y[stop - 9000 : stop, 0])))
    assert max(errors) < 1e-15


def test_spike_leaves_no_trace():
    sliding = SlidingDFT([500.0, 612.3], 900, RATE)
    y = stream(1800)
    sliding.update(np.concatenate([y[:450], [[1e12]], y[451:]]))
    got = sliding.update(y[:900])
    fresh = SlidingDFT([500.0, 612.3], 900, RATE).update(y[:900])
    assert error(got, fresh) < 1e-13


def test_any_blocks_give_the_same_bits():
    y = stream(2500, 2)
    sliding, whole = (SlidingDFT([500.0, 612.3], 1000, RATE, 2) for _ in range(2))
    cuts = np.random.default_rng(1).integers(0, 200, 40).cumsum()
    got = [sliding.update(piece) for piece in np.split(y, cuts[cuts < 2500])][-1]
    np.testing.assert_array_equal(got, whole.update(y))


def test_phase_of_a_tone_is_counted_from_the_oldest_sample():
    n = np.arange(5000)
    sliding = SlidingDFT([600.0], 900, RATE)
    got = sliding.update(np.cos(2 * np.pi * 600.0 * n / RATE))
    assert got[0, 0] == pytest.approx(450 * np.exp(2j * np.pi * 600.0 * (5000 - 900) / RATE), rel=1e-12)


def test_twiddles_are_right_to_the_last_bit_or_two():
    frequencies_hz = np.array([0.0, 611.0, 612.345678901234, 4500.0])
    rows = [0, 1, 89, 8_999, 50_000_017]
    table = twiddles(frequencies_hz, rows, RATE)
    for k, f in enumerate(frequencies_hz):
        angle = 2 * np.pi * np.array([cycles(f, RATE, 9000)[i] if i < 9000 else _late(f, i) for i in rows])
        np.testing.assert_allclose(table[0, :, k], np.cos(angle), rtol=0, atol=1e-15)
        np.testing.assert_allclose(table[1, :, k], np.sin(angle), rtol=0, atol=1e-15)


def _late(frequency_hz, index):
    numerator, denominator = float(frequency_hz).as_integer_ratio()
    return numerator * index % (denominator * 9000) / (denominator * 9000)


def test_state_can_be_copied_and_put_back():
    a, b = (SlidingDFT([500.0, 612.3], 100, RATE, 2) for _ in range(2))
    y = stream(500, 2)
    a.update(y[:333])
    state = a.snapshot()
    wanted = a.update(y[333:])
    b.restore(state)
    np.testing.assert_array_equal(b.update(y[333:]), wanted)
    a.restore(state)
    np.testing.assert_array_equal(a.update(y[333:]), wanted)
    a.reset()
    fresh = SlidingDFT([500.0, 612.3], 100, RATE, 2)
    np.testing.assert_array_equal(a.update(y[:250]), fresh.update(y[:250]))
    with pytest.raises(ValueError, match="state"):
        SlidingDFT([500.0], 100, RATE, 2).restore(state)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_a_sample_that_is_not_finite_is_named_and_harms_nothing(bad):
    sliding, twin = (SlidingDFT([500.0, 612.3], 100, RATE, 2) for _ in range(2))
    y = stream(300, 2)
    broken = y[150:].copy()
    broken[7, 1] = bad
    for s in (sliding, twin):
        s.update(y[:150])
    with pytest.raises(ValueError, match="sample 157 of the stream.*channel 1"):
        sliding.update(broken)
    np.testing.assert_array_equal(sliding.update(y[150:]), twin.update(y[150:]))


@pytest.mark.parametrize("shape", [(5,), (5, 3), (5, 2, 1), ()])
def test_wrong_shapes_are_refused(shape):
    with pytest.raises(ValueError, match=r"block must be of shape \(n, 2\)"):
        SlidingDFT([500.0], 100, RATE, 2).update(np.zeros(shape))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"frequencies_hz": [4501.0]}, "frequencies_hz must be in"),
        ({"frequencies_hz": [-1.0]}, "frequencies_hz must be in"),
        ({"frequencies_hz": [np.nan]}, "frequencies_hz must be in"),
        ({"frequencies_hz": []}, "frequencies_hz must be of shape"),
        ({"window": 0}, "window must be an integer >= 1"),
        ({"window": 2.5}, "window must be an integer >= 1"),
        ({"sample_rate_hz": 0.0}, "sample_rate_hz must be positive"),
        ({"channels": 0}, "channels must be an integer >= 1"),
    ],
)
def test_wrong_arguments_are_refused(change, message):
    with pytest.raises(ValueError, match=message):
        SlidingDFT(**({"frequencies_hz": [500.0], "window": 100, "sample_rate_hz": RATE} | change))
