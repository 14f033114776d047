"""Traces and spectra: every peak survives decimation, the newest win, and any cutting gives the same picture."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from services.dashboard.history import ENVELOPES, PLACE, History, decimate
from services.dashboard.spectra import COLUMNS, FLOOR_DB, STEP_DB, Spectra, levels_db

FORCES = arrays(np.float64, st.integers(1, 60), elements=st.one_of(st.floats(-1e6, 1e6), st.just(np.nan)))


@given(FORCES, st.integers(0, 10**9), st.integers(1, 20))
def test_decimation_keeps_the_extremes_of_each_column_and_nothing_else(values, first, per_column):
    column, least, greatest = decimate(values, first, per_column)
    numbers = (first + np.arange(values.size)) // per_column
    assert column == numbers[0]
    assert least.size == greatest.size == numbers[-1] - numbers[0] + 1
    for k in range(least.size):
        part = values[numbers == column + k]
        known = part[~np.isnan(part)]
        if known.size:
            assert (least[k], greatest[k]) == (known.min(), known.max())
        else:
            assert np.isnan(least[k])
            assert np.isnan(greatest[k])


@given(st.data())
def test_any_cutting_gives_the_same_columns(data):
    values = data.draw(arrays(np.float64, st.integers(1, 80), elements=st.floats(-1e3, 1e3)))
    first, per_column = data.draw(st.integers(0, 500)), data.draw(st.integers(1, 12))
    cuts = sorted(data.draw(st.sets(st.integers(1, max(1, values.size - 1)), max_size=6)) | {0, values.size})
    whole, parts = History(2, 200), History(2, 200)
    column, *ends = decimate(values, first, per_column)
    whole.widen(0, column, *ends)
    for low, high in zip(cuts, cuts[1:], strict=False):
        column, *ends = decimate(values[low:high], first + low, per_column)
        parts.widen(0, column, *ends)
    np.testing.assert_array_equal(whole.since(-1)[1], parts.since(-1)[1])


@given(st.lists(st.tuples(st.integers(0, 60), st.floats(-100, 100, width=32)), max_size=60), st.integers(-1, 70))
def test_the_ring_holds_the_newest_columns(writes, since):
    ring, size = History(1, 8), 8
    kept = {}
    for column, value in writes:
        ring.put(0, column, value)
        head = max([column, *kept])
        if column > head - size:
            kept[column] = value
        kept = {k: v for k, v in kept.items() if k > head - size}
    first, values = ring.since(since)
    assert ring.head == max(kept, default=-1)
    assert values.shape[1] == max(0, ring.head - first + 1)
    for k in range(values.shape[1]):
        expected = kept.get(first + k, np.nan)
        np.testing.assert_equal(values[0, k], np.float32(expected))


def test_a_leap_forward_forgets_what_lies_behind():
    ring = History(1, 8)
    ring.put(0, 3, 1.0)
    ring.put(0, 10**12, 2.0)
    first, values = ring.since(-1)
    assert first == 10**12 - 7
    assert np.isnan(values[0, :-1]).all()
    assert values[0, -1] == 2.0


def test_the_pair_of_an_axis_stands_together():
    assert all(PLACE[high] == PLACE[low] + 1 for low, high in (ENVELOPES[:2], ENVELOPES[2:]))


def reference_level(forces, rate_hz, end, bins, bin_hz):
    """The level by the definition: a direct sum for each bin over the Hann window that ends at a sample."""
    size = round(0.1 * rate_hz)
    part = forces[:, end - size : end]
    taper = 0.5 - 0.5 * np.cos(2 * np.pi * (np.arange(size) + 1) / (size + 1))
    turns = np.exp(-2j * np.pi * bin_hz / rate_hz * np.outer(np.arange(bins), np.arange(size)))
    amplitude = 2.0 * np.abs(turns @ (part * taper).T) / taper.sum()
    return 10 * np.log10((amplitude**2).sum(axis=1) + 1e-12)


@pytest.mark.parametrize("rate_hz", [9000.0, 4000.0])
def test_spectra_are_those_of_the_definition_for_any_cutting(rate_hz):
    rng = np.random.default_rng(5)
    time = np.arange(round(0.5 * rate_hz)) / rate_hz
    forces = 0.3 * rng.standard_normal((2, time.size)) + 8 * np.sin(2 * np.pi * 652 * time)
    spectra = Spectra(rate_hz, 1200.0)
    cuts = np.sort(rng.choice(time.size, 12, replace=False))
    for part in np.split(np.arange(time.size), cuts):
        spectra.update(int(part[0]) if part.size else 0, forces[:, part])
    numbers, data = spectra.since(-1)
    hop = round(0.05 * rate_hz)
    assert numbers == list(range(1, time.size // hop))
    for k, number in enumerate(numbers):
        levels = levels_db(data[k * spectra.bins : (k + 1) * spectra.bins])
        wanted = reference_level(forces, rate_hz, (number + 1) * hop, spectra.bins, spectra.bin_hz)
        assert np.abs(levels - np.clip(wanted, FLOOR_DB, FLOOR_DB + 254 * STEP_DB)).max() <= STEP_DB + 1e-9
        peak = np.argmax(levels) * spectra.bin_hz
        assert abs(peak - 652.0) <= spectra.bin_hz


def test_a_gap_and_a_failed_sensor_leave_holes():
    spectra = Spectra(9000.0, 1200.0)
    ones = np.ones((2, 900))
    spectra.update(0, ones)
    spectra.update(1800, ones)
    spectra.update(2700, np.full((2, 900), np.nan))
    numbers, data = spectra.since(-1)
    assert numbers == [1, 5, 6, 7]
    assert not any(data[3 * spectra.bins :])
    assert spectra.since(5)[0] == [6, 7]


def test_only_the_newest_spectra_are_kept():
    spectra = Spectra(9000.0, 1200.0)
    spectra.update(10**15, np.zeros((2, 450 * (COLUMNS + 20))))
    assert len(spectra.since(-1)[0]) == COLUMNS
