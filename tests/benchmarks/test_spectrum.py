"""Prints the tables of the sliding spectrum and of the moving variance; the speeds are for people, errors are held."""

import sys

from services.bench import spectrum, variance
from services.cli.bench import table_of

KEYS = {"case", "ours", "peer", "ratio", "unit"}


def test_the_sliding_spectrum_beside_its_peers():
    rows = spectrum.measure()
    sys.stdout.write(f"\n{table_of(rows)}\n")
    errors = [row["ours"] for row in rows if row["unit"] == spectrum.ERROR]
    assert len(errors) == 3
    assert max(errors) < 1e-15
    assert all({*row} == KEYS for row in rows)


def test_the_moving_variance_beside_its_peers():
    rows = variance.measure()
    sys.stdout.write(f"\n{table_of(rows)}\n")
    errors = [row["ours"] for row in rows if row["unit"] == variance.ERROR]
    assert len(errors) == 3 * len(variance.peers())
    assert max(errors) < 1e-13
    assert all({*row} == KEYS for row in rows)
