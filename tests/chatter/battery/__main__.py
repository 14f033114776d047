"""Confusion matrix of the battery: `python -m tests.chatter.battery FIRST_SEED COUNT [RECIPE ...]`."""

import sys
import time

import numpy as np

from chatter import detect_recording
from tests.chatter.battery.recipes import RECIPES, made
from tests.chatter.battery.score import scored

WORDS = ("right", "frequency", "notes")


def main() -> None:
    first, count = int(sys.argv[1]), int(sys.argv[2])
    names = [n for n in RECIPES if not sys.argv[3:] or any(part in n for part in sys.argv[3:])]
    total = np.zeros(6)
    spent = 0.0
    for name in names:
        row, wrong = np.zeros(6), []
        for seed in range(first, first + count):
            sample = made(name, seed)
            begin = time.perf_counter()
            verdict = detect_recording(sample.signal, sample.rate_hz, **sample.told)
            spent += time.perf_counter() - begin
            result = scored(sample, verdict)
            row += result
            if not result[1]:
                wrong.append(seed)
        total += row
        sys.stdout.write(f"{name:24} {_said(row)} {'wrong ' + str(wrong) if wrong else ''}\n")
        sys.stdout.flush()
    sys.stdout.write(f"{'all':24} {_said(total)} in {spent:.0f} s\n")


def _said(row: np.ndarray) -> str:
    counts = (f"{word} {good:.0f}/{cases:.0f}" for word, (cases, good) in zip(WORDS, row.reshape(3, 2), strict=True))
    return ", ".join(counts)


main()
