"""What recorders and people do to a recording: clipped, doubled, quantised, humming, a wrong speed."""

from dataclasses import replace

import numpy as np

from tests.chatter.battery import stable, unstable
from tests.chatter.battery.parts import hum, loguniform, rms, seconds


def _any(rng, chatter):
    if chatter:
        return rng.choice([unstable.milling, unstable.turning, unstable.intermittent])(rng)
    return rng.choice([stable.milling, stable.turning, stable.interrupted])(rng)


def _clipped(rng, chatter):
    sample = _any(rng, chatter)
    level = rng.uniform(0.3, 0.8) * np.quantile(np.abs(sample.signal), 0.999)
    return replace(sample, signal=np.clip(sample.signal, -level, level), must_note="clip")


def _doubled(rng, chatter):
    sample = _any(rng, chatter)
    return replace(sample, signal=np.repeat(sample.signal, 2), rate_hz=2.0 * sample.rate_hz, must_note="twice")


def _rough(rng, chatter):
    """Few bits, offset, drift."""
    sample = _any(rng, chatter)
    span = np.abs(sample.signal).max()
    time = seconds(len(sample.signal) / sample.rate_hz + 1.0, sample.rate_hz)[: len(sample.signal)]
    signal = np.round(sample.signal / span * 2.0 ** rng.integers(5, 10))
    return replace(sample, signal=signal + 300.0 + 100.0 * time)


def _humming(rng, chatter):
    sample = _any(rng, chatter)
    time = np.arange(len(sample.signal)) / sample.rate_hz
    return replace(sample, signal=sample.signal + hum(rng, time, loguniform(rng, 0.1, 0.5) * rms(sample.signal)))


def _misled(rng, chatter):
    """The stated speed is wrong by 5 to 40 %."""
    sample = (unstable.milling if chatter else stable.milling)(rng)
    factor = 1.0 + rng.choice([-1, 1]) * rng.uniform(0.05, 0.4)
    return replace(sample, told={"spindle_hz": sample.spindle_hz * factor, "tools": sample.tools}, must_note="stated")


def _make(kind, chatter):
    def recipe(rng):
        return kind(rng, chatter)

    return recipe


RECIPES = {
    f"{name}_{word}": _make(kind, chatter)
    for name, kind in (("clipped", _clipped), ("doubled", _doubled), ("rough", _rough), ("humming", _humming),
                       ("misled", _misled))
    for word, chatter in (("stable", False), ("chatter", True))
}  # fmt: skip
