"""Recordings that nobody has seen: made here, from what chatter, tooth passing and noise are."""

import numpy as np
import pytest

from chatter import detect_recording
from tests.chatter.signals import growing

RATE = 12000.0
TOOTH = 200.0


def seconds(length, rate=RATE):
    return np.arange(round(length * rate)) / rate


def tone(time, frequency, amplitude=1.0, phase=0.0):
    return amplitude * np.sin(2.0 * np.pi * frequency * time + phase)


def teeth(time, amplitudes=(1.0, 0.6, 0.4, 0.3, 0.2), runout=0.2):
    wave = sum(tone(time, TOOTH * (k + 1), a, k) for k, a in enumerate(amplitudes))
    return wave + sum(tone(time, 0.25 * TOOTH * k, runout, k * k) for k in (1, 2, 3, 5, 6, 7, 9))


def chatter(time, frequency=1067.0):
    sidebands = sum(tone(time, frequency + k * TOOTH, a) for k, a in ((1, 0.25), (-1, 0.25), (-2, 0.15)))
    return tone(time, frequency) + sidebands + tone(time, 2.0 * frequency, 0.2)


def background(time, level=0.05, seed=0, rate_tones=()):
    rng = np.random.default_rng(seed)
    return level * rng.normal(size=time.size) + sum((tone(time, f, a) for f, a in rate_tones), np.zeros(time.size))


def within(time, start, end):
    return (time >= start) & (time < end)


def milling(length=8.0, start=1.0, end=7.0, chatter_size=0.0, begin=3.0, stop=6.0, seed=0):
    time = seconds(length)
    wave = within(time, start, end) * teeth(time) + chatter_size * within(time, begin, stop) * chatter(time)
    return wave + background(time, seed=seed)


def regenerative(verdict):
    return [e for e in verdict.events if e.kind == "regenerative"]


def is_one(verdict, frequency, start, end, slack=0.15):
    found = regenerative(verdict)
    assert verdict.verdict == "chatter"
    assert len(found) == 1
    assert found[0].frequency_hz == pytest.approx(frequency, abs=1.0)
    assert found[0].start == pytest.approx(start, abs=slack)
    assert found[0].end == pytest.approx(end, abs=slack)


@pytest.mark.parametrize("noise", [0.1, 0.5, 1.0])
@pytest.mark.parametrize("band_hz", [None, (500.0, 750.0)])
def test_a_line_that_begins_is_one_episode(noise, band_hz):
    time = seconds(8.0, 9000.0)
    signal = background(time, noise, 1) + within(time, 3.42, 9.0) * tone(time, 651.0)
    is_one(detect_recording(signal, 9000.0, band_hz=band_hz), 651.0, 3.42, 8.0)


def test_chatter_that_grows_on_a_force_with_an_offset():
    signal = growing(6.0, 2.0, 651.0, 30.0, 0.02, 8.0, 9000.0)
    time = seconds(6.0, 9000.0)
    signal = signal + background(time, 0.5, 2) + 300.0 + tone(time, 20.0, 50.0)
    is_one(detect_recording(signal, 9000.0), 651.0, 2.12, 6.0)
    is_one(detect_recording(signal, 9000.0, spindle_hz=20.0, tools=2), 651.0, 2.12, 6.0, 0.3)


@pytest.mark.parametrize("scale", [1e-200, 1e-4, 1.0, 1e4, 1e200])
def test_the_scale_does_not_matter(scale):
    one = detect_recording(milling(chatter_size=2.0), RATE)
    other = detect_recording(scale * milling(chatter_size=2.0), RATE)
    assert [e.kind for e in one.events] == [e.kind for e in other.events]
    for a, b in zip(one.events, other.events, strict=True):
        assert (a.start, a.end) == pytest.approx((b.start, b.end))
        assert a.frequency_hz == pytest.approx(b.frequency_hz)


@pytest.mark.parametrize("speed", [None, 50.0])
@pytest.mark.parametrize("size", [0.5, 1.0, 2.0])
def test_chatter_over_tooth_passing_is_one_episode_without_its_sidebands(size, speed):
    is_one(detect_recording(milling(chatter_size=size), RATE, spindle_hz=speed, tools=4), 1067.0, 3.0, 6.0)


@pytest.mark.parametrize("speed", [None, 50.0])
@pytest.mark.parametrize(("start", "end"), [(1.0, 7.0), (-1.0, 9.0)])
def test_tooth_passing_alone_is_stable(start, end, speed):
    verdict = detect_recording(milling(start=start, end=end), RATE, spindle_hz=speed, tools=4)
    assert verdict.verdict == "stable"
    assert regenerative(verdict) == []


@pytest.mark.parametrize("drift", [0.001, 0.03])
def test_a_speed_that_drifts_is_still_forced(drift):
    time = seconds(8.0)
    signal = within(time, 1.0, 7.0) * teeth(time * (1.0 - drift * time / 8.0)) + background(time)
    assert detect_recording(signal, RATE, spindle_hz=50.0, tools=4).verdict == "stable"


