"""A short soak with real processes."""

import json

import pytest

from services.cli import app

pytestmark = pytest.mark.system


def test_no_block_is_lost_silently_through_a_cut_of_the_link(capsys, tmp_path):
    wishes = ["--duration-s", "8", "--cut-every-s", "4", "--dashboards", "1"]
    with pytest.raises(SystemExit) as ended:
        app.main(["soak", *wishes, "--out", str(tmp_path), "--json"])
    answer = json.loads(capsys.readouterr().out)
    assert (ended.value.code, answer["blocks_lost_silently"], answer["link_cuts"]) == (0, 0, 1), answer
    assert answer["blocks_sent"] == 800
    assert answer["heard"]["recorder"]["blocks"] + answer["heard"]["recorder"]["counted_missing"] == 800
    assert answer["frames_per_s"][0] > 2.0
    assert 0.0 < answer["age_p50_ms"] <= answer["age_p99_ms"] <= answer["age_max_ms"]
    assert (tmp_path / "soak.mcap").stat().st_size > 100_000
