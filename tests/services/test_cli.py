"""The command line as a program and as a person meets it."""

import json
import math
import pathlib
import subprocess
import sys

import numpy as np
import pytest
from scipy.io import wavfile

from services.cli import app

SHARED = pathlib.Path(__file__).resolve().parents[3] / "shared" / "data" / "milling-chatter-audio"


def run(capsys, *arguments):
    with pytest.raises(SystemExit) as ended:
        app.main([*map(str, arguments), "--json"])
    out = capsys.readouterr().out
    assert out.count("\n") == 1, "one JSON object and nothing else"
    return ended.value.code, json.loads(out)


@pytest.mark.parametrize(
    ("arguments", "field"),
    [
        (["pitch", "--chatter-hz", "-5", "--speed-rpm", "1200"], "chatter-hz"),
        (["pitch", "--chatter-hz", "nan", "--speed-rpm", "1200"], "chatter-hz"),
        (["pitch", "--chatter-hz", "inf", "--speed-rpm", "1200"], "chatter-hz"),
        (["pitch", "--chatter-hz", "abc", "--speed-rpm", "1200"], "chatter-hz"),
        (["pitch", "--chatter-hz", "652"], "speed-rpm"),
        (["pitch", "--chatter-hz", "1", "--speed-rpm", "1200"], "order"),
        (["pitch", "--chatter-hz", "652", "--speed-rpm", "1200", "--order", "-1"], "order"),
        (["pitch", "--chatter-hz", "652", "--speed-rpm", "1200", "--phase-pi", "0"], "phase-pi"),
        (["pitch", "--chatter-hz", "652", "--speed-rpm", "1200", "--diameter-mm", "0"], "diameter-mm"),
        (["pitch", "--chatter-hz", "652", "--speed-rpm", "1200", "--colour", "red"], "colour"),
        (["stability", "--mass-kg", "0", "--natural-hz", "421", "--damping", "0.03", "--speed-rpm", "1200",
          "--pitch-difference-deg", "0"], "mass-kg"),
        (["simulate", "no-such-case"], "case"),
        (["simulate", "thesis-652", "--shift-deg", "50"], "shift-deg"),
        (["simulate", "thesis-652", "--feed-length-mm", "500"], "feed-length-mm"),
        (["run", "thesis-652", "--seed", "-1"], "seed"),
        (["run", "thesis-652", "--arm-after-s", "99"], "arm-after-s"),
        (["run", "thesis-652", "--sensitivity", "9"], "sensitivity"),
        (["demo", "thesis-652", "--sensitivity", "-9"], "sensitivity"),
        (["monitor", "thesis-652", "--sensitivity", "nan"], "sensitivity"),
        (["up", "thesis-652", "--sensitivity", "4"], "sensitivity"),
        (["up", "thesis-652", "--adapter", "fanuc"], "adapter"),
        (["up", "thesis-652", "--adapter", "linuxcnc", "--linuxcnc", "/no/such/folder"], "linuxcnc"),
        (["demo", "linuxcnc", "--linuxcnc", "/no/such/folder"], "linuxcnc"),
        (["detect", "no-such-file.wav"], "file"),
        (["run", "thesis-652", "--out", "/dev/null/x"], "out"),
        (["replay", "no-such-file.mcap"], "file"),
        (["replay", "x.mcap", "--pace", "0"], "pace"),
        (["replay", "x.mcap", "--from", "3", "--to", "2"], "to"),
        (["no-such-verb"], "verb"),
    ],
)  # fmt: skip
def test_wrong_use_is_one_json_error_and_exit_code_2(capsys, arguments, field):
    code, answer = run(capsys, *arguments)
    assert code == 2
    assert set(answer["error"]) == {"field", "value", "rule", "message"}
    assert answer["error"]["field"] == field
    assert answer["error"]["rule"]


def test_the_same_for_people(capsys):
    with pytest.raises(SystemExit) as ended:
        app.main(["pitch", "--chatter-hz", "-5", "--speed-rpm", "1200"])
    assert ended.value.code == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert "chatter-hz must be a finite number above 0 Hz; got -5.0" in captured.err.replace("\n", " ")


def test_pitch_of_the_thesis(capsys):
    code, answer = run(capsys, "pitch", "--chatter-hz", 652, "--speed-rpm", 1200)
    assert code == 0
    assert answer["pitch_difference_deg"] == pytest.approx(5.521472, abs=1e-6)


