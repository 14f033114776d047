"""Sweeps: what axes mean, that a kill loses nothing, that results do not depend on where they were computed."""

import csv
import json

import numpy as np
import pytest
import xarray as xr

from services.cli.app import _run
from services.clock import WallClock
from services.config import load_case
from services.errors import InputError
from services.sweep.axes import cells_of, grid, parse_axis
from services.sweep.cell import Job, Task, case_of, run_cell
from services.sweep.store import FILE
from services.sweep.sweep import run_sweep

CASE = load_case("thesis-652")
AXES = (parse_axis("phase", "0.6:1.4:0.4"), parse_axis("stiffness", "0.8,1.0"))


def swept(folder=None, **changes):
    seen = []
    asked = {
        "mode": "linear", "seed": 1, "length_mm": 2.0, "workers": 1, "scheduler": None, "fresh": False,
        "clock": WallClock(), "progress": lambda done, total: seen.append((done, total)),
    } | changes  # fmt: skip
    return run_sweep(
        CASE, changes.pop("axes", AXES), folder=folder, **{k: v for k, v in asked.items() if k != "axes"}
    ), seen


def test_axes_hold_both_ends():
    assert parse_axis("phase", "0.5:1.5:0.1").values == tuple(round(0.5 + 0.1 * k, 12) for k in range(11))
    assert parse_axis("noise", "0.1:0.02:-0.04").values == (0.1, 0.06, 0.02)
    assert parse_axis("speed-rpm", "1200").values == (1200.0,)
    assert parse_axis("estimator", "medob,load_side").values == ("medob", "load_side")
    assert cells_of(AXES) == 6
    assert [number for number, _ in grid(AXES)] == list(range(6))
    assert list(grid(AXES))[1][1] == {"phase_pi": 0.6, "stiffness_ratio": 1.0}


@pytest.mark.parametrize("text", ["a", "1:2", "1:2:0", "1:2:-1", "1,1", "nan", "1:inf:1", "", "0:1:1e-9"])
def test_axes_that_make_no_sense_are_named(text):
    with pytest.raises(InputError, match="phase must be"):
        parse_axis("phase", text)


def test_too_many_cells_are_refused():
    with pytest.raises(InputError, match="cells must be at most 1000000"):
        cells_of([parse_axis("phase", "0:9.99:0.01"), parse_axis("noise", "0.001:1.1:0.001")])


def test_cells_are_shaped_like_their_axes():
    done, seen = swept()
    assert done.values("growth_rate_1_s").shape == (3, 2)
    assert done.stable_band() == (1.0, 1.0)
    assert (done.state == 1).all()
    assert seen[-1] == (6, 6)
    assert done.failed == 0


def test_deeper_cuts_are_stiffer_and_rubbed_more():
    task = Task(name=CASE.name, text=CASE.text, mode="linear", seed=1, length_mm=2.0)
    deep, phase, seed = case_of(task, Job(number=0, values={"depth_mm": 0.3, "phase_pi": 1.0, "seed": 7.0}))
    assert (phase, seed) == (pytest.approx(np.pi), 7)
    assert 1.0 < deep.cutting.cutting_stiffness / CASE.cutting.cutting_stiffness < 1.3
    ratio = deep.cutting.chip.edge_length / CASE.cutting.chip.edge_length
    assert deep.cutting.process_damping == pytest.approx(ratio * CASE.cutting.process_damping)
    same, _, _ = case_of(task, Job(number=0, values={"depth_mm": 0.2}))
    assert same.cutting.cutting_stiffness == pytest.approx(CASE.cutting.cutting_stiffness)


def test_a_cell_that_cannot_be_says_why_and_the_others_go_on():
    done, _ = swept(axes=(parse_axis("phase", "1.0,19.0"),))
    assert done.failed == 1
    assert list(done.state) == [1, 2]
    assert "phase must be within a shift of 20 deg" in done.results[1]["failed"]
    assert done.as_dict()["reasons"] == [done.results[1]["failed"]]
    task = Task(name=CASE.name, text=CASE.text, mode="open", seed=1, length_mm=2.0)
    assert "length_mm" in run_cell(task, Job(number=0, values={"overhang_mm": 0.0}))["failed"]


def test_a_kill_repeats_only_what_was_not_finished(tmp_path):
    whole, _ = swept(tmp_path)
    lines = (tmp_path / FILE).read_bytes().split(b"\n")
    (tmp_path / FILE).write_bytes(b"\n".join(lines[:4]) + b"\n" + lines[4][:17])  # three whole cells and a torn one
    again, seen = swept(tmp_path)
    assert (again.resumed, again.damaged) == (3, 1)
    assert seen[0] == (3, 6)
    assert again.results == whole.results
    third, _ = swept(tmp_path)
    assert (third.resumed, third.damaged) == (6, 0)


