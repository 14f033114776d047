"""`detect` on people's files: which channels, what is said of them, what is refused, what is written."""

import csv
import json
import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.io import savemat, wavfile

from services.cli import app
from services.errors import InputError
from services.importers.channels import ASIDE, UNKNOWN, chosen, kind_of, rank_of
from services.importers.health import dead, unheld
from services.importers.recording import Recording

RATE = 9000.0
TIME = np.arange(36000) / RATE
NOISE = 0.05 * np.random.default_rng(1).normal(size=(TIME.size, 3))
TONE = np.where(TIME > 1.0, np.sin(2 * np.pi * 651.0 * TIME), 0.0)


def ended(capsys, *arguments):
    with pytest.raises(SystemExit) as left:
        app.main(["detect", *map(str, arguments)])
    return left.value.code, capsys.readouterr()


def answer_of(capsys, *arguments):
    code, said = ended(capsys, *arguments, "--json")
    return code, json.loads(said.out)


def recording(**channels):
    units = ("",) * len(channels)
    return Recording(
        source="x", rate_hz=RATE, names=tuple(channels), units=units, samples=np.column_stack(list(channels.values()))
    )  # fmt: skip


def mat(tmp_path, **variables):
    path = tmp_path / "cut.mat"
    savemat(path, {"fs": RATE} | variables)
    return path


@pytest.mark.parametrize(
    ("name", "unit", "kind"),
    [
        ("acc_x", "", "acceleration"), ("Vibration", "V", "acceleration"), ("spindle", "g", "acceleration"),
        ("Fz", "", "force"), ("x", "N", "force"), ("Mic 1", "", "sound"), ("left", "full scale", "sound"),
        ("spindle current", "A", "current"), ("smcAC", "", "channels"), ("ch0", "", "channels"),
    ],
)  # fmt: skip
def test_kinds_of_channels(name, unit, kind):
    assert kind_of(rank_of(name, unit)) == kind


@pytest.mark.parametrize("name", ["spindle speed", "rpm", "tacho", "Position", "temperature", "label", "Feed", "trig"])
def test_what_is_no_vibration(name):
    assert rank_of(name, "") == ASIDE
    assert UNKNOWN < ASIDE


def test_all_channels_of_the_best_kind_are_taken():
    whole = recording(speed=TIME, acc_x=TONE, acc_y=NOISE[:, 0], acc_z=np.zeros(TIME.size), mic=NOISE[:, 1])
    assert chosen(whole, None).names == ("acc_x", "acc_y")
    assert chosen(whole, ["all"]).names == ("speed", "acc_x", "acc_y", "mic")
    assert chosen(whole, ["mic", "1"]).names == ("mic", "acc_x")
    unnamed = recording(a=TONE, b=np.floor(TIME), c=(TIME > 1).astype(float), d=NOISE[:, 0])
    assert chosen(unnamed, None).names == ("a", "d"), "ramps and switches show no vibration"


def test_a_channel_answers_to_its_name_with_and_without_unit():
    whole = Recording(source="x", rate_hz=RATE, names=("rec.acc", "mic"), units=("m_s2", "Pa"), samples=NOISE[:, :2])
    for wanted in ("rec.acc", "acc", "acc_m_s2", "Acc [m/s2]", "0"):
        assert chosen(whole, [wanted]).names == ("rec.acc",)
    with pytest.raises(InputError, match="0: rec.acc, 1: mic"):
        chosen(whole, ["a"])


def test_channels_together_are_one_verdict(capsys, tmp_path):
    path = mat(tmp_path, acc_x=NOISE[:, 0], acc_y=TONE + NOISE[:, 1], speed_rpm=1200.0 + NOISE[:, 2])
    code, answer = answer_of(capsys, path)
    assert (code, answer["verdict"]) == (0, "chatter")
    assert answer["channels"] == ["acc_x", "acc_y"]
    assert answer["channel"] == "acc_x, acc_y"
    assert any("not speed" in note for note in answer["notes"])
    assert any("--speed-rpm 1200" in note for note in answer["notes"])
    assert answer["events"][0]["frequency_hz"] == pytest.approx(651.0, abs=0.5)
    _, quiet = answer_of(capsys, path, "--channel", "acc_x")
    assert (quiet["verdict"], quiet["channels"]) == ("stable", ["acc_x"])
    _, both = answer_of(capsys, path, "--channel", "speed_rpm", "--channel", "1")
    assert both["channels"] == ["speed", "acc_y"]


def test_what_is_written_and_said(capsys, tmp_path):
    path, out = mat(tmp_path, acc=TONE + NOISE[:, 0]), tmp_path / "out"
    code, said = ended(capsys, path, "--out", out, "--speed-rpm", 1200, "--tools", 2)
    assert code == 0
    assert re.match(r"chatter from (0\.9|1\.0) s to 4\.0 s at 651 Hz, regenerative, sure\n", said.out)
    assert (out / "detect.png").stat().st_size > 20000
    with (out / "events.csv").open(newline="") as file:
        (event,) = csv.DictReader(file)
    stored = json.loads((out / "detect.json").read_text())
    for key in ("start_s", "end_s", "frequency_hz", "confidence"):
        assert float(event[key]) == stored["events"][0][key]
    assert 0.5 < stored["confidence"] <= 1.0
    assert all(str(out / name) in said.out for name in ("detect.png", "events.csv", "detect.json"))