def test_stability_of_the_thesis(capsys):
    known = ["--mass-kg", 0.188, "--natural-hz", 421, "--damping", 0.03, "--speed-rpm", 1200]
    _, answer = run(capsys, "stability", *known, "--pitch-difference-deg", 5.52, "--stiffness", 1e6)
    assert answer["critical_stiffness_n_m"] == pytest.approx(90073.41, rel=1e-4)
    assert answer["growth_rate_1_s"] == pytest.approx(-10.32337, rel=1e-3)
    assert answer["stable"] is True
    assert len(answer["stable_intervals_n_m"]) == 2
    low, high = answer["stable_intervals_n_m"][1]
    assert low < 1e6 < high


def test_what_is_too_slow_to_search_is_said(capsys):
    known = ["--mass-kg", 0.188, "--natural-hz", 421, "--damping", 0.03, "--pitch-difference-deg", 0]
    code, answer = run(capsys, "stability", *known, "--speed-rpm", 0.6)
    assert (code, answer["stable_intervals_n_m"]) == (0, None)
    code, answer = run(capsys, "stability", *known, "--speed-rpm", 0.6, "--stiffness", 1e6)
    assert code == 3
    assert answer["growth_rate_1_s"] is None
    assert "waves in one delay" in answer["reason"]


def test_simulate(capsys):
    _, answer = run(capsys, "simulate", "thesis-652", "--feed-length-mm", 6)
    assert answer["chatter"] is True
    assert min(abs(answer["chatter_hz"] - line) for line in (612, 651, 689)) < 8
    assert 4 < answer["ra_um"] < 9
    assert answer["growth_rate_1_s"] == pytest.approx(29.88, abs=0.05)
    assert answer["plateaus"]
    _, answer = run(capsys, "simulate", "thesis-652", "--feed-length-mm", 6, "--shift-deg", 2.76)
    assert (answer["chatter"], answer["chatter_hz"], answer["plateaus"]) == (False, None, [])
    assert answer["growth_rate_1_s"] < -10


def test_run_writes_what_it_says(capsys, tmp_path):
    code, answer = run(capsys, "run", "thesis-652", "--out", tmp_path, "--seed", 5)
    assert code == 0
    assert answer["seed"] == 5
    assert answer["outcome"] == "suppressed"
    written = {pathlib.Path(path).name for path in answer["written"]}
    assert {"summary.json", "report.html", "spectrograms.png"} <= written
    assert all((tmp_path / name).stat().st_size > 500 for name in written)
    stored = json.loads((tmp_path / "summary.json").read_text())
    assert stored["chatter_hz"] == answer["chatter_hz"]
    code, again = run(capsys, "replay", tmp_path / "run.mcap")
    assert code == 0
    assert again["same_as_recorded"] is True
    wall = {"loop_p50_ms", "loop_p99_ms", "real_time_factor", "total_wall_s", "written"}
    assert {k: again[k] for k in answer if k not in wall} == {k: v for k, v in answer.items() if k not in wall}
    html = (tmp_path / "report.html").read_text()
    assert "http://" not in html.replace("http://www.w3.org", "")
    assert "https://" not in html


def tone_file(tmp_path, rate, hz, seconds=4.0, start=1.0, name="tone.csv"):
    rng = np.random.default_rng(1)
    time = np.arange(round(seconds * rate)) / rate
    signal = 0.05 * rng.normal(size=time.size) + np.where(time > start, np.sin(2 * np.pi * hz * time), 0.0)
    path = tmp_path / name
    if name.endswith("csv"):
        path.write_text("time_s,force_n\n" + "\n".join(f"{t:.9f},{v:.9f}" for t, v in zip(time, signal, strict=True)))
    else:
        wavfile.write(path, rate, signal.astype(np.float32))
    return path


def test_detect_finds_a_line_that_begins(capsys, tmp_path):
    code, answer = run(capsys, "detect", tone_file(tmp_path, 9000, 651.0), "--out", tmp_path)
    assert code == 0
    assert answer["verdict"] == "chatter"
    event = answer["events"][0]
    assert event["frequency_hz"] == pytest.approx(651.0, abs=0.5)
    assert event["start_s"] == pytest.approx(1.0, abs=0.15)
    assert event["kind"] == "regenerative"
    assert pathlib.Path(answer["written"][0]).stat().st_size > 5000


