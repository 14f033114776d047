"""`compare`: the milling rows of the thesis, what the options do, and what is refused."""

import json

import numpy as np
import pytest

from services.cli.app import _run
from services.compare import compare
from services.drives import load_drive
from services.errors import InputError

PRINTED = {1: (0.70, 0.55, 0.25), 2: (1.11, 1.73, 0.81), 3: (0.40, 0.044, 0.030), 4: (1.06, 0.54, 0.23)}
"""Error ratios of thrust, DOB, and MEDOB with half the mass, machine A without lags; each within 20 %."""
FAMILY = ("medob", "vibration", "load_side", "blended", "optimal", "fitted")


def ratios(condition, **options):
    return {one.name: one.error_ratio for one in compare(load_drive("machine-a"), condition, **options)[1]}


@pytest.mark.parametrize("condition", PRINTED)
def test_milling_of_the_thesis_errs_as_published(condition):
    found = ratios(condition)
    thrust, dob, half = PRINTED[condition]
    assert found["thrust"] == pytest.approx(thrust, rel=0.2)
    assert found["dob"] == pytest.approx(dob, rel=0.2)
    assert all(found[name] <= 0.04 for name in FAMILY)
    wrong = ratios(condition, mass_error=0.5, names=("medob", "vibration"))
    np.testing.assert_allclose(list(wrong.values()), half, rtol=0.2)


def test_dead_times_compensated_do_no_harm_and_left_alone_ten_times_as_much():
    names = ("medob", "vibration", "load_side")
    full = ratios(2, lags=True, names=names)
    none = ratios(2, lags=True, compensation=False, names=names)
    assert max(full.values()) <= 0.04
    assert all(none[name] >= 10.0 * full[name] for name in names)


def test_counts_leave_what_was_predicted():
    _, found = compare(load_drive("machine-a"), 4, sensors="real", lags=True, names=("medob", "fitted"))
    for one in found:
        assert one.error_std_n == pytest.approx(one.predicted_error_n, rel=0.2)


def test_real_sensors_favour_little_weight_on_the_motor():
    found = ratios(2, sensors="real", lags=True)
    assert found["load_side"] < found["vibration"] < found["medob"]
    assert found["optimal"] < 1.05 * min(found[name] for name in ("medob", "vibration", "load_side"))


def test_a_drive_without_a_scale_has_three_estimators():
    _, found = compare(load_drive("emps"), 3)
    assert [one.name for one in found] == ["thrust", "dob", "kalman"]
    with pytest.raises(InputError, match="estimator must be one of thrust, dob, kalman"):
        compare(load_drive("emps"), 3, names=("medob",))


def test_the_verb_answers_in_json_and_writes(tmp_path, capsys):
    assert _run(["compare", "--condition", "2", "--estimator", "medob", "--out", str(tmp_path), "--json"], True) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["condition"] == 2
    assert {"estimator", "error_ratio", "error_std_n", "gain_335hz"} <= set(answer["rows"][0])
    assert answer["rows"][0]["lambda"] == 1.0
    assert sorted(p.name for p in tmp_path.iterdir()) == ["comparison.csv", "comparison.png"]
    assert _run(["compare", "--condition", "3"], False) == 0
    assert "kalman" in capsys.readouterr().out


@pytest.mark.parametrize(
    "wrong", [["--condition", "5"], ["--mass-error", "0"], ["--drive", "machine-c"], ["--sensors", "none"]]
)
def test_wrong_options_are_named(wrong, capsys):
    assert _run(["compare", *wrong, "--json"], True) == 2
    error = json.loads(capsys.readouterr().out)["error"]
    assert error["field"] == wrong[0].lstrip("-")
