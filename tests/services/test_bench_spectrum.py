"""The benchmark of spectrum and variance: its peers compute the same, and what is missing is said; speed is no test."""

import numpy as np
import pytest

from chatter import SlidingDFT
from services.bench import _spectrum_kernels as kernels
from services.bench import peers, spectrum, variance
from services.cli.bench import table_of


def test_the_recursions_compute_the_spectrum_they_are_measured_beside():
    y = np.random.default_rng(2).standard_normal(300)
    band, window = np.array([500.0, 600.0, 700.0]), 90
    ours = SlidingDFT(band, window, 9000.0).power(y)[:, 0]
    for way in (kernels.recursion, spectrum._recursion):
        power = np.empty((300, 3))
        way(y, np.zeros(window), 0, np.zeros(3, complex), np.exp(2j * np.pi * band / 9000.0), power)
        np.testing.assert_allclose(power, ours, rtol=0, atol=1e-10)


def test_the_error_is_that_of_the_last_window():
    rows = spectrum.error_rows(2_000_000)
    assert [row["case"].split(",")[0] for row in rows] == [f"error after {n:.0e} samples" for n in (2e4, 2e5, 2e6)]
    assert all(row["ours"] < 1e-15 < row["peer"] for row in rows)


@pytest.mark.parametrize("there", [False, True])
def test_a_peer_that_is_not_there_is_said_to_be_missing(there, monkeypatch):
    if not there:
        monkeypatch.setattr(variance, "installed", lambda _: None)
    stream = variance.MEAN + np.random.default_rng(3).standard_normal(2000)
    rows = variance.error_rows(stream, 90)
    missing = [row for row in rows if "(not installed)" in row["case"]]
    assert len(rows) == len(variance.peers())
    assert len(missing) == (sum(peer is None for peer in variance.peers().values()))
    assert all(row["peer"] is None and row["ratio"] is None for row in missing)
    assert all(row["ours"] < 1e-13 for row in rows)
    assert "-  largest relative error" in table_of(rows) or not missing


def test_rows_are_times_of_a_unit():
    calls = []
    ours = peers.Way(lambda: calls.append("ours"), 10.0)
    rows = peers.beside("case", ours, {"one": peers.Way(lambda: calls.append("one"), 5.0), "two": None}, 3, 1e9, "ns")
    assert calls == ["ours", "one"] * 4
    assert [row["case"] for row in rows] == ["case, beside one", "case, beside two (not installed)"]
    assert rows[0]["ratio"] == rows[0]["ours"] / rows[0]["peer"]
    assert rows[1]["peer"] is None
