"""The sliding spectrum against its definition: any frequencies, hops and cutting, no growth of the error."""

import copy
import json
import os
import pickle
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from chatter import SlidingDFT
from chatter.twiddles import low_rank, twiddles
from tests.reference.windows import ExactDFT, cycles, spectra, window_at

RATE = 9000.0
BAND = np.arange(500.0, 701.0, 25.0)
OFF_GRID = np.linspace(500.1, 699.9, 9)
EMPTY = np.zeros((0, 2))


def stream(samples, channels=1, seed=0):
    return np.random.default_rng(seed).standard_normal((samples, channels))


def error(got, wanted):
    return np.abs(got - wanted).max() / np.abs(wanted).max()


def ask(sliding, block, how, hop):
    """One call, and the samples after which it says what."""
    seen = sliding.seen
    if how == "update":
        return sliding.update(block)[None], [seen + len(block)]
    if how == "maximum":
        return sliding.maximum(block)[None], range(seen + min(len(block), 1), seen + len(block) + 1)
    return getattr(sliding, how)(block, hop), range(seen + hop, seen + len(block) + 1, hop)


@settings(max_examples=60)
@given(
    window=st.integers(1, 2500),
    frequencies_hz=st.lists(st.floats(0.0, 4500.0), min_size=1, max_size=12) | st.just([500.0, 700.0, 4500.0]),
    calls=st.lists(
        st.tuples(
            st.sampled_from(["update", "spectra", "power", "maximum"]),
            st.integers(0, 40) | st.integers(0, 900),
            st.integers(1, 20) | st.integers(1, 700) | st.just(90),
        ),
        min_size=1,
        max_size=8,
    ),
    channels=st.integers(1, 3),
    hann=st.booleans(),
)
def test_any_calls_give_the_definition(window, frequencies_hz, calls, channels, hann):
    y = stream(sum(count for _, count, _ in calls), channels)
    sliding = SlidingDFT(frequencies_hz, window, RATE, channels, hann=hann)
    stop = 0
    for how, count, hop in calls:
        got, stops = ask(sliding, y[stop : stop + count], how, hop)
        stop += count
        wanted = spectra(y, stops, frequencies_hz, window, RATE, hann)
        if how in ("power", "maximum"):
            wanted = np.abs(wanted) ** 2
        if how == "maximum":
            wanted = wanted.max(axis=0, keepdims=True)
        assert got.shape == wanted.shape
        size = max(np.abs(wanted).max(initial=1.0), window if how in ("power", "maximum") else window**0.5)
        np.testing.assert_allclose(got, wanted, rtol=0, atol=1e-14 * size)
    assert sliding.seen == stop


