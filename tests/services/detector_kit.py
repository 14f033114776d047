"""Streams made by hand, of which the truth is known without a simulator."""

import dataclasses

import numpy as np

from services.bench.detector.draw import Process
from services.bench.detector.stream import Stream
from services.config import load_case

RATE_HZ = 9000.0
ENTRY_S = 1.0


def process(**changes):
    """Cut of `thesis-652`, judged at 3.75 um in 489...815 Hz."""
    case = load_case("thesis-652")
    usual = {
        "case": case, "turret": "thesis-652", "axes": "both", "seed": 1, "growth": 30.0, "chatter_hz": 652.0,
        "rival_hz": 689.0, "believed_force": 4.0,
    }  # fmt: skip
    return Process(**(usual | changes))


def growing(growth, *, hertz=652.0, crossing_s=1.5, duration_s=3.0, ceiling=20.0):
    """Return a line that passes 1 at `crossing_s` and grows up to a ceiling, shape (n,)."""
    time = np.arange(round(duration_s * RATE_HZ)) / RATE_HZ
    return np.minimum(np.exp(growth * (time - crossing_s)), ceiling) * np.sin(2.0 * np.pi * hertz * time)


def stream(*, vibration=None, force=None, noise=0.2, judged_s=ENTRY_S + 0.05, of=None, spindle_hz=20.0, duration_s=3.0):
    """Return a stream whose tools enter after a second; noise in the force at all times (N rms)."""
    made = process() if of is None else of
    count = round(duration_s * RATE_HZ)
    rng = np.random.default_rng(5)
    blocks = np.arange(count // 90)
    pushed = noise * rng.standard_normal((count, 2))
    if force is not None:
        pushed += force
    return Stream(
        process=made,
        rate=RATE_HZ,
        force=pushed,
        latency=0.0,
        engaged=blocks * 0.01 >= ENTRY_S - 1e-9,
        spindle_hz=np.full(blocks.size, spindle_hz),
        turned=spindle_hz * np.arange(count) / RATE_HZ,
        vibration=np.zeros(count) if vibration is None else vibration,
        entry=round(ENTRY_S * RATE_HZ),
        begin=round(ENTRY_S * RATE_HZ),
        judged=round(judged_s * RATE_HZ),
    )


def listening_to(axes):
    return dataclasses.replace(process(), axes=axes)