@pytest.mark.parametrize(
    "line",
    [
        b'{"cell": 999, "result": {"stable": true}}',
        b'{"cell": -1, "result": {"stable": true}}',
        b'{"cell": 1, "result": {"stable": "yes"}}',
        b'{"cell": 1, "result": {"growth_rate_1_s": [1]}}',
        b'{"cell": 1, "result": {"failed": 3}}',
        b'{"cell": "one", "result": {}}',
        b'{"cell": 1}',
        b"[1, 2]",
        b"\xff\xfe\x00",
    ],
)
def test_a_corrupted_line_is_counted_and_its_cell_computed_again(tmp_path, line):
    whole, _ = swept(tmp_path)
    lines = (tmp_path / FILE).read_bytes().split(b"\n")
    (tmp_path / FILE).write_bytes(b"\n".join([*lines[:2], line, *lines[3:]]))
    again, _ = swept(tmp_path)
    assert (again.resumed, again.damaged) == (5, 1)
    assert again.results == whole.results


def test_cells_not_run_are_marked_and_can_be_made_up_for(tmp_path):
    part, _ = swept(tmp_path, most=2)
    assert (part.state == 0).sum() == 4
    assert part.as_dict()["not_run"] == 4
    assert np.isnan(part.values("growth_rate_1_s")).sum() == 4
    rest, _ = swept(tmp_path)
    assert rest.resumed == 2
    assert (rest.state == 1).all()


def test_another_sweep_in_the_folder_is_refused(tmp_path):
    swept(tmp_path)
    with pytest.raises(InputError, match="it differs in seed"):
        swept(tmp_path, seed=2)
    fresh, _ = swept(tmp_path, seed=2, fresh=True)
    assert fresh.resumed == 0
    (tmp_path / FILE).write_bytes(b"\x00\xff not a sweep")
    with pytest.raises(InputError, match="a sweep that can be read"):
        swept(tmp_path, seed=2)


def test_any_number_of_workers_gives_the_same():
    assert swept(workers=2)[0].results == swept(workers=1)[0].results


def test_open_cuts_chatter_where_theory_says():
    done, _ = swept(mode="open", axes=(parse_axis("phase", "0.5,0.9"),))
    np.testing.assert_array_equal(done.values("stable"), [0.0, 1.0])
    assert done.stable_band() == (0.9, 0.9)


def test_the_loop_is_swept_too():
    short = json.loads(CASE.text)
    short["case"] |= {"air_time_s": 1.0, "cut_time_s": 1.6}
    task = Task(name="short", text=json.dumps(short), mode="closed", seed=1, length_mm=2.0)
    result = run_cell(task, Job(number=0, values={"phase_pi": 0.9}))
    assert result["stable"] is True
    assert result["shift_deg"] == pytest.approx(2.5, abs=0.4)
    assert result["moves"] == 1


def test_the_verb_writes_netcdf_csv_and_a_map(tmp_path, capsys):
    arguments = [
        "sweep",
        "thesis-652",
        "--phase",
        "0.8:1.2:0.2",
        "--stiffness",
        "0.9,1.1",
        "--linear",
        "--workers",
        "1",
    ]
    assert _run([*arguments, "--limit", "5", "--out", str(tmp_path), "--json"], True) == 0
    answer = json.loads(capsys.readouterr().out)
    assert (answer["runs"], answer["failed"], answer["not_run"]) == (5, 0, 1)
    assert {"wall_s", "stable_band_pi"} <= set(answer)
    with xr.open_dataset(tmp_path / "sweep.nc", engine="scipy") as file:
        assert dict(file.sizes) == {"phase_pi": 3, "stiffness_ratio": 2}
        assert file["growth_rate_1_s"].attrs["units"] == "1/s"
        assert int((file["state"] == 0).sum()) == 1
    with (tmp_path / "sweep.csv").open() as table:
        rows = list(csv.DictReader(table))
    assert [row["state"] for row in rows] == ["done"] * 5 + ["not run"]
    assert (tmp_path / "sweep.png").stat().st_size > 10_000
    assert _run([*arguments, "--out", str(tmp_path)], False) == 0
    assert "6 cells" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("wrong", "field"),
    [
        (["--phase", "1:0:0.1"], "phase"),
        (["--closed-loop", "--linear"], "linear"),
        (["--workers", "0"], "workers"),
        (["--limit", "0"], "limit"),
        (["--feed-length-mm", "-1"], "feed-length-mm"),
    ],
)
def test_wrong_options_are_named(wrong, field, capsys):
    assert _run(["sweep", "thesis-652", *wrong, "--json"], True) == 2
    assert json.loads(capsys.readouterr().out)["error"]["field"] == field