@pytest.mark.parametrize("hop", [1, 9, 18, 19, 30, 90, 100, 180, 1000, 4000])
@pytest.mark.parametrize("frequencies_hz", [BAND, OFF_GRID], ids=["grid", "between"])
def test_every_class_of_hop_gives_the_definition(frequencies_hz, hop):
    y = stream(13_000, 2)
    sliding = SlidingDFT(frequencies_hz, 3000, RATE, 2)
    sliding.update(y[:137])
    got = sliding.spectra(y[137:], hop)
    stops = range(137 + hop, len(y) + 1, hop)
    some = slice(None, None, max(1, len(got) // 20))
    assert len(got) == len(stops)
    assert error(got[some], spectra(y, stops[some], frequencies_hz, 3000, RATE)) < 1e-15


@pytest.mark.parametrize("frequencies_hz", [BAND, OFF_GRID], ids=["grid", "between"])
@pytest.mark.parametrize("hop", [1, 9, 90, 250])
def test_error_does_not_grow(frequencies_hz, hop):
    sliding = SlidingDFT(frequencies_hz, 9000, RATE)
    exact = ExactDFT(frequencies_hz, 9000, RATE)
    y = stream(200_123)
    errors = []
    for start in (8_900, 17_700, 17_950, 99_751, 199_873):
        sliding.update(y[sliding.seen : start])
        got = sliding.spectra(y[start : start + 250], hop)
        stop = start + 250 // hop * hop
        errors.append(error(got[-1, 0], exact(y[stop - 9000 : stop, 0])))
    assert max(errors) < 1e-15


def test_a_wide_band_has_no_low_rank_and_is_exact_all_the_same():
    frequencies_hz, y = np.arange(0.0, 4501.0, 45.0), stream(5000, 2)
    sliding = SlidingDFT(frequencies_hz, 1000, RATE, 2)
    got = sliding.spectra(y, 250)
    assert error(got, spectra(y, range(250, 5001, 250), frequencies_hz, 1000, RATE)) < 1e-15


@pytest.mark.parametrize("hann", [False, True])
def test_many_bins_and_long_hops_go_by_whole_windows(hann):
    frequencies_hz = np.arange(0.0, 4501.0, 9.0)  # the first and the last have neighbours beyond the grid
    calls = [("spectra", 3100, 1500), ("update", 77, 0), ("power", 2300, 1100), ("update", 1003, 0), ("update", 0, 0),
             ("spectra", 300, 30), ("update", 1000, 0), ("maximum", 3, 0), ("spectra", 1397, 200)]  # fmt: skip
    y = stream(9180, 2)
    sliding, twin = (SlidingDFT(frequencies_hz, 1000, RATE, 2, hann=hann) for _ in range(2))
    stop = 0
    for how, count, hop in calls:
        got, stops = ask(sliding, y[stop : stop + count], how, hop)
        stop += count
        wanted = spectra(y, stops, frequencies_hz, 1000, RATE, hann)
        if how in ("power", "maximum"):
            wanted = np.abs(wanted) ** 2
        assert error(got, wanted.max(axis=0) if how == "maximum" else wanted) < 2e-15
    assert stop == 9180  # the start of a span
    for start in range(0, 9180, 170):
        twin.update(y[start : start + 170])
    np.testing.assert_array_equal(sliding.update(EMPTY), twin.update(EMPTY))


@pytest.mark.parametrize("frequencies_hz", [np.arange(500.0, 701.0), np.arange(10.0, 4500.0, 60.0), BAND[:1]])
@pytest.mark.parametrize("span", [90, 540])
def test_product_of_low_rank_is_as_exact_as_its_twiddles(frequencies_hz, span):
    half = twiddles(frequencies_hz, np.arange(span // 2) + 0.5, RATE)
    fold, unfold = low_rank(half)
    left = fold[..., : len(unfold)].astype(np.longdouble)
    product = left @ unfold.transpose(1, 0, 2)
    assert np.abs(product - half).max() < 1e-15
    assert len(unfold) <= span // 2 + 1


def test_spike_leaves_no_trace():
    sliding = SlidingDFT([500.0, 612.3], 900, RATE)
    y = stream(1800)
    sliding.update(np.concatenate([y[:450], [[1e12]], y[451:]]))
    got = sliding.update(y[:900])
    fresh = SlidingDFT([500.0, 612.3], 900, RATE).update(y[:900])
    assert error(got, fresh) < 1e-14


@pytest.mark.parametrize("how", ["update", "spectra", "power", "maximum"])
@pytest.mark.parametrize("hann", [False, True])
def test_an_answer_that_is_held_stays_as_it_is(how, hann):
    sliding, y = SlidingDFT(BAND, 300, RATE, 2, hann=hann), stream(900, 2)
    held = [ask(sliding, y[start : start + 90], how, 30)[0] for start in range(0, 450, 90)]
    parts = [answer[-1, 0, 2:5] for answer in held]
    wanted = [answer.copy() for answer in held]
    del held[1:]
    for start in range(450, 900, 90):
        ask(sliding, y[start : start + 90], how, 30)
    np.testing.assert_array_equal(held[0], wanted[0])
    for part, answer in zip(parts, wanted, strict=True):
        np.testing.assert_array_equal(part, answer[-1, 0, 2:5])


def test_what_lasts_does_not_depend_on_the_cutting():
    y = stream(2520, 2)
    sliding, whole = (SlidingDFT([500.0, 612.3], 1000, RATE, 2) for _ in range(2))
    cuts = np.random.default_rng(1).integers(0, 200, 40).cumsum()
    pieces = np.split(y, cuts[cuts < len(y)])
    for piece, how in zip(pieces, np.resize(["update", "power", "maximum", "spectra"], len(pieces)), strict=True):
        ask(sliding, piece, how, 7)
    whole.update(y)
    sliding.update(y[:460])  # to the start of a span: 2980 samples are two windows of eleven spans and a short one
    whole.update(y[:460])
    for _ in range(2):
        np.testing.assert_array_equal(sliding.update(EMPTY), whole.update(EMPTY))


def test_phase_of_a_tone_is_counted_from_the_oldest_sample():
    n = np.arange(5000)
    sliding = SlidingDFT([600.0], 900, RATE)
    got = sliding.update(np.cos(2 * np.pi * 600.0 * n / RATE))
    assert got[0, 0] == pytest.approx(450 * np.exp(2j * np.pi * 600.0 * (5000 - 900) / RATE), rel=1e-12)


def test_hann_silences_far_tones():
    n = np.arange(1800)
    tone = np.cos(2 * np.pi * 1000.3 * n / RATE)
    plain, weighted = (SlidingDFT([600.0], 900, RATE, hann=hann).power(tone, 900)[-1, 0, 0] for hann in (False, True))
    assert weighted < 1e-5 * plain


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


@pytest.mark.parametrize("before", [0, 7, 45, 90, 333, 1000])
def test_state_can_be_copied_and_put_back(before):
    a, b = (SlidingDFT([500.0, 612.3], 300, RATE, 2, hann=True) for _ in range(2))
    y = stream(1500, 2)
    a.spectra(y[:before], 40)  # leaves samples behind that no spectrum has needed yet
    state = a.snapshot()
    wanted = a.spectra(y[before:], 50)
    b.restore(state)
    np.testing.assert_array_equal(b.spectra(y[before:], 50), wanted)
    a.restore(state)
    np.testing.assert_array_equal(a.spectra(y[before:], 50), wanted)
    a.reset()
    fresh = SlidingDFT([500.0, 612.3], 300, RATE, 2, hann=True)
    np.testing.assert_array_equal(a.update(y[:250]), fresh.update(y[:250]))


@pytest.mark.parametrize("duplicate", [copy.deepcopy, lambda thing: pickle.loads(pickle.dumps(thing))])
def test_a_duplicate_goes_its_own_way(duplicate):
    y, sliding = stream(1600, 2), SlidingDFT(np.arange(0.0, 4501.0, 90.0), 100, RATE, 2)
    for how, block in (("update", y[:333]), ("update", y[333:733]), ("power", y[733:900])):
        ask(sliding, block, how, 30)
    twin = duplicate(sliding)
    wanted = sliding.update(y[900:1000]), sliding.update(y[1000:1600]), sliding.update(y[:77])
    got = twin.update(y[900:1000]), twin.update(y[1000:1600]), twin.update(y[:77])
    for one, other in zip(got, wanted, strict=True):
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize(
    "other",
    [{"frequencies_hz": [500.0]}, {"window": 99}, {"hann": True}, {"channels": 1}],
)
def test_a_state_of_something_else_is_refused(other):
    state = SlidingDFT([500.0, 612.3], 100, RATE, 2).snapshot()
    arguments = {"frequencies_hz": [500.0, 612.3], "window": 100, "channels": 2} | other
    with pytest.raises(ValueError, match="state must be of"):
        SlidingDFT(sample_rate_hz=RATE, **arguments).restore(state)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("how", ["update", "spectra", "power", "maximum"])
@pytest.mark.parametrize("hann", [False, True])
def test_a_sample_that_is_not_finite_is_named_and_harms_nothing(bad, how, hann):
    sliding, twin = (SlidingDFT([500.0, 612.3], 100, RATE, 2, hann=hann) for _ in range(2))
    y = stream(300, 2)
    broken = y[150:].copy()
    broken[77, 1] = bad
    for s in (sliding, twin):
        s.update(y[:150])
    with pytest.raises(ValueError, match="sample 227 of the stream.*channel 1"):
        ask(sliding, broken, how, 40)
    np.testing.assert_array_equal(sliding.update(y[150:]), twin.update(y[150:]))


@pytest.mark.parametrize("shape", [(5,), (5, 3), (5, 2, 1), ()])
def test_wrong_shapes_are_refused(shape):
    with pytest.raises(ValueError, match=r"block must be of shape \(n, 2\)"):
        SlidingDFT([500.0], 100, RATE, 2).update(np.zeros(shape))


def test_blocks_of_any_kind_of_memory_are_taken():
    y = np.arange(40).reshape(20, 2)
    fixed = y.astype(float)
    fixed.flags.writeable = False
    wanted = SlidingDFT([500.0], 10, RATE, 2).update(y.astype(float))
    for block in (
        y,
        y.tolist(),
        np.asfortranarray(y, dtype=float),
        fixed,
        y.astype(">f8"),
        np.repeat(y, 2, axis=0)[::2],
    ):
        np.testing.assert_array_equal(SlidingDFT([500.0], 10, RATE, 2).update(block), wanted)


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


TWIN = """
import json, sys
import numpy as np
from chatter import MovingVariance, SlidingDFT
y = np.random.default_rng(0).standard_normal((400, 3))
out = []
for frequencies_hz in ([500.0, 700.0], [500.1, 612.3]):
    sliding = SlidingDFT(frequencies_hz, 180, 9000.0, 3)
    for got in (sliding.update(y[:23]), sliding.power(y[23:140]), sliding.maximum(y[140:160]),
                sliding.spectra(y[160:350], 30), sliding.update(y[350:])):
        out += [float(x) for x in np.abs(got).ravel()]
for window in (7, 16, 90):
    variance = MovingVariance(window, 3)
    out += [float(x) for piece in (y[:23], y[23:140], y[140:]) for x in variance.update(piece).ravel()]
json.dump(out, sys.stdout)
"""


def test_the_interpreter_computes_what_the_compiler_made():
    runs = [
        subprocess.run(
            [sys.executable, "-W", "error", "-c", TWIN],
            env=os.environ | {"NUMBA_DISABLE_JIT": off},
            capture_output=True,
            check=True,
        )
        for off in ("0", "1")
    ]
    compiled, interpreted = (np.array(json.loads(run.stdout)) for run in runs)
    np.testing.assert_allclose(interpreted, compiled, rtol=1e-11, atol=1e-15)


def test_exact_definition_of_the_reference_by_hand():
    y = stream(30, 2)
    one = np.array([ExactDFT([500.0, 612.3], 12, RATE)(row) for row in window_at(y, 7, 12).T])
    np.testing.assert_allclose(spectra(y, [7], [500.0, 612.3], 12, RATE)[0], one, rtol=1e-14)
