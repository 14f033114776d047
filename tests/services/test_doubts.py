"""Cases outside the range of the model: flagged in every result, or refused; never silently computed."""

import json
import math

import pytest

from services.cli import app
from services.config import load_case
from services.doubts import doubts_of, in_words
from services.reproduce.depth import depth_rows, study_depth
from turning_sim import Doubt

SHORT = "[case]\nair_time_s = 0.7\ncut_time_s = 0.6\n"
FLAGGED = {
    "depth beyond the nose": ("[cutting]\ndepth_of_cut_mm = 0.45", "depth_of_cut_mm should be at most 0.4, got 0.45"),
    "depth beyond the law": ("[cutting]\ndepth_of_cut_mm = 0.6", "depth_of_cut_mm should be in 0.05...0.5, got 0.6"),
    "feed beyond r/3": ("[cutting]\nfeed_per_rev_mm = 0.3", "feed_per_tool_mm should be at most 0.133333, got 0.15"),
    "slow spindle": ("[cutting]\nspindle_speed_rpm = 480.0", "spindle_speed_rpm should be in 600...3000, got 480"),
    "bar that may buckle": (
        "[workpiece]\ndiameter_mm = 4.0\nlength_mm = 120.0\nturned_length_mm = 60.0\n"
        "[cutting]\ncutting_stiffness_n_per_m = 2e3\nprocess_damping_n_s_per_m = 0.1",
        "feed_force_n should be at most 41.9877, got 43.8724",
    ),
}  # fmt: skip
REFUSED = {
    "no length": ("[workpiece]\nlength_mm = 0.0", "workpiece.length_mm"),
    "negative length": ("[workpiece]\nlength_mm = -160.0", "workpiece.length_mm"),
    "feed beyond the nose": ("[cutting]\nfeed_per_rev_mm = 0.5", "cutting.feed_per_rev_mm"),
    "no depth": ("[cutting]\ndepth_of_cut_mm = 0.0", "cutting.depth_of_cut_mm"),
    "no speed": ("[cutting]\nspindle_speed_rpm = 0.0", "cutting.spindle_speed_rpm"),
    "no bar": ("[workpiece]\ndiameter_mm = 0.0", "workpiece.diameter_mm"),
}


def case_file(tmp_path, tables):
    path = tmp_path / "odd.toml"
    path.write_text(f'extends = "thesis-652"\n{SHORT}{tables}\n', encoding="utf-8")
    return path


def ended(capsys, *arguments):
    with pytest.raises(SystemExit) as left:
        app.main([str(a) for a in arguments])
    return left.value.code, capsys.readouterr()


def answer_of(capsys, *arguments):
    code, said = ended(capsys, *arguments, "--json")
    return code, json.loads(said.out)


@pytest.mark.parametrize("name", FLAGGED)
def test_simulate_flags(capsys, tmp_path, name):
    tables, words = FLAGGED[name]
    code, answer = answer_of(capsys, "simulate", case_file(tmp_path, tables), "--feed-length-mm", 1)
    assert code == 0
    assert any(doubt.startswith(words) for doubt in answer["doubts"])
    code, said = ended(capsys, "simulate", case_file(tmp_path, tables), "--feed-length-mm", 1)
    assert f"note: outside the range of the model: {words}" in said.out


def test_run_flags_in_summary_words_and_report(capsys, tmp_path):
    tables, words = FLAGGED["depth beyond the nose"]
    path = case_file(tmp_path, tables)
    code, said = ended(capsys, "run", path, "--out", tmp_path)
    assert code == 0
    assert f"note: outside the range of the model: {words}" in said.out
    stored = json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))
    assert [doubt.startswith(words) for doubt in stored["doubts"]] == [True]
    unverified = (tmp_path / "report.html").read_text(encoding="utf-8").split("What was not verified")[1]
    assert words in unverified


def test_a_run_within_the_range_has_no_doubts(capsys, tmp_path):
    code, answer = answer_of(capsys, "run", case_file(tmp_path, ""))
    assert (code, answer["doubts"]) == (0, [])


