"""Confusion matrix of the battery: `python -m tests.chatter.battery FIRST_SEED COUNT [RECIPE ...]`."""

import sys
import time

import numpy as np

from chatter import detect_recording
from tests.chatter.battery.recipes import RECIPES, made
from tests.chatter.battery.score import scored


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
        head = f"{name:24} {int(row[1]):3}/{int(row[0]):3}  freq {int(row[3])}/{int(row[2])}  note {int(row[5])}/{int(row[4])}"
        print(head, "wrong", wrong, flush=True)
    print(f"right {int(total[1])}/{int(total[0])}, freq {int(total[3])}/{int(total[2])}, notes {int(total[5])}/{int(total[4])}, {spent:.0f} s")


main()
