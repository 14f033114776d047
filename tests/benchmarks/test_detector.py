"""Prints the table of the detector, short form; the numbers are for people, only the shape is checked."""

import os
import sys

from services.bench.detector.measure import SHORT, measure
from services.cli.bench import table_of


def test_the_detector_beside_its_rivals():
    outcome = measure(SHORT, seed=1, workers=os.cpu_count() or 1, out=None, progress=lambda _: None)
    sys.stdout.write(f"\n{table_of(outcome.rows)}\n")
    assert outcome.numbers["onsets"] > 0.9 * SHORT.onsets
    assert all({*row} == {"case", "ours", "peer", "ratio", "unit"} for row in outcome.rows)
