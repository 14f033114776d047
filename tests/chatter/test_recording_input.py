"""Recordings that something is wrong with: what is said of them, and that the verdict stands."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.io import wavfile

from chatter import detect_recording
from chatter.condition import clipped, held_for, repeats
from services.cli import app
from tests.chatter.battery.recipes import made

RATE = 10000.0
TIME = np.arange(40000) / RATE
NOISE = np.random.default_rng(7).normal(size=TIME.size)


def teeth(passing=185.0, number=6):
    return sum(np.sin(2 * np.pi * k * (passing * TIME + 0.1 * k)) / k for k in range(1, number + 1))


STABLE = teeth() + 0.1 * NOISE
CHATTER = STABLE + 2.0 * (TIME > 1.5) * np.sin(2 * np.pi * 771.0 * TIME)
BOTH = {"stable": STABLE, "chatter": CHATTER}
CUTS = pytest.mark.parametrize(("signal", "truth"), [(signal, truth) for truth, signal in BOTH.items()], ids=BOTH)


def said(verdict, words):
    return any(words in note for note in verdict.notes)


@CUTS
def test_clipped(signal, truth):
    level = 0.6 * np.abs(signal).max()
    found = detect_recording(np.clip(signal, -level, level), RATE, spindle_hz=46.25, tools=4)
    assert found.verdict == truth
    assert sum("clipped" in note for note in found.notes) == 1
    assert not said(detect_recording(signal, RATE, spindle_hz=46.25), "clipped")


@CUTS
def test_samples_that_are_not_finite(signal, truth):
    holed = signal.copy()
    holed[::997], holed[20000:20050] = np.nan, np.inf
    found = detect_recording(holed, RATE, spindle_hz=46.25, tools=4)
    assert found.verdict == truth
    assert said(found, f"{int((~np.isfinite(holed)).sum())} samples are not finite")


@CUTS
@pytest.mark.parametrize("mains", [50.0, 60.0])
def test_mains_hum(signal, truth, mains):
    hum = sum(np.sin(2 * np.pi * k * mains * TIME + k) / k**0.7 for k in (1, 2, 3, 4, 5, 6, 7, 9, 11, 13))
    found = detect_recording(signal + 0.3 * hum, RATE, spindle_hz=46.25, tools=4)
    assert found.verdict == truth


@pytest.mark.parametrize("mains", [50.0, 60.0])
def test_hum_alone_is_set_aside_and_said(mains):
    hum = sum(np.sin(2 * np.pi * k * mains * TIME + k) / k**0.7 for k in (1, 2, 3, 4, 5, 6, 7, 9, 11, 13))
    found = detect_recording(hum + 0.3 * NOISE, RATE)
    assert found.verdict == "stable"
    assert said(found, f"mains hum at multiples of {mains:g} Hz")


@CUTS
@pytest.mark.parametrize("factor", [0.83, 1.21])
def test_a_wrong_speed_is_contradicted_and_not_used(signal, truth, factor):
    found = detect_recording(signal, RATE, spindle_hz=46.25 * factor, tools=4)
    assert found.verdict == truth
    assert said(found, "contradict")
    assert found.doubt == "the signal contradicts the stated speed"
    right = detect_recording(signal, RATE, spindle_hz=46.25, tools=4)
    assert not said(right, "contradict")
    assert right.doubt is None
    assert found.confidence < right.confidence


def test_a_speed_that_the_lines_do_not_show_makes_no_chatter_of_them():
    sample = made("misled_stable", 4)
    found = detect_recording(sample.signal, sample.rate_hz, **sample.told)
    assert (found.verdict, found.doubt) == ("stable", "the signal does not confirm the stated speed")
    assert said(found, "does not confirm the stated")


@CUTS
def test_an_unknown_speed_is_less_sure(signal, truth):
    found, told = detect_recording(signal, RATE), detect_recording(signal, RATE, spindle_hz=46.25, tools=4)
    assert found.verdict == told.verdict == truth
    assert found.doubt == "the speed is unknown"
    assert found.confidence < told.confidence


def test_what_is_forced_and_strong_is_an_event_of_its_own():
    found = detect_recording(STABLE * (TIME > 1.0) + 0.05 * NOISE, RATE, spindle_hz=46.25, tools=4)
    (event,) = found.events
    assert (found.verdict, event.kind) == ("stable", "forced")
    assert event.frequency_hz == pytest.approx(185.0, abs=0.5)
    assert (event.start, event.end) == pytest.approx((1.0, 4.0), abs=0.3)
    assert detect_recording(NOISE, RATE, spindle_hz=46.25, tools=4).events == ()


def test_impacts_that_a_recorder_without_a_filter_folds_down_are_forced():
    rate, passing = 2500.0, 282.631
    angle = (np.arange(10000) / rate * passing) % 1.0
    impacts = np.where(angle < 0.08, np.sin(np.pi * angle / 0.08), 0.0) + 0.02 * NOISE[:10000]
    assert detect_recording(impacts, rate).verdict == "stable"
    assert detect_recording(impacts, rate, spindle_hz=passing, tools=1).verdict == "stable"


def test_a_crest_of_few_levels_is_coarse_and_not_clipped():
    for levels in (3, 20, 30000):
        wave = np.sin(2 * np.pi * 651.0 * TIME)
        assert clipped(np.rint(levels * wave)) == 0.0
        assert clipped(np.clip(np.rint(2 * levels * wave), -levels, levels)) > 0.3
    assert clipped(np.full(100, 3.0)) == clipped(np.array([1.0])) == clipped(NOISE) == 0.0


@given(st.integers(2, 8), st.integers(0, 7), st.integers(0, 10_000))
def test_held_values_are_found_whatever_the_phase(times, phase, seed):
    rng = np.random.default_rng(seed)
    x = np.repeat(rng.normal(size=500), times)[phase % times :]
    assert held_for(x) == times
    assert repeats(np.stack([x, np.zeros(x.size)], axis=1)) == (times, -phase % times)
    assert repeats(np.stack([x, rng.normal(size=x.size)], axis=1)) == (1, 0)


def answer_of(capsys, *arguments):
    with pytest.raises(SystemExit) as left:
        app.main(["detect", *map(str, arguments), "--json"])
    return left.value.code, json.loads(capsys.readouterr().out)


def test_the_command_says_what_it_doubts(capsys, tmp_path):
    path = tmp_path / "a.wav"
    wavfile.write(path, int(RATE), (CHATTER / 8.0).astype("f4"))
    code, wrong = answer_of(capsys, path, "--speed-rpm", 60 * 46.25 * 1.21, "--tools", 4)
    assert (code, wrong["verdict"], wrong["doubt"]) == (0, "chatter", "the signal contradicts the stated speed")
    assert any("3357.75 1/min contradict the signal" in note for note in wrong["notes"])
    _, right = answer_of(capsys, path, "--speed-rpm", 60 * 46.25, "--tools", 4)
    assert (right["doubt"], 1.0 >= right["confidence"] > wrong["confidence"] > 0.0) == (None, True)
    (event,) = [e for e in right["events"] if e["kind"] == "regenerative"]
    assert 0.0 < event["confidence"] <= 1.0


@pytest.mark.parametrize("steps", ["4", "-3.5", "nan"])
def test_a_sensitivity_out_of_range_is_named(capsys, tmp_path, steps):
    path = tmp_path / "a.wav"
    wavfile.write(path, int(RATE), STABLE.astype("f4"))
    code, answer = answer_of(capsys, path, f"--sensitivity={steps}")
    assert (code, answer["error"]["field"]) == (2, "sensitivity")


def test_a_rate_that_cannot_carry_the_band_is_refused(capsys, tmp_path):
    path = tmp_path / "a.wav"
    wavfile.write(path, 1000, STABLE.astype("f4"))
    code, answer = answer_of(capsys, path, "--band", "500:750")
    assert (code, answer["verdict"]) == (3, None)
    assert "sampled at 1000 Hz, cannot see 500..750 Hz" in answer["reason"]
