"""The monitor as the loop uses it: one estimate for each block, any cutting, gaps, bad samples, noise and chatter."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from chatter import ChatterMonitor, MonitorConfig
from tests.chatter.signals import RATE, end, growing, noise, resonance, steps

CONFIG = MonitorConfig(band_hz=(500.0, 750.0), expected_limit=4.0, tools=2)
ENTRY = 1.0


def monitor(config=CONFIG, channels=2):
    return ChatterMonitor(config, RATE, channels)


def after(seconds):
    return lambda now: now >= seconds


def chattering(seed=0, lines=((651.0, 30.0),), seconds=1.6, first=0.15):
    """Air, an entry with a step of force, and lines that grow out of noise to the force of a limit cycle."""
    rng = np.random.default_rng(seed)
    signal = noise(rng, seconds, 0.35)
    for k, (frequency, growth) in enumerate(lines):
        wave = growing(seconds, ENTRY, frequency, growth, first, 30.0, phase=seed + k)
        signal += wave[:, None] * [1.0, 1.36]
    signal[round(ENTRY * RATE) :] += [63.0, 85.0]
    return signal


def agree(one, other):
    for a, b in zip(one, other, strict=True):
        same(dataclasses.asdict(a), dataclasses.asdict(b))


def same(one, other, name=""):
    if isinstance(one, dict):
        for key, value in one.items():
            same(value, other[key], key)
    elif isinstance(one, tuple):
        for a, b in zip(one, other, strict=True):
            same(a, b, name)
    elif isinstance(one, float):
        assert other == pytest.approx(one, rel=1e-11, abs=1e-11), name
    else:
        assert other == one, name


WHOLE = chattering(seconds=1.3)
REFERENCE = steps(monitor(), WHOLE, in_cut=lambda _: True)


@settings(max_examples=15)
@given(st.lists(st.integers(0, 11700), max_size=12))
def test_any_cutting_gives_the_same_estimates(cuts):
    parts, out, first = np.split(WHOLE, sorted(cuts)), [], 0
    streaming = monitor()
    for part in parts:
        out += streaming.process(part, first, in_cut=True)
        first += len(part)
    agree(REFERENCE, out)


def test_one_estimate_for_each_block_of_the_grid():
    out = monitor().process(np.zeros((450, 2)), 90)
    assert [e.first_sample for e in out] == [90, 180, 270, 360, 450]
    assert {e.samples for e in out} == {90}
    assert {e.gap for e in out} == {0}


@pytest.mark.parametrize("seed", range(6))
def test_growing_chatter_is_found_in_time_and_at_its_frequency(seed):
    signal = chattering(seed, lines=((651.0, 30.0), (613.5, 26.0), (688.0, 26.0)))
    out = steps(monitor(), signal, in_cut=after(ENTRY), spindle_hz=20.0)
    first = next(e for e in out if e.state == "chatter")
    passes = ENTRY + np.log(4.0 / 0.15) / 30.0  # one line alone reaches the expected amplitude
    assert end(first) - passes < 0.1
    assert min(abs(first.frequency_hz - f) for f in (651.0, 613.5, 688.0)) < 3.0
    assert first.kind == "regenerative"
    assert first.limit_source == "configured"
    assert first.growth > 5.0
    assert all(e.state in ("idle", "learning") for e in out if end(e) <= ENTRY)
    assert out[-1].state == "chatter"


def test_frequency_is_refined_far_below_a_bin():
    signal = chattering(3, lines=((651.37, 30.0),), seconds=2.6)
    last = steps(monitor(), signal, in_cut=after(ENTRY))[-1]
    assert last.span >= 0.5
    assert abs(last.frequency_hz - 651.37) < 0.05
    assert 0.6 < last.confidence <= 0.7  # without the spindle speed it is less sure
    assert "speed_unknown" in last.notes
    sure = steps(monitor(), signal, in_cut=after(ENTRY), spindle_hz=20.0)[-1]
    assert sure.confidence > 0.9


def test_quiet_cut_raises_no_alarm_and_its_limits_are_learned():
    rng = np.random.default_rng(7)
    signal = noise(rng, 20.0, 0.35)
    cut = round(ENTRY * RATE)
    signal[cut:] += resonance(rng, 19.0, 450.0, 0.17, 2.0) + [63.0, 85.0]
    out = steps(monitor(), signal, in_cut=after(ENTRY), spindle_hz=20.0)
    assert not any(e.state == "chatter" for e in out)
    assert {e.limit_source for e in out if end(e) > 3.0} == {"cutting"}
    assert sum(e.state == "suspect" for e in out) <= 5
    # and chatter is still found afterwards
    signal += growing(20.0, 15.0, 640.0, 20.0, 0.1, 30.0)[:, None]
    late = next(e for e in steps(monitor(), signal, in_cut=after(ENTRY)) if e.state == "chatter")
    assert 15.0 < end(late) < 15.4
    assert late.limit_source == "cutting"


def test_gaussian_noise_raises_less_than_one_false_alarm_in_the_stated_time():
    config = dataclasses.replace(CONFIG, false_alarm_interval=30.0, expected_limit=None, air_time=5.0)
    rng = np.random.default_rng(11)
    out = steps(monitor(config), noise(rng, 120.0, 1.0), in_cut=lambda _: None)
    assert not any(e.state == "chatter" for e in out)
    lines = [e.line > e.line_limit > 0 for e in out]
    onsets = sum(b and not a for a, b in zip(lines, lines[1:], strict=False))
    assert onsets <= 16  # four times in two minutes stated; a line that crosses does so a few blocks in a row


def test_a_steady_line_in_air_is_background_and_not_chatter():
    rng = np.random.default_rng(5)
    tone = 1.5 * np.sin(2.0 * np.pi * 620.0 * np.arange(round(6 * RATE)) / RATE)[:, None]
    out = steps(monitor(), noise(rng, 6.0, 0.3) + tone, in_cut=after(3.0))
    assert not any(e.state == "chatter" for e in out)


def test_more_noise_without_a_line_is_no_chatter_and_the_limit_follows_it():
    rng = np.random.default_rng(6)
    signal = noise(rng, 3.0, 0.4)
    signal[round(2.0 * RATE) :] *= 12.0  # more noise, but no line
    every = steps(monitor(), signal, in_cut=after(ENTRY))
    before, out = [e for e in every if end(e) <= 2.0], [e for e in every if end(e) > 2.1]
    assert sum(e.state == "chatter" for e in out) == 0
    assert min(e.limit for e in out) > 2.0 * before[-1].limit


@pytest.mark.parametrize("lost", [1, 45, 90, 91, 400, 9000])
def test_a_gap_is_reported_and_chatter_is_found_again(lost):
    signal = chattering(1, seconds=2.4)
    streaming, cut = monitor(), round(2.0 * RATE) + 13
    streaming.process(signal[: round(ENTRY * RATE)], 0, in_cut=False)
    out = streaming.process(signal[round(ENTRY * RATE) : cut], round(ENTRY * RATE), in_cut=True)
    assert out[-1].state == "chatter"
    more = streaming.process(signal[cut:], cut + lost, in_cut=True)
    assert more[0].state == "gap"
    assert more[0].first_sample % 90 == 0
    assert more[0].first_sample == out[-1].first_sample + 90 + more[0].gap
    assert more[0].gap >= lost
    assert [e.gap for e in more[1:]] == [0] * (len(more) - 1)
    found = next(e for e in more if e.state == "chatter")
    assert end(found) - end(more[0]) < 0.2


def test_samples_that_come_again_are_ignored_and_counted():
    streaming = monitor()
    once = streaming.process(WHOLE[:900], 0, in_cut=True)
    assert streaming.process(WHOLE[:450], 0, in_cut=True) == []
    rest = streaming.process(WHOLE[800:], 800, in_cut=True)
    assert rest[0].late == 550
    assert [e.late for e in rest[1:]] == [0] * (len(rest) - 1)
    agree(REFERENCE, [dataclasses.replace(e, late=0) for e in once + rest])


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, 1e300])
def test_a_bad_block_is_a_state_and_does_no_harm(bad):
    signal = WHOLE.copy()
    signal[5000, 1] = bad
    out = steps(monitor(), signal, in_cut=lambda _: True)
    assert [e.first_sample for e in out if e.state == "invalid"] == [4950]
    assert all(np.isfinite([e.indicator, e.limit, e.line, e.amplitude]).all() for e in out)
    assert out[-1].state == "chatter"


def test_start_within_a_block_waits_for_the_grid():
    out = monitor().process(np.zeros((200, 2)), 30)
    assert [(e.first_sample, e.state, e.gap) for e in out] == [(90, "gap", 90)]


def test_snapshot_continues_the_same():
    one = monitor()
    one.process(WHOLE[:7777], 0, in_cut=True)
    state = one.snapshot()
    rest = one.process(WHOLE[7777:], 7777, in_cut=True)
    other = monitor()
    other.restore(state)
    assert other.process(WHOLE[7777:], 7777, in_cut=True) == rest
    one.restore(state)
    assert one.process(WHOLE[7777:], 7777, in_cut=True) == rest
    one.reset()
    agree(REFERENCE, steps(one, WHOLE, in_cut=lambda _: True))
    one.prepare()


def test_a_move_neither_alarms_nor_blinds():
    rng = np.random.default_rng(8)
    signal = noise(rng, 4.0, 0.4)
    time = np.arange(len(signal)) / RATE
    phase = np.clip((time - 2.0) / 0.15, 0.0, 1.0)
    push = 900.0 * np.sin(2.0 * np.pi * phase) * (phase * (1.0 - phase) * 4.0) ** 2  # acceleration of the slides
    signal += push[:, None]
    moving = lambda now: 2.0 <= now < 2.15  # noqa: E731
    out = steps(monitor(), signal, in_cut=after(ENTRY), moving=moving)
    assert not any(e.state == "chatter" for e in out)
    assert sum(e.moving for e in out) == 15
    signal += growing(4.0, 1.95, 651.0, 30.0, 0.15, 30.0)[:, None]
    first = next(e for e in steps(monitor(), signal, in_cut=after(ENTRY), moving=moving) if e.state == "chatter")
    assert 1.95 < end(first) < 2.2
    assert abs(first.frequency_hz - 651.0) < 3.0


def test_alarm_ends_with_the_chatter():
    rng = np.random.default_rng(9)
    signal = noise(rng, 3.0, 0.4)
    wave = growing(3.0, ENTRY, 651.0, 30.0, 0.15, 30.0)
    time = np.arange(len(wave)) / RATE
    signal += (wave * np.exp(-20.0 * np.clip(time - 2.0, 0.0, None)))[:, None]
    out = steps(monitor(), signal, in_cut=after(ENTRY))
    alarm = [end(e) for e in out if e.state == "chatter"]
    assert 2.0 < max(alarm) < 2.35
    assert out[-1].state == "quiet"


def test_a_harmonic_of_the_spindle_is_forced():
    rng = np.random.default_rng(10)
    time = np.arange(round(3.0 * RATE)) / RATE
    for frequency, kind, state in ((600.0, "forced", "suspect"), (655.0, "regenerative", "chatter")):
        signal = noise(rng, 3.0, 0.4) + (20.0 * np.sin(2.0 * np.pi * frequency * time) * (time > ENTRY))[:, None]
        last = steps(monitor(), signal, in_cut=after(ENTRY), spindle_hz=100.0)[-1]
        assert (last.kind, last.state) == (kind, state)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("band_hz", (750.0, 500.0)), ("band_hz", (600.0, 610.0)), ("window", 0.0), ("window", 0.015),
        ("hysteresis", 1.5), ("confirm", 0), ("expected_limit", -1.0), ("tools", 0), ("speed_uncertainty", 0.7),
        ("air_time", np.nan),
    ],
)  # fmt: skip
def test_a_bad_parameter_is_named(name, value):
    with pytest.raises(ValueError, match=name):
        dataclasses.replace(CONFIG, **{name: value})


def test_bad_input_is_named():
    with pytest.raises(ValueError, match=r"band_hz must end below 125\.0"):
        ChatterMonitor(CONFIG, 250.0, 1)
    with pytest.raises(ValueError, match="block must be of shape"):
        monitor().process(np.zeros((90, 3)), 0)
    with pytest.raises(ValueError, match="first_sample must not be negative, got -1"):
        monitor().process(np.zeros((90, 2)), -1)
    with pytest.raises(ValueError, match="channels must be"):
        ChatterMonitor(CONFIG, RATE, 0)
