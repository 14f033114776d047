"""What a verdict is worth."""

import numpy as np

from tests.chatter.battery.parts import Sample


def on_family(sample: Sample, frequency_hz: float) -> bool:
    """Return whether a frequency is a line of the chatter, its sideband at the spindle, or a harmonic of it."""
    slack = 0.005 * frequency_hz + 1.0
    for line in sample.frequencies_hz:
        for harmonic in (1, 2, 3):
            away = frequency_hz - harmonic * line
            if abs(away) <= slack:
                return True
            if sample.spindle_hz and sample.tools:
                tooth = sample.spindle_hz * sample.tools
                for sign in (1.0, -1.0):
                    away = frequency_hz - sign * harmonic * line
                    if abs(away - tooth * round(away / tooth)) <= min(slack, 0.1 * tooth):
                        return True
    return False


def scored(sample: Sample, verdict) -> np.ndarray:
    """Return cases, right verdicts, chatter found, of those at a right frequency, notes wanted, notes there."""
    right = verdict.verdict == sample.truth
    found = [e for e in verdict.events if e.kind == "regenerative"]
    hit = right and bool(found)
    longest = max(found, key=lambda e: e.end - e.start, default=None)
    good = hit and longest is not None and on_family(sample, longest.frequency_hz)
    note = any(sample.must_note in n for n in verdict.notes)
    return np.array([1, right, hit, good, bool(sample.must_note), bool(sample.must_note) and note], dtype=float)
