"""`estimate` on recordings of a simulated axis whose force is known."""

import json

import numpy as np
import pytest

from services.cli import app
from services.drives import load_drive
from turning_sim import ServoAxis

FEED = 0.02


def answer(capsys, *arguments, code=0):
    with pytest.raises(SystemExit) as left:
        app.main(["estimate", *map(str, arguments), "--json"])
    said = json.loads(capsys.readouterr().out)
    assert left.value.code == code, said
    return said


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """A cut and an idling run of machine B as CSV, and the true force at the samples."""
    folder, named = tmp_path_factory.mktemp("axis"), load_drive("machine-b")
    rate, samples = named.settings.sample_rate_hz, 8000
    for name in ("cut", "idle"):
        axis = ServoAxis(named.drive, named.control, rate, seed=1)
        at = axis.force_times(samples)
        load = (40.0 + 60.0 * np.sin(2 * np.pi * 37.0 * at)) * (at > 0.25) if name == "cut" else np.zeros(at.size)
        block = axis.advance(FEED * np.arange(samples) / rate, load)
        columns = np.column_stack(
            [np.arange(samples) / rate, 1e3 * block.motor_position, 1e3 * block.stage_position, block.thrust]
        )
        np.savetxt(folder / f"{name}.csv", columns, delimiter=",", fmt="%.10g", comments="",
                   header="time_s,motor_position_mm,stage_position_mm,thrust_n")  # fmt: skip
    return folder, named


def series(folder):
    return np.loadtxt(folder / "force.csv", delimiter=",", skiprows=1)


@pytest.mark.parametrize(
    ("options", "error"),
    [(["--idle"], 4.0), (["--idle", "--estimator", "medob"], 8.0), (["--idle", "--estimator", "blended"], 8.0)],
)
def test_the_force_is_found(recorded, tmp_path, capsys, options, error):
    folder, _ = recorded
    given = [part for option in options for part in ([option, folder / "idle.csv"] if option == "--idle" else [option])]
    said = answer(capsys, folder / "cut.csv", "--drive", "machine-b", *given, "--out", tmp_path)
    time, force = series(tmp_path)[:, :2].T
    there = (time > 0.35) & (time < 0.75) & np.isfinite(force)
    true = 40.0 + 60.0 * np.sin(2 * np.pi * 37.0 * time[there])
    assert np.std(force[there] - true) < error
    assert abs(np.mean(force[there] - true)) < 5.0
    assert said["idle_share"] > 0.5
    assert said["predicted_error_n"] > 0.0
    assert said["samples"] == np.isfinite(force).sum()
    assert (tmp_path / "force.png").stat().st_size > 20_000


def test_without_a_scale_the_motor_tells(recorded, tmp_path, capsys):
    folder, _ = recorded
    path = tmp_path / "motor.csv"
    rows = [line.split(",") for line in (folder / "cut.csv").read_text().splitlines()]
    path.write_text("\n".join(",".join([row[0], row[1], row[3]]) for row in rows))
    said = answer(capsys, path, "--drive", "machine-b")
    assert said["estimator"] == "dob"
    assert any("friction" in note for note in said["notes"])
    refused = answer(capsys, path, "--drive", "machine-b", "--estimator", "load_side", code=2)["error"]
    assert refused["field"] == "estimator"
    assert "no second encoder" in refused["rule"]


def test_gaps_stay_gaps(recorded, tmp_path, capsys):
    folder, _ = recorded
    lines = (folder / "cut.csv").read_text().splitlines()
    path = tmp_path / "gap.csv"
    path.write_text("\n".join([*lines[:3000], *lines[3200:]]))
    said = answer(capsys, path, "--drive", "machine-b", "--out", tmp_path)
    assert np.isnan(series(tmp_path)[2999:3198, 1]).all()
    assert said["samples"] < 7800


def test_what_is_wrong_is_named(recorded, tmp_path, capsys):
    folder, _ = recorded
    cut = folder / "cut.csv"
    assert answer(capsys, cut, "--drive", "nothing", code=2)["error"]["field"] == "drive"
    assert answer(capsys, cut, "--drive", "machine-b", "--estimator", "x", code=2)["error"]["field"] == "estimator"
    fitted = answer(capsys, cut, "--drive", "machine-b", "--estimator", "fitted", code=2)["error"]
    assert fitted["field"] == "speed-rpm"
    slow = tmp_path / "slow.csv"
    slow.write_text("\n".join((folder / "idle.csv").read_text().splitlines()[0:1]
                              + (folder / "idle.csv").read_text().splitlines()[1::3]))  # fmt: skip
    assert answer(capsys, cut, "--drive", "machine-b", "--idle", slow, code=2)["error"]["field"] == "idle"