def test_detect_refuses_what_the_rate_cannot_show(capsys, tmp_path):
    path = tone_file(tmp_path, 250, 20.0)
    code, answer = run(capsys, "detect", path, "--speed-rpm", 1200, "--tools", 2, "--band", "500:750")
    assert code == 3
    assert "sampled at 250 Hz, cannot see 500..750 Hz" in answer["reason"]
    assert answer["verdict"] is None


@pytest.mark.parametrize("band", ["500", "750:500", "a:b", "0:100", "500:inf", "-5:10", "nan:800"])
def test_a_band_must_make_sense(capsys, tmp_path, band):
    code, answer = run(capsys, "detect", tone_file(tmp_path, 9000, 651.0, seconds=1.0), "--band", band)
    assert (code, answer["error"]["field"]) == (2, "band")


def test_detect_with_holes_in_the_recording(capsys, tmp_path):
    path = tone_file(tmp_path, 9000, 651.0, name="tone.wav")
    rate, samples = wavfile.read(path)
    samples = samples.copy()
    samples[20000:20050] = np.nan
    wavfile.write(path, rate, samples)
    code, answer = run(capsys, "detect", path)
    assert (code, answer["verdict"]) == (0, "chatter")
    assert any("50 of" in note for note in answer["notes"])


@pytest.mark.skipif(not SHARED.is_dir(), reason="the recorded sounds lie beside the repository, not in it")
def test_the_two_recorded_sounds(capsys):
    _, answer = run(capsys, "detect", SHARED / "chatter.wav")
    (event,) = [e for e in answer["events"] if e["kind"] == "regenerative"]
    assert event["frequency_hz"] == pytest.approx(1067.0, abs=3.0)
    assert 6.5 <= event["start_s"] <= 7.4
    assert 16.0 <= event["end_s"] <= 16.8
    _, answer = run(capsys, "detect", SHARED / "stable.wav", "--speed-rpm", 5497, "--tools", 4)
    assert answer["verdict"] == "stable"


def test_the_installed_command_and_its_help():
    exe = pathlib.Path(sys.executable).with_name("antiphase")
    done = subprocess.run([exe, "--help"], capture_output=True, text=True, check=False)
    assert done.returncode == 0
    for verb in ("run", "demo", "simulate", "detect", "pitch", "stability"):
        assert verb in done.stdout


def test_ctrl_c_leaves_a_report(capsys, tmp_path, monkeypatch):
    from services import closed_loop

    step = closed_loop.Loop.step

    def interrupted(self, number):
        if number == 230:
            raise KeyboardInterrupt
        step(self, number)

    monkeypatch.setattr(closed_loop.Loop, "step", interrupted)
    code, answer = run(capsys, "run", "thesis-652", "--out", tmp_path)
    assert code == app.INTERRUPTED
    assert answer["interrupted"] is True
    assert answer["simulated_s"] == pytest.approx(2.3)
    assert math.isclose(answer["entered_cut_s"], 2.0)
    assert (tmp_path / "report.html").exists()


def test_doctor_finds_this_installation_sound(capsys):
    code, answer = run(capsys, "doctor")
    found = {check["name"]: check for check in answer["checks"]}
    assert {"compiled kernels", "bus round trip", "clock"} <= set(found)
    assert all(check["detail"] for check in found.values())
    busy = {"compiled kernels", "clock"}  # these two tell how busy the computer is, and rightly fail on a busy one
    assert all(check["ok"] for name, check in found.items() if name not in busy), answer
    assert (code == 0) == all(check["ok"] for check in found.values())


@pytest.mark.system
def test_the_demo_over_the_network_is_the_run_in_one_process(capsys, tmp_path):
    code, demo = run(capsys, "demo", "thesis-652", "--seed", 7, "--out", tmp_path)
    assert code == 0
    _, lockstep = run(capsys, "run", "thesis-652", "--seed", 7)
    if demo["commands_late"] == 0:
        for key in ("detected_s", "chatter_hz", "shift_deg", "suppressed_s", "marked_length_mm", "ra_after_um"):
            assert demo[key] == lockstep[key], key
    assert demo["outcome"] == "suppressed"
    assert demo["blocks_lost"] == 0
    code, again = run(capsys, "replay", tmp_path / "run.mcap")
    assert (code, again["same_as_recorded"]) == (0, True)
