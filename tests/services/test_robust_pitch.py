"""`pitch --case`, `--lines`, `--band`: what stands most, how far it carries, and an honest refusal."""

import json
import math

import pytest

from services.cli.app import _run


def ask(capsys, *arguments):
    code = _run(["pitch", *map(str, arguments), "--json"], True)
    return code, json.loads(capsys.readouterr().out)


def test_lines_are_put_into_the_measured_window(capsys):
    code, answer = ask(capsys, "--lines", "652,612", "--speed-rpm", 1200)
    assert code == 0
    assert answer["order"] == 0
    for line in (652.0, 612.0):
        phase = answer["phase_pi"] * line / 652.0
        assert 0.7 <= phase <= 1.1
    low, high = answer["window_pi"]
    assert low * 612.0 / 652.0 == pytest.approx(0.7)
    assert high == pytest.approx(1.1)
    assert answer["margin_pi"] == pytest.approx([answer["phase_pi"] - low, high - answer["phase_pi"]])
    per_pi = answer["pitch_difference_deg"] / answer["phase_pi"]
    assert answer["margin_deg"] == pytest.approx([per_pi * m for m in answer["margin_pi"]])
    assert answer["margin_hz"] == pytest.approx([652.0 / answer["phase_pi"] * m for m in answer["margin_pi"]])
    assert answer["slide_y1_um"] == pytest.approx(math.sqrt(2.0) * answer["dy1p_um"])


def test_a_band_refers_to_its_middle(capsys):
    code, answer = ask(capsys, "--band", "600:700", "--speed-rpm", 1200)
    assert (code, answer["frequency_hz"]) == (0, 650.0)
    assert answer["phase_pi"] * 600.0 / 650.0 >= 0.7
    assert answer["phase_pi"] * 700.0 / 650.0 <= 1.1


def test_a_case_is_judged_over_the_stretch_that_it_cuts(capsys):
    code, answer = ask(capsys, "--case", "thesis-652")
    assert code == 0
    assert answer["worst_growth_1_s"] < -10.0
    assert 0.7 < answer["phase_pi"] < 1.1
    assert answer["speed_rpm"] == 1200.0
    assert min(answer["margin_hz"]) > 20.0


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (("--lines", 300, "--speed-rpm", 3000, "--travel-mm", 1), "no stable pitch within 1 mm of travel at 3000"),
        (("--band", "300:310", "--speed-rpm", 3000, "--max-shift-deg", 3), "no stable pitch within a shift of 3.0 deg"),
        (("--lines", "400,700", "--speed-rpm", 1200), "no pitch puts 400..700 Hz between 0.7 and 1.1 pi at once"),
        (("--case", "thesis-652", "--max-shift-deg", 0.5), "no stable pitch within a shift of 0.5 deg"),
    ],
)
def test_nothing_that_fits_is_a_refusal_with_all_keys(capsys, arguments, reason):
    code, answer = ask(capsys, *arguments)
    assert code == 3
    assert answer["reason"].startswith(reason)
    assert answer["pitch_difference_deg"] is None
    assert {"margin_hz", "window_pi", "order"} <= set(answer)


def test_the_speed_that_is_advised_helps(capsys):
    asked = ("--lines", 300, "--travel-mm", 1)
    _, answer = ask(capsys, *asked, "--speed-rpm", 3000)
    advised = answer["reason"].split("try ")[1].split()[0]
    assert ask(capsys, *asked, "--speed-rpm", advised)[0] == 0


@pytest.mark.parametrize(
    ("wrong", "field"),
    [
        (["--speed-rpm", 1200], "chatter-hz"),
        (["--lines", 652, "--band", "500:750", "--speed-rpm", 1200], "chatter-hz"),
        (["--lines", "652,-3", "--speed-rpm", 1200], "lines"),
        (["--lines", "652,0", "--speed-rpm", 1200], "lines"),
        (["--lines", "many", "--speed-rpm", 1200], "lines"),
        (["--lines", "1e9", "--speed-rpm", 1200], "lines"),
        (["--band", "750:500", "--speed-rpm", 1200], "band"),
        (["--band", "500", "--speed-rpm", 1200], "band"),
        (["--band", "0:500", "--speed-rpm", 1200], "band"),
        (["--band", "500:nan", "--speed-rpm", 1200], "band"),
        (["--lines", 652], "speed-rpm"),
        (["--lines", 652, "--speed-rpm", 0], "speed-rpm"),
        (["--lines", 652, "--speed-rpm", -1200], "speed-rpm"),
        (["--lines", 652, "--speed-rpm", 1e9], "speed-rpm"),
        (["--chatter-hz", 0, "--speed-rpm", 1200], "chatter-hz"),
        (["--chatter-hz", 1e9, "--speed-rpm", 1200], "chatter-hz"),
        (["--chatter-hz", 652, "--speed-rpm", 1200, "--travel-mm", 3], "travel-mm"),
        (["--lines", 652, "--speed-rpm", 1200, "--phase-pi", 0.8], "phase-pi"),
        (["--lines", 652, "--speed-rpm", 1200, "--travel-mm", 0], "travel-mm"),
        (["--lines", 652, "--speed-rpm", 1200, "--max-shift-deg", 40], "max-shift-deg"),
        (["--lines", 652, "--speed-rpm", 1200, "--spread-hz", 5], "spread-hz"),
        (["--case", "thesis-652", "--spread-percent", 99], "spread-percent"),
        (["--case", "no-such-case"], "case"),
        (["--lines", 652, "--speed-rpm", 1200, "--order", -1], "order"),
    ],
)
def test_wrong_or_contradictory_options_are_named(capsys, wrong, field):
    code, answer = ask(capsys, *wrong)
    assert (code, answer["error"]["field"]) == (2, field)
    assert answer["error"]["rule"]
