"""Prints the table of transport; the ratios are for people, only the shape is checked."""

import sys

import pytest

from services.bench.transport import measure
from services.cli.bench import table_of

pytestmark = pytest.mark.system


def test_transport_beside_bare_zenoh_and_a_bare_socket():
    rows = measure(blocks=300, loop_s=4.0)
    sys.stdout.write(f"\n{table_of(rows)}\n")
    assert len(rows) == 8
    assert all({*row} == {"case", "ours", "peer", "ratio", "unit"} and row["ratio"] > 0 for row in rows)