@pytest.mark.parametrize("name", REFUSED)
@pytest.mark.parametrize("verb", ["run", "simulate", "machine", "up"])
def test_nonsense_is_refused_before_anything_starts(capsys, tmp_path, verb, name):
    tables, field = REFUSED[name]
    code, answer = answer_of(capsys, verb, case_file(tmp_path, tables))
    assert (code, answer["error"]["field"]) == (2, field)


@pytest.mark.parametrize("verb", ["run", "simulate"])
def test_a_bar_that_buckles_is_refused_with_the_reason(capsys, tmp_path, verb):
    thin = case_file(tmp_path, "[workpiece]\ndiameter_mm = 2.0\nlength_mm = 300.0")
    code, answer = answer_of(capsys, verb, thin)
    assert code == 3
    assert "more than a millimetre" in answer["reason"]
    assert "which may buckle" in answer["reason"]
    assert any(doubt.startswith("feed_force_n should be at most 0.4") for doubt in answer["doubts"])
    assert answer["chatter_hz"] is None


def test_a_shift_beyond_the_model_is_refused_whatever_the_limits_say(capsys, tmp_path):
    wide = case_file(tmp_path, "[limits]\nshift_deg = 25.0\ntarget_deg = 24.0")
    code, answer = answer_of(capsys, "simulate", wide, "--shift-deg", 21)
    assert (code, answer["error"]["field"]) == (2, "shift-deg")


def test_the_machine_says_it_before_it_waits(capsys, tmp_path):
    tables, words = FLAGGED["depth beyond the nose"]
    code, said = ended(
        capsys, "machine", case_file(tmp_path, tables), "--listen", "tcp/127.0.0.1:0", "--wait-s", 0.1, "--json"
    )  # fmt: skip
    assert code == 3
    assert f"note: outside the range of the model: {words}" in said.err


def test_the_largest_shift_of_a_run_counts():
    case = load_case("thesis-652")
    assert doubts_of(case, math.radians(4.5)) == ()
    (doubt,) = doubts_of(case, math.radians(-21.0))
    assert doubt == "shift_deg should be in -20...20, got -21: the tool no longer keeps its angles"


def test_the_end_of_the_cut_counts(tmp_path):
    """A stub that is turned thin at its tip rings higher as the cut goes on."""
    stub = "[workpiece]\nlength_mm = 85.0\nturned_length_mm = 10.0\nfinished_diameter_mm = 15.0\n"
    case = load_case(str(case_file(tmp_path, stub + "[cutting]\ncutting_stiffness_n_per_m = 1e5")))
    assert doubts_of(case, length=1e-3) == ()
    assert [doubt.split()[0] for doubt in doubts_of(case, length=40e-3)] == [
        "natural_frequency_hz", "stiffened_frequency_hz",
    ]  # fmt: skip


def test_rows_of_a_cut_outside_the_range_say_so():
    inside, outside = (row.doubts for row in depth_rows(study_depth("lumped", 1))[1::2][:2])
    assert [doubt.split()[0] for doubt in inside] == ["feed_per_tool_mm"]
    assert {doubt.split()[0] for doubt in outside} == {"feed_per_tool_mm", "depth_of_cut_mm"}


def test_a_doubt_in_words_has_its_unit():
    doubt = Doubt(name="spindle_hz", value=5.0, least=10.0, most=50.0, reason="so")
    assert in_words(doubt) == "spindle_speed_rpm should be in 600...3000, got 300: so"
    assert str(doubt) == "spindle_hz should be in 10...50, got 5: so"


def test_a_sweep_and_a_chart_say_it_too(capsys, tmp_path):
    code, answer = answer_of(
        capsys, "sweep", "thesis-652", "--depth-mm", "0.2,0.45", "--linear", "--workers", 1, "--out", tmp_path
    )
    assert (code, answer["doubted"]) == (0, 1)
    assert [doubt.split(":")[0] for doubt in answer["doubts"]] == ["depth_of_cut_mm should be at most 0.4, got 0.45"]
    assert "got 0.45" in (tmp_path / "sweep.csv").read_text(encoding="utf-8").splitlines()[-1]
    deep = case_file(tmp_path, FLAGGED["depth beyond the nose"][0])
    code, answer = answer_of(capsys, "chart", "phase", deep, "--cells", 4, "--out", tmp_path)
    assert (code, len(answer["doubts"])) == (0, 1)
