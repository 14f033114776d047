"""`chart`: the map agrees with roots of the case, and what is written can be read."""

import csv
import json

import numpy as np
import pytest

from pitch import OneModeProcess, pitch_difference_for_phase, rightmost_root
from services.charts import case_chart
from services.cli.app import _run
from services.config import load_case
from turning_sim import linear_parameters


def test_phases_stable_in_the_map_have_decaying_roots():
    case = load_case("thesis-652", {})
    found = case_chart(case, "phase", cells=24)
    linear = linear_parameters(case.workpiece, case.cutting, case.settings.start_position)
    process = OneModeProcess(
        linear.mass_at_tools, linear.natural_frequency_hz, linear.damping_ratio, linear.overlap, linear.process_damping
    )
    row = 11
    assert found.chart.stiffness[row] == pytest.approx(linear.cutting_stiffness)
    for column in range(0, 24, 3):
        difference = pitch_difference_for_phase(652.0, 20.0, np.pi * found.columns[column])
        root = rightmost_root(process, float(found.chart.stiffness[row]), 20.0, difference)
        assert bool(found.chart.stable[row, column]) == (root.real < 0.0)


def test_the_verb_writes_map_and_cells(tmp_path, capsys):
    arguments = [
        "chart",
        "lobes",
        "thesis-652",
        "--cells",
        "12",
        "--shift-deg",
        "2.76",
        "--out",
        str(tmp_path),
        "--json",
    ]
    assert _run(arguments, True) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["cells"] == 144
    assert {"limit_min", "limit_max", "wall_s"} <= set(answer)
    assert answer["limit_min"] < answer["case_stiffness_n_m"] < answer["limit_max"]
    with (tmp_path / "thesis-652-lobes.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 144
    assert set(rows[0]) == {"speed_rpm", "stiffness_n_per_m", "growing_pairs_count"}
    assert (tmp_path / "thesis-652-lobes.png").stat().st_size > 10_000


def test_phase_and_shift_are_drawn(tmp_path, capsys):
    assert _run(["chart", "phase", "--cells", "10", "--columns", "0:4", "--out", str(tmp_path)], False) == 0
    assert _run(["chart", "shift", "--out", str(tmp_path)], False) == 0
    assert "100 cells" in capsys.readouterr().out
    assert sorted(p.name for p in tmp_path.iterdir()) == ["shift.png", "thesis-652-phase.csv", "thesis-652-phase.png"]


@pytest.mark.parametrize(
    ("wrong", "field"),
    [
        (["pie"], "kind"),
        (["phase", "no-such-case"], "case"),
        (["phase", "--cells", "1"], "cells"),
        (["phase", "--columns", "2"], "columns"),
        (["phase", "--columns", "3:1"], "columns"),
        (["phase", "--columns", "0:900"], "columns"),
        (["lobes", "--columns", "0:900"], "columns"),
        (["lobes", "--shift-deg", "40"], "shift-deg"),
    ],
)
def test_wrong_options_are_named(wrong, field, tmp_path, capsys):
    assert _run(["chart", *wrong, "--out", str(tmp_path), "--json"], True) == 2
    assert json.loads(capsys.readouterr().out)["error"]["field"] == field
