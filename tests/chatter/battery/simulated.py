"""Recordings of simulated cuts, stable or not as the simulation says."""

from dataclasses import replace

import numpy as np

from tests.chatter.battery.cutting import RUNAWAY, Cut, march, resampled, sense, truth
from tests.chatter.battery.parts import Sample, coloured, loguniform, rms, room, seconds, wandering
from tests.chatter.battery.stable import _rate, _told

CLEAR, CLEAN = 0.2, 1e-5
"""Energy off the repetition over that on it, from which a cut chatters, and below which it does not."""
VISIBLE = 0.1
"""Part of the energy that lies within 2 % of the line, from which a recording shows the chatter that is in it."""


def _part(signal, rate, line):
    power = np.abs(np.fft.rfft((signal - signal.mean()) * np.hanning(len(signal)))) ** 2
    frequency = np.fft.rfftfreq(len(signal), 1.0 / rate)
    return float(power[np.abs(frequency - line) <= 0.02 * line].sum() / power.sum())


def _modes(rng, first_hz, highest):
    modes = [(first_hz, loguniform(rng, 0.008, 0.05), 1.0, rng.uniform(0.0, 3.1))]
    for _ in range(rng.integers(1, 3)):
        modes.append((min(loguniform(rng, 0.6, 3.0) * first_hz, highest), loguniform(rng, 0.01, 0.05),
                      loguniform(rng, 1.0, 5.0), rng.uniform(0.0, 3.1)))  # fmt: skip
    return tuple(modes)


def _flip(rng, rate):
    """Low immersion, tooth passing near a half-odd part of the mode, and an odd number of teeth.

    With an even number the doubled period is that of the spindle: no spectrum tells it from run-out.
    """
    cut = _milling(rng, rate, teeth=int(rng.choice([1, 3])), passes=rng.integers(1, 4) - 0.5 - rng.uniform(0.02, 0.3))
    arc = float(np.arccos(1.0 - 2.0 * rng.choice([0.03, 0.05, 0.1])))
    begin, end = (0.0, arc) if rng.random() < 0.5 else (np.pi - arc, np.pi)
    return replace(cut, begin=begin, end=end, modes=cut.modes[:1], stiffness=loguniform(rng, 0.1, 5.0))


def _milling(rng, rate, teeth=None, passes=None):
    while True:
        first = loguniform(rng, 150.0, min(2500.0, 0.3 * rate))
        teeth = teeth or int(rng.integers(1, 7))
        spindle = first / (passes or rng.uniform(0.6, 14.0)) / teeth
        if 8.0 <= spindle <= (333.0 if passes is None else 800.0):
            break
    immersion = rng.choice([0.05, 0.1, 0.25, 0.5, 1.0])
    modes = _modes(rng, first, 0.4 * rate)
    arc = float(np.arccos(1.0 - 2.0 * immersion))
    begin, end = (0.0, arc) if rng.random() < 0.5 else (np.pi - arc, np.pi)
    return Cut(
        spindle_hz=spindle, teeth=teeth, begin=begin, end=end, modes=modes,
        stiffness=2.0 * modes[0][1] * loguniform(rng, 0.3, 6.0) * max(2.0 * np.pi / (arc * teeth), 1.0),
        normal=rng.uniform(0.2, 0.6), noise=loguniform(rng, 0.01, 0.1),
        runout=tuple(rng.choice([0.0, 0.05, 0.3]) * rng.normal(size=teeth)), seconds=rng.uniform(2.0, 6.0),
        entry=rng.choice([0.0, 0.6]), seed=int(rng.integers(1 << 30)),
    )  # fmt: skip


def _turning(rng, rate):
    first = loguniform(rng, 110.0, min(1500.0, 0.3 * rate))
    modes = tuple((f, z, k, rng.uniform(-0.8, 0.8)) for f, z, k, _ in _modes(rng, first, 0.4 * rate))
    return Cut(
        spindle_hz=loguniform(rng, 4.0, 40.0), teeth=1, begin=0.0, end=2 * np.pi, stiffness=loguniform(rng, 0.01, 0.5),
        modes=modes, noise=loguniform(rng, 0.03, 0.2), seconds=rng.uniform(2.0, 6.0), entry=rng.choice([0.0, 0.6]),
        seed=int(rng.integers(1 << 30)),
    )  # fmt: skip


def simulated(rng, draw, wanted, flip=False):
    """Draw cuts until one is clearly what is wanted, and record it."""
    rate = _rate(rng, 1600.0 if draw is _turning else 4000.0)
    sensor = str(rng.choice(["displacement", "force", "velocity", "acceleration", "sound", "acceleration", "sound"]))
    seen = "acceleration" if sensor == "sound" else sensor
    while True:
        cut = draw(rng, rate)
        by_turn, by_tooth, line = truth(cut, seen)
        odd = abs(line / (cut.spindle_hz * cut.teeth) % 1.0 - 0.5) < 0.01
        if wanted == "stable" and by_turn < CLEAN and by_tooth < CLEAN:
            break
        seeable = 105.0 < line < min(0.38 * rate, 4700.0)
        if wanted == "chatter" and by_turn > CLEAR and by_tooth > CLEAR and seeable and odd == flip:
            break
    motion = march(cut)
    if not np.abs(motion).max() < RUNAWAY:
        return simulated(rng, draw, wanted, flip)
    signal = sense(motion, seen, cut.rate)
    if wanted == "chatter" and _part(signal[len(signal) // 2 :], cut.rate, line) < VISIBLE:
        return simulated(rng, draw, wanted, flip)
    time = seconds(cut.seconds, rate)
    still = wandering(rng, time, cut.spindle_hz, rng.choice([0.0, 3e-4]), 0.5) / cut.spindle_hz - time
    wave = resampled(signal, cut.rate, rate, cut.seconds, still)
    wave /= rms(wave - wave.mean())
    if sensor == "sound":
        wave = room(rng, wave, rate)
        wave /= rms(wave)
    wave += loguniform(rng, 0.01, 0.3) * coloured(rng, len(wave), rng.uniform(0.0, 1.5))
    return Sample(
        signal=wave, rate_hz=rate, truth=wanted, frequencies_hz=(line,) if wanted == "chatter" else (),
        spindle_hz=cut.spindle_hz, tools=cut.teeth,
        told=_told(rng, cut.spindle_hz, cut.teeth, int(rng.integers(1, 3)) if flip else None),
    )  # fmt: skip


def sim_milling_stable(rng):
    return simulated(rng, _milling, "stable")


def sim_milling_chatter(rng):
    return simulated(rng, _milling, "chatter")


def sim_milling_flip(rng):
    return simulated(rng, _flip, "chatter", flip=True)


def sim_turning_stable(rng):
    return simulated(rng, _turning, "stable")


def sim_turning_chatter(rng):
    return simulated(rng, _turning, "chatter")
