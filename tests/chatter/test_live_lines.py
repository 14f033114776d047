"""Lines as they are reported: how exact, how soon, of what kind; and what is no chatter."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from chatter.alarm import Alarm, Evidence
from chatter.baseband import Baseband
from chatter.refinement import settled
from chatter.spectrum import pencil
from tests.chatter.signals import RATE, end, growing, noise
from tests.chatter.test_monitor import CONFIG, ENTRY, after, chattering, monitor, steps

TIME = np.arange(round(3.0 * RATE)) / RATE


def bound_hz(seconds, ratio_db):
    """Cramer-Rao bound of the frequency of one real line; the ratio is that of powers in one sample."""
    return np.sqrt(6.0 / 10.0 ** (0.1 * ratio_db) / (seconds * RATE)) / (2.0 * np.pi * seconds)


def test_frequency_on_50_ms_at_20_db_is_within_a_hertz():
    rng = np.random.default_rng(4)
    time = np.arange(450) / RATE
    wrong = []
    for _ in range(150):
        hz, phase = rng.uniform(560.0, 690.0), rng.uniform(0.0, 6.28)
        signal = np.cos(2.0 * np.pi * hz * time + phase) + rng.normal(scale=np.sqrt(0.005), size=450)
        wrong.append(pencil(signal[:, None], 625.0, 200.0, RATE, 2)[0].frequency_hz - hz)
    assert np.abs(wrong).max() < 1.0
    assert bound_hz(0.05, 20.0) < np.std(wrong) < 6.0 * bound_hz(0.05, 20.0)


def test_frequency_on_a_second_is_within_a_tenth_of_a_hertz():
    rng = np.random.default_rng(5)
    wrong = []
    for _ in range(40):
        hz, phase = rng.uniform(560.0, 690.0), rng.uniform(0.0, 6.28)
        signal = np.cos(2.0 * np.pi * hz * TIME[:9000] + phase) + rng.normal(scale=np.sqrt(0.5), size=9000)  # 0 dB
        slow = Baseband(625.0, 150.0, RATE, 90, 1, 1.0)
        for k in range(100):
            slow.update(signal[90 * k : 90 * (k + 1), None])
        found, span = settled(slow.last(1.0), hz + rng.uniform(-2.0, 2.0) - 625.0, 0.08, slow.rate)
        assert span > 0.9
        wrong.append(found + 625.0 - hz)
    assert np.abs(wrong).max() < 0.1
    assert bound_hz(1.0, 0.0) < 1.5 * np.std(wrong) < 4.5 * bound_hz(1.0, 0.0)


@pytest.mark.parametrize("seed", range(4))
def test_two_lines_38_hz_apart_are_reported_as_two_within_150_ms(seed):
    signal = chattering(seed, lines=((612.7, 30.0), (651.0, 28.0)), seconds=1.5)
    out = steps(monitor(), signal, in_cut=after(ENTRY), spindle_hz=20.0)
    onset = ENTRY + np.log(4.0 / 0.15) / 30.0
    both = [
        e for e in out
        if end(e) < onset + 0.15 and all(any(abs(x.frequency_hz - hz) < 3.0 for x in e.lines) for hz in (612.7, 651.0))
    ]  # fmt: skip
    assert both
    assert all(x.kind == "regenerative" and 0.0 < x.confidence <= 1.0 for x in both[-1].lines if x.amplitude > 1.0)


def last(signal, **told):
    stream, out = monitor(), []
    for k in range(0, len(signal), 90):
        now = {name: value(k / RATE) if callable(value) else value for name, value in told.items()}
        out += stream.process(signal[k : k + 90], k, **now)
    return out


def test_a_line_that_follows_the_speed_is_forced_however_it_moves():
    speed = lambda now: 100.0 + 4.0 * np.clip(now - 1.2, 0.0, 1.0)  # noqa: E731  600 to 624 Hz
    turned = np.cumsum(speed(TIME)) / RATE
    rng = np.random.default_rng(12)
    line = 15.0 * np.sin(2.0 * np.pi * 6.0 * turned) * np.clip((TIME - ENTRY) / 0.02, 0.0, 1.0)
    out = last(noise(rng, 3.0, 0.4) + line[:, None], in_cut=after(ENTRY), spindle_hz=speed)
    assert not any(e.state == "chatter" for e in out)
    assert sum(e.kind == "forced" for e in out[150:]) > 0.9 * 150


def test_an_error_of_an_encoder_that_moves_is_named():
    rng = np.random.default_rng(13)
    signal = noise(rng, 3.0, 0.4) + (12.0 * np.sin(2.0 * np.pi * 640.0 * TIME) * (TIME > ENTRY))[:, None]
    out = last(signal, in_cut=after(ENTRY), spindle_hz=21.7, encoder_hz=(320.0, 11.0))
    assert not any(e.state == "chatter" for e in out[130:])
    assert out[-1].kind == "encoder"
    assert last(signal, in_cut=after(ENTRY), spindle_hz=21.7, encoder_hz=(311.0, 11.0))[-1].kind == "regenerative"


def test_a_tone_from_before_the_cut_is_background():
    rng = np.random.default_rng(14)
    signal = noise(rng, 3.0, 0.3) + (9.0 * np.sin(2.0 * np.pi * 611.0 * TIME))[:, None]
    out = last(signal, in_cut=after(1.5), spindle_hz=21.7)
    assert not any(e.state == "chatter" for e in out)


def test_entry_exit_knocks_and_changes_of_speed_are_no_chatter():
    rng = np.random.default_rng(15)
    cut = lambda now: 1.0 <= now < 2.0 or 2.3 <= now < 5.5  # noqa: E731
    time = np.arange(round(6.0 * RATE)) / RATE
    inside = np.array([cut(now) for now in time])
    signal = noise(rng, 6.0, 0.35) * np.where(inside, 1.0, 0.2)[:, None] + inside[:, None] * [63.0, 85.0]
    for at, size in ((1.0, 40.0), (2.0, 30.0), (2.3, 50.0), (3.1, 60.0), (4.0, 25.0), (4.05, 40.0)):
        since = np.clip(time - at, 0.0, None)
        signal += (size * np.exp(-60.0 * since) * np.sin(2.0 * np.pi * 600.0 * since) * (time >= at))[:, None]
    out = last(signal, in_cut=cut, spindle_hz=lambda now: 20.0 if now < 4.5 else 24.0)
    assert not any(e.state == "chatter" for e in out)
    grown = growing(6.0, 5.0, 655.0, 30.0, 0.15, 30.0)
    assert any(e.state == "chatter" for e in last(signal + grown[:, None], in_cut=cut, spindle_hz=24.0) if end(e) < 5.3)


@settings(max_examples=40)
@given(
    at=st.floats(1.6, 1.7), size=st.floats(2.0, 60.0), shares=st.tuples(st.floats(0.1, 1.0), st.floats(0.0, 1.0)),
    decays=st.tuples(st.floats(5.0, 40.0), st.floats(5.0, 40.0)), apart_hz=st.floats(20.0, 90.0),
    seed=st.integers(0, 99),
)  # fmt: skip
def test_the_ring_of_a_blow_is_no_chatter_whenever_it_comes(at, size, shares, decays, apart_hz, seed):
    rng = np.random.default_rng(seed)
    time = np.arange(round(2.1 * RATE)) / RATE
    signal, since = noise(rng, 2.1, 0.35), np.clip(time - at, 0.0, None)
    for share, decay, frequency_hz in zip(shares, decays, (600.0, 600.0 + apart_hz), strict=True):
        ring = share * size * np.exp(-decay * since) * np.sin(2.0 * np.pi * frequency_hz * since)
        signal += (ring * (time >= at))[:, None]
    out = last(signal, in_cut=after(0.5), spindle_hz=21.7)
    assert not any(e.state == "chatter" for e in out)


CALM = Evidence(fresh=0.001, level=1.0, newest=0.5)
GROWS = Evidence(fresh=1.5, growth=20.0, explained=0.7, seen=1, regenerative=True, level=9.0, newest=1.9)


def told(*said):
    """Return what an alarm says to each of these, after calm cutting."""
    alarm = Alarm(CONFIG)
    assert not any(alarm.step(dataclasses.replace(CALM, age=age)) for age in range(11, 71))
    return [alarm.step(dataclasses.replace(one, age=71 + k)) for k, one in enumerate(said)]


def test_growth_that_goes_on_is_one_though_no_line_is_found_twice():
    assert told(*[GROWS] * 5) == [False] * 4 + [True]
    assert not any(told(*[GROWS, dataclasses.replace(GROWS, growth=-9.0)] * 20))
    assert not any(told(*[dataclasses.replace(GROWS, fresh=0.9)] * 30)), "below the limit"
    assert not any(told(*[dataclasses.replace(GROWS, least=2.0)] * 30)), "below the limit of a young cut"
    assert not any(told(*[dataclasses.replace(GROWS, regenerative=False)] * 30))
    assert not any(told(*[dataclasses.replace(GROWS, explained=0.5)] * 30)), "noise"
    assert not any(told(*[dataclasses.replace(GROWS, growth=5e4)] * 30)), "absurd"
    assert not any(told(*[dataclasses.replace(GROWS, newest=100.0)] * 9)), "the edge of a blow"


def test_a_rise_within_a_block_is_a_blow_only_where_nothing_grew_before():
    clear = dataclasses.replace(GROWS, explained=0.9, seen=5, newest=12.0, growth=60.0)
    begun = dataclasses.replace(clear, newest=1.5, fresh=0.5)
    assert told(clear, clear, clear) == [False, False, False]
    assert told(begun, clear, clear) == [False, False, True]


def test_a_rise_that_growth_does_not_explain_is_a_blow_and_so_is_what_has_gone_at_once():
    grows = dataclasses.replace(GROWS, explained=0.9, seen=5, newest=1.5, fresh=0.5)
    over = dataclasses.replace(grows, newest=3.0, fresh=1.2)
    assert told(grows, grows, over) == [False, False, True]
    assert told(grows, grows, dataclasses.replace(over, newest=6.0)) == [False, False, False]
    assert told(grows, grows, dataclasses.replace(over, newest=0.3)) == [False, False, False]


@pytest.mark.parametrize("growth", [12.0, 25.0, 50.0])
def test_a_pass_after_a_quiet_one_takes_3_db_more_while_it_is_young(growth):
    found = []
    for passes in (1, 2):
        rng, entry = np.random.default_rng(3), ENTRY + 3.0 * (passes - 1)
        cut = lambda now, entry=entry: ENTRY <= now < ENTRY + 2.5 or now >= entry  # noqa: E731
        signal = noise(rng, entry + 1.0, 0.35) + growing(entry + 1.0, entry, 641.0, growth, 0.4, 30.0)[:, None]
        out = steps(monitor(), signal, in_cut=cut, spindle_hz=21.7)
        found.append(next(end(e) for e in out if e.state == "chatter") - entry)
    assert 0.0 < found[1] - found[0] < np.log(2.0) / (2.0 * growth) + 0.03


def test_the_stated_rate_of_false_alarms_follows_the_sensitivity():
    rates = [dataclasses.replace(CONFIG, sensitivity=s).false_alarms_per_hour for s in (-3.0, 0.0, 1.0, 3.0)]
    assert rates == sorted(rates)
    assert rates[2] == pytest.approx(3600.0 / CONFIG.false_alarm_interval)  # one step takes the margin of 3 dB away
