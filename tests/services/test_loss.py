"""A lost controller, held or returned: the figure and the numbers that show why the job must choose."""

import json

import pytest

from services.cli import app


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    folder = tmp_path_factory.mktemp("loss")
    with pytest.raises(SystemExit) as ended:
        app.main(["loss", "thesis-652", "--out", str(folder)])
    assert ended.value.code == 0
    return folder, json.loads((folder / "loss.json").read_text())


def test_held_it_stays_silent_and_returned_the_chatter_comes_back(found):
    hold, back = found[1]["jobs"]
    assert [span["state"] for span in hold["states"]] == ["ACTIVE", "HOLDING", "FAULT"]
    assert [span["state"] for span in back["states"]] == ["ACTIVE", "HOLDING", "RETURNING", "FAULT"]
    assert hold["shift_after_deg"] == pytest.approx(hold["shift_before_deg"], abs=0.01)
    assert back["shift_after_deg"] == pytest.approx(0.0, abs=0.01)
    assert hold["vibration_after_um"] < 2.0 * hold["vibration_before_um"]
    assert back["vibration_after_um"] > 20.0 * back["vibration_before_um"]


def test_every_step_of_the_ladder_comes_at_its_time(found):
    lost = found[1]["lost_at_s"]
    for job in found[1]["jobs"]:
        steps = {"HOLDING": 0.3, "RETURNING": 1.0, "FAULT": 2.0}
        for span in job["states"][1:]:
            assert span["from_s"] - lost == pytest.approx(steps[span["state"]], abs=0.011)
    assert found[1]["jobs"][0]["feed_hold_from_s"] == pytest.approx(lost + 0.3, abs=0.011)
    assert found[1]["jobs"][1]["feed_hold_from_s"] is None


def test_the_figure_is_there(found):
    assert (found[0] / "loss.png").stat().st_size > 20_000


def test_wrong_use(capsys):
    with pytest.raises(SystemExit) as ended:
        app.main(["loss", "--lost-at-s", "0.1", "--json"])
    assert ended.value.code == 2
    assert "lost-at-s" in capsys.readouterr().out
