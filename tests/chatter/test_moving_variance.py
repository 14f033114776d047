"""The moving variance against two passes over every window."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from chatter import MovingVariance
from tests.reference.windows import moving_variance


def cut(variance, stream, cuts):
    edges = [0, *np.cumsum(cuts), len(stream)]
    pieces = [variance.update(stream[a:b]) for a, b in zip(edges, edges[1:], strict=False)]
    return np.concatenate(pieces)[: len(stream)]


@given(window=st.integers(1, 60), samples=st.integers(0, 200), cuts=st.lists(st.integers(0, 40), max_size=8))
def test_any_blocks_give_two_passes_over_every_window(window, samples, cuts):
    y = 1e3 + np.random.default_rng(window).standard_normal((samples, 2))
    got = cut(MovingVariance(window, 2), y, cuts)
    for channel in range(2):
        np.testing.assert_allclose(got[:, channel], moving_variance(y[:, channel], window), rtol=1e-12, atol=1e-13)
    np.testing.assert_array_equal(got, MovingVariance(window, 2).update(y))


@pytest.mark.parametrize("window", [90, 900])
def test_small_deviation_on_a_large_mean(window):
    y = 1e6 + np.random.default_rng(1).standard_normal(3000)
    got, wanted = MovingVariance(window).update(y)[:, 0], moving_variance(y, window)
    np.testing.assert_allclose(got[1:], wanted[1:], rtol=1e-13)


def test_long_window_stays_exact_after_a_million_samples():
    y = 1e6 + np.random.default_rng(2).standard_normal(1_000_000)
    got = MovingVariance(9000).update(y)[:, 0]
    for stop in (500_000, 999_000, 1_000_000):
        tail = y[stop - 9000 : stop] - 1e6
        assert got[stop - 1] == pytest.approx(tail.var(), rel=1e-13)


def test_steps_and_spikes_leave_no_trace():
    y = np.random.default_rng(3).standard_normal(1000)
    y[300:] += 1e8
    y[650] = 1e15
    got, wanted = MovingVariance(90).update(y)[:, 0], moving_variance(y, 90)
    np.testing.assert_allclose(got[1:], wanted[1:], rtol=1e-12)


def test_constant_stream_has_no_variance_at_all():
    assert not MovingVariance(7, 2).update(np.full((50, 2), 0.1)).any()


def test_state_can_be_copied_and_put_back():
    y = np.random.default_rng(4).standard_normal((300, 2))
    a, b = MovingVariance(50, 2), MovingVariance(50, 2)
    a.update(y[:123])
    state = a.snapshot()
    wanted = a.update(y[123:])
    b.restore(state)
    np.testing.assert_array_equal(b.update(y[123:]), wanted)
    a.restore(state)
    np.testing.assert_array_equal(a.update(y[123:]), wanted)
    a.reset()
    np.testing.assert_array_equal(a.update(y[:90]), MovingVariance(50, 2).update(y[:90]))
    with pytest.raises(ValueError, match="state"):
        MovingVariance(49, 2).restore(state)


def test_a_sample_that_is_not_finite_is_named_and_harms_nothing():
    y = np.random.default_rng(5).standard_normal((100, 1))
    variance, twin = MovingVariance(30), MovingVariance(30)
    variance.update(y[:40])
    twin.update(y[:40])
    broken = y[40:].copy()
    broken[[3, 9]] = np.nan
    with pytest.raises(ValueError, match="sample 43 of the stream"):
        variance.update(broken)
    np.testing.assert_array_equal(variance.update(y[40:]), twin.update(y[40:]))


def test_wrong_arguments_are_refused():
    with pytest.raises(ValueError, match="window must be an integer >= 1, got 0"):
        MovingVariance(0)
    with pytest.raises(ValueError, match=r"block must be of shape \(n, 2\)"):
        MovingVariance(3, 2).update(np.zeros(4))
    with pytest.raises(ValueError, match="block must be real"):
        MovingVariance(3).update(np.zeros(4, dtype=complex))