def test_tones_that_were_there_before_do_not_count():
    time = seconds(8.0)
    signal = milling() + background(time, 0.0, rate_tones=((1333.0, 0.5), (2770.0, 0.3), (871.0, 0.4)))
    assert detect_recording(signal, RATE, spindle_hz=50.0, tools=4).verdict == "stable"
    signal += within(time, 3.0, 6.0) * chatter(time) * 2.0
    is_one(detect_recording(signal, RATE, spindle_hz=50.0, tools=4), 1067.0, 3.0, 6.0)


def test_chatter_from_the_first_sample_to_the_last():
    time = seconds(4.0)
    is_one(detect_recording(chatter(time) + background(time, 0.2), RATE), 1067.0, 0.0, 4.0)


def test_two_stretches_are_two_episodes():
    time = seconds(10.0)
    signal = background(time, 0.2) + (within(time, 2.0, 4.0) | within(time, 6.0, 8.5)) * tone(time, 651.0)
    found = regenerative(detect_recording(signal, RATE))
    assert [(round(e.start, 1), round(e.end, 1)) for e in found] == [(2.0, 4.0), (6.0, 8.5)]


def test_a_hop_stays_one_episode_at_its_stronger_line():
    time = seconds(9.0)
    signal = background(time, 0.2) + within(time, 2.0, 4.0) * tone(time, 651.0)
    is_one(detect_recording(signal + within(time, 4.0, 9.0) * tone(time, 612.0), RATE), 612.0, 2.0, 9.0)


@pytest.mark.parametrize("decay", [90, 400])
def test_a_knock_is_not_chatter(decay):
    signal = background(seconds(6.0), 0.1, 3)
    index = np.arange(9000)
    signal[30000:39000] += 20.0 * np.exp(-index / decay) * np.sin(2.0 * np.pi * 700.0 * index / RATE)
    assert detect_recording(signal, RATE).verdict == "stable"


@pytest.mark.parametrize("seed", range(5))
def test_noise_is_stable(seed):
    rng = np.random.default_rng(seed)
    signal = np.cumsum(rng.normal(size=60000)) if seed == 4 else rng.normal(size=(60000, 1 + seed % 2))
    assert detect_recording(signal, RATE).verdict == "stable"


@pytest.mark.parametrize("value", [0.0, 3.7, -1e300])
def test_silence_is_stable(value):
    assert detect_recording(np.full(30000, value), RATE).verdict == "stable"


def test_a_clipped_recording_and_one_with_holes_keep_their_verdict():
    signal = milling(chatter_size=2.0)
    is_one(detect_recording(np.clip(signal, -1.5, 1.5), RATE, spindle_hz=50.0), 1067.0, 3.0, 6.0)
    signal[54000:54003] = np.nan
    verdict = detect_recording(signal, RATE, spindle_hz=50.0)
    is_one(verdict, 1067.0, 3.0, 6.0)
    assert any("3 samples" in note for note in verdict.notes)


@pytest.mark.parametrize("rate", [8000.0, 11025.0, 22050.0, 44100.0, 48000.0])
def test_the_rate_does_not_matter(rate):
    time = seconds(6.0, rate)
    signal = within(time, 1.0, 5.5) * teeth(time) + 2.0 * within(time, 3.0, 5.0) * chatter(time) + background(time)
    is_one(detect_recording(signal, rate, spindle_hz=50.0, tools=4), 1067.0, 3.0, 5.0)


def test_what_cannot_be_seen_is_refused_with_a_reason():
    slow = detect_recording(np.zeros(2500), 250.0, band_hz=(500.0, 750.0))
    assert (slow.verdict, slow.reason) == (None, "sampled at 250 Hz, cannot see 500..750 Hz")
    assert "250 Hz" in (detect_recording(np.zeros(2500), 250.0).reason or "")
    assert "at least 0.2 s" in (detect_recording(np.zeros(100), RATE).reason or "")
    assert "at least 0.2 s" in (detect_recording(np.zeros(0), RATE).reason or "")
    assert detect_recording(np.full(30000, np.nan), RATE).reason == "holds no finite sample"


@pytest.mark.parametrize(
    ("arguments", "name"),
    [
        ({"sample_rate_hz": 0.0}, "sample_rate_hz"), ({"sample_rate_hz": np.nan}, "sample_rate_hz"),
        ({"band_hz": (700.0, 600.0)}, "band_hz"), ({"band_hz": (-1.0, 600.0)}, "band_hz"),
        ({"band_hz": (np.nan, 600.0)}, "band_hz"), ({"spindle_hz": -3.0}, "spindle_hz"), ({"tools": -1}, "tools"),
    ],
)  # fmt: skip
def test_bad_arguments_are_named(arguments, name):
    with pytest.raises(ValueError, match=name):
        detect_recording(np.zeros(30000), **{"sample_rate_hz": RATE, **arguments})


def test_bad_signals_are_named():
    for signal in (np.zeros((3, 3, 3)), np.zeros((100, 0)), np.array(["a"] * 30000), np.zeros(30000, dtype=complex)):
        with pytest.raises(ValueError, match="signal must be"):
            detect_recording(signal, RATE)