def test_a_stable_recording_in_words(capsys, tmp_path):
    path = tmp_path / "a.wav"
    wavfile.write(path, 9000, NOISE[:, 0].astype("f4"))
    code, said = ended(capsys, path)
    assert (code, said.out.splitlines()[0]) == (0, "no chatter in 4.0 s, less sure: the speed is unknown")


REFUSED = {
    "constant": {"acc": np.full(TIME.size, 0.25)},
    "constant beside nothing": {"a": np.zeros(TIME.size), "b": np.ones(TIME.size)},
}


@pytest.mark.parametrize("name", REFUSED)
def test_a_dead_recording_is_refused_with_the_reason(capsys, tmp_path, name):
    code, answer = answer_of(capsys, mat(tmp_path, **REFUSED[name]))
    assert (code, answer["verdict"]) == (3, None)
    assert answer["reason"].startswith("constant: a")


def test_a_dead_channel_that_was_asked_for_is_refused(capsys, tmp_path):
    path = mat(tmp_path, a=np.zeros(TIME.size), b=TONE)
    assert answer_of(capsys, path, "--channel", "a")[0] == 3
    assert answer_of(capsys, path)[1]["channels"] == ["b"]


WRONG = {
    "a rate that is not the file's": (["--rate-hz", "44100"], "rate-hz"),
    "no such channel": (["--channel", "mic"], "channel"),
    "one channel of nothing": (["--channel", "empty"], "channel"),
}


@pytest.mark.parametrize("name", WRONG)
def test_wrong_use_of_a_file(capsys, tmp_path, name):
    arguments, field = WRONG[name]
    path = mat(tmp_path, acc=TONE, empty=np.full(TIME.size, np.nan))
    code, answer = answer_of(capsys, path, *arguments)
    assert (code, answer["error"]["field"]) == (2, field)


@pytest.mark.parametrize("ending", [".mat", ".h5", ".csv", ".wav"])
def test_files_that_cannot_be_read(capsys, tmp_path, ending):
    path = tmp_path / f"a{ending}"
    for content in (b"", b"\x89HDF\r\n\x1a\n" + bytes(40), b"MATLAB 5.0 MAT-file" + bytes(60), b"\xff\xfe\xfd" * 9):
        path.write_bytes(content)
        code, answer = answer_of(capsys, path)
        assert (code, answer["error"]["field"]) == (2, "file")


def test_clipped_samples_are_counted(capsys, tmp_path):
    loud = np.clip(1.5 * TONE + NOISE[:, 0], -1.0, 1.0)
    share = float((np.abs(loud) == 1.0).mean())
    code, answer = answer_of(capsys, mat(tmp_path, acc=loud))
    assert (code, answer["verdict"]) == (0, "chatter")
    (note,) = (note for note in answer["notes"] if "clipped" in note)
    assert f"{100 * share:.2g} % of the samples" in note


@given(st.integers(2, 8), st.integers(0, 7), st.integers(0, 10_000))
def test_held_values_are_found_whatever_the_phase(factor, phase, seed):
    values = np.random.default_rng(seed).normal(size=500)
    x = np.repeat(values, factor)[phase % factor :]
    thin = unheld(recording(a=x))
    assert thin.rate_hz == RATE / factor
    assert set(thin.samples[:, 0]) <= set(values)
    assert (np.diff(thin.samples[:, 0]) != 0).all()


@given(st.integers(0, 10_000))
def test_ordinary_signals_are_not_held(seed):
    rng = np.random.default_rng(seed)
    for x in (rng.normal(size=2000), np.rint(2 * rng.normal(size=2000)), np.rint(20 * TONE[:2000])):
        assert unheld(recording(a=x)).rate_hz == RATE
    assert unheld(recording(a=np.repeat(rng.normal(size=500), 2), b=rng.normal(size=1000))).rate_hz == RATE


def test_every_value_stored_twice_halves_the_rate(capsys, tmp_path):
    """The rate in the file counts: the line stands where its samples say, and what they cannot show is refused."""
    path = tmp_path / "twice.wav"
    wavfile.write(path, 18000, np.repeat(TONE + NOISE[:, 0], 2).astype("f4"))
    code, answer = answer_of(capsys, path)
    assert (code, answer["rate_hz"]) == (0, 9000.0)
    assert answer["events"][0]["frequency_hz"] == pytest.approx(651.0, abs=0.5)
    assert any("every value is stored twice" in note for note in answer["notes"])
    code, answer = answer_of(capsys, path, "--band", "4000:6000")
    assert code == 3
    assert "sampled at 9000 Hz, cannot see 4000..6000 Hz" in answer["reason"]


def test_dead_says_nothing_of_the_living():
    assert dead(recording(a=TONE, b=np.zeros(TIME.size))) is None
