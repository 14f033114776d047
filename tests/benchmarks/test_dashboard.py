"""Prints what the server of the page takes of a core; the share is for people, only the shape is checked."""

import sys

import pytest

from services.bench.dashboard import measure
from services.cli.bench import table_of

pytestmark = pytest.mark.system


def test_what_the_page_costs():
    rows = measure()
    sys.stdout.write(f"\n{table_of(rows)}\n")
    assert len(rows) == 5
    assert all(row["ours"] > 0 for row in rows)
