"""Prints the tables of the delay equation and of the loop; the ratios are for people, only the errors are checked."""

import sys

from services.bench import delay, loop
from services.cli.bench import table_of


def test_the_delay_equation_beside_its_peers():
    rows = delay.measure()
    sys.stdout.write(f"\n{table_of(rows)}\n")
    errors = {row["case"]: row for row in rows if row["case"].endswith(": error")}
    assert len(errors) >= 7
    assert all(row["ours"] < 1e-8 and row["ours"] < row["peer"] for row in errors.values())


def test_the_loop_beside_real_time():
    rows = loop.measure()
    sys.stdout.write(f"\n{table_of(rows)}\n")
    assert len(rows) == 2
