"""What must hold for every recording: properties of the verdict, whatever the numbers."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import resample_poly

from chatter import detect_recording
from tests.chatter.battery.parts import coloured

RATES = (1600.0, 5000.0, 12800.0, 48000.0)
seeds = st.integers(0, 2**32 - 1)


def drawn(seed, rate=10000.0, length=3.0):
    """Tooth passing, noise, and chatter from the middle on or not at all: clear cases of either."""
    rng = np.random.default_rng(seed)
    time = np.arange(round(length * rate)) / rate
    passing = rng.uniform(60.0, 0.1 * rate)
    wave = sum(rng.uniform(0.2, 1.0) * np.sin(2 * np.pi * (k * passing * time + rng.random())) for k in range(1, 5))
    chatters = bool(rng.integers(2))
    line = passing * (rng.integers(1, 4) + rng.uniform(0.2, 0.8))
    wave = wave + 3.0 * chatters * (time > 0.5 * length) * np.sin(2 * np.pi * line * time)
    return wave + 0.2 * rng.normal(size=time.size), "chatter" if chatters else "stable", passing


@given(seeds, st.floats(-150.0, 150.0))
@settings(max_examples=15)
def test_scale_and_sign_leave_the_verdict(seed, exponent):
    signal, truth, passing = drawn(seed)
    one = detect_recording(signal, 10000.0, spindle_hz=passing, tools=1)
    other = detect_recording(-(10.0**exponent) * signal, 10000.0, spindle_hz=passing, tools=1)
    assert one.verdict == other.verdict == truth
    assert [(e.start, e.end, e.kind) for e in one.events] == [(e.start, e.end, e.kind) for e in other.events]


@given(seeds, st.sampled_from([(2, 1), (3, 2), (4, 5), (4, 1)]))
@settings(max_examples=15)
def test_resampling_leaves_the_verdict(seed, ratio):
    signal, truth, passing = drawn(seed)
    up, down = ratio
    found = detect_recording(resample_poly(signal, up, down), 10000.0 * up / down, spindle_hz=passing, tools=1)
    assert found.verdict == truth


@given(seeds, st.integers(2, 4))
@settings(max_examples=10)
def test_the_same_channel_again_tells_nothing_new(seed, channels):
    signal, truth, passing = drawn(seed)
    one = detect_recording(signal, 10000.0, spindle_hz=passing)
    many = detect_recording(np.stack([signal] * channels, axis=1), 10000.0, spindle_hz=passing)
    assert one.verdict == many.verdict == truth
    assert [(e.start, e.end, e.kind) for e in one.events] == [(e.start, e.end, e.kind) for e in many.events]


@given(seeds, st.integers(2, 5))
@settings(max_examples=10)
def test_values_stored_several_times_leave_the_verdict_and_are_said(seed, times):
    signal, truth, passing = drawn(seed)
    found = detect_recording(np.repeat(signal, times), 10000.0 * times, spindle_hz=passing)
    assert found.verdict == truth
    assert found.events == detect_recording(signal, 10000.0, spindle_hz=passing).events
    assert any("every value is stored" in note for note in found.notes)


@given(seeds, st.sampled_from(RATES), st.floats(-0.5, 2.0), st.sampled_from([1.0, 2.5]), st.integers(1, 2))
@settings(max_examples=30)
def test_noise_of_any_colour_never_chatters(seed, rate, slope, length, channels):
    rng = np.random.default_rng(seed)
    signal = np.stack([coloured(rng, round(length * rate), slope) for _ in range(channels)], axis=1)
    assert detect_recording(signal, rate).verdict == "stable"


@given(st.floats(-1e6, 1e6), st.sampled_from(RATES))
@settings(max_examples=5)
def test_silence_never_chatters(value, rate):
    found = detect_recording(np.full(round(rate), value), rate)
    assert (found.verdict, found.events) == ("stable", ())
    assert any("constant" in note for note in found.notes)


@given(seeds, st.sampled_from(RATES), st.integers(1, 8), st.integers(1, 5), st.booleans())
@settings(max_examples=40)
def test_harmonics_of_tooth_passing_never_chatter_when_the_speed_is_stated(seed, rate, number, tools, begins):
    """Any of the first twelve, as strong as they like, a stated speed that is wrong by 0.05 %."""
    rng = np.random.default_rng(seed)
    passing = rng.uniform(40.0, 0.1 * rate)
    time = np.arange(round(3.0 * rate)) / rate
    orders = rng.choice(np.arange(1, min(int(0.45 * rate / passing), 12) + 1), number)
    wave = sum(
        rng.uniform(0.1, 3.0) * np.sin(2 * np.pi * (k * passing * time + rng.random())) for k in np.unique(orders)
    )
    wave = wave * (time > 1.0 if begins else 1.0) + rng.uniform(0.01, 0.5) * rng.normal(size=time.size)
    found = detect_recording(wave, rate, spindle_hz=passing / tools * (1.0 + rng.normal(0.0, 5e-4)), tools=tools)
    assert found.verdict == "stable"


@pytest.mark.parametrize("steps", [-3.0, 0.0, 3.0])
def test_more_sensitive_finds_what_less_sensitive_found(steps):
    time = np.arange(40000) / 10000.0
    noise = np.random.default_rng(5).normal(size=time.size)
    faint = [
        detect_recording(noise + size * (time > 2.0) * np.sin(2 * np.pi * 651.0 * time), 10000.0, sensitivity=steps)
        for size in (0.3, 0.5, 0.8, 1.2, 2.0, 4.0)
    ]
    found = [v.verdict == "chatter" for v in faint]
    assert found == sorted(found), "what is louder is found at the same setting"
    assert sum(found) >= {-3.0: 1, 0.0: 3, 3.0: 4}[steps]
