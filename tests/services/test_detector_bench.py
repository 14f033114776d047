"""The benchmark of the detector as a whole, with a handful of cuts."""

import csv
import json
import math

import pytest

from services.bench.detector import measure as bench
from services.bench.detector.ours import DEFAULT, settings
from services.bench.detector.rivals import LEVELS, NAMES
from services.bench.detector.tally import OURS, Point, as_quick, curves, silent
from services.bench.detector.trial import onset_trial, pair_trial, stable_trial
from services.bench.detector.work import Job, perform_all
from services.cli import app
from services.figures.detector import detector_figure
from tests.services.detector_kit import process

TURRETS = ("thesis-652",)
TINY = bench.Size(onsets=1, pairs=0, stable=1, cut_s=2.0, sweep_every=2)


@pytest.fixture(scope="module")
def trials():
    return [
        *(onset_trial(1, number, TURRETS) for number in range(3)),
        *(stable_trial(1, number, 4.0, TURRETS, sweep=number == 0) for number in range(5)),
        pair_trial(1, 0, TURRETS),
    ]


def test_an_onset_is_judged_in_full(trials):
    for one in trials[:3]:
        assert one["onset_s"] > one["growth_from_s"] >= one["entry_s"]
        assert one["latency_ms"] == pytest.approx(1e3 * (one["detected_s"] - one["onset_s"]))
        assert one["excess_ms"] == pytest.approx(one["latency_ms"] - one["least_ms"])
        assert one["ours"][DEFAULT] == one["latency_ms"]
        speed = one["feed_per_rev_mm"] * one["spindle_speed_rpm"] / 60.0
        assert one["marked_mm"] == pytest.approx(max(1e-3 * one["latency_ms"], 0.0) * speed)
        for rival in NAMES:
            late = one["rivals"][rival]["latency_ms"]
            heard = [value for value in late if value is not None]
            assert len(late) == LEVELS.size
            assert heard == sorted(heard)  # a higher threshold is never quicker


@pytest.mark.parametrize(("seed", "number", "worst_ms"), [(21, 125, 70.0), (21, 215, 40.0), (21, 187, 55.0)])
def test_lines_10_hz_apart_at_a_slow_spindle_are_told_by_their_growth(seed, number, worst_ms):
    cut = onset_trial(seed, number, bench.TURRETS)
    assert cut["spindle_speed_rpm"] < 700.0
    assert cut["latency_ms"] < worst_ms


def test_a_stable_cut_counts_false_alarms(trials):
    stable = trials[3:8]
    assert [one["kind"] for one in stable] == ["passes", "speed", "feed", "knocks", "slots"]
    assert all(one["cut_s"] == pytest.approx(4.0) for one in stable)
    assert all(one["ours"][DEFAULT] == len(one["alarms"]) for one in stable)
    assert len(stable[0]["ours"]) > 1
    assert list(stable[1]["ours"]) == [DEFAULT]
    for one in stable:
        for rival in NAMES:
            counts = one["rivals"][rival]
            assert counts == sorted(counts, reverse=True)  # a higher threshold never alarms more often


def test_the_table_has_every_number_and_the_files_can_be_read(trials, tmp_path):
    outcome = bench.evaluate(trials)
    assert all({*row} == {"case", "ours", "peer", "ratio", "unit"} for row in outcome.rows)
    numbers, onsets, figure, page = outcome.write(tmp_path)
    read = json.loads(numbers.read_text(), parse_constant=lambda name: pytest.fail(name))
    assert read["onsets"] == 3
    assert read["false_alarms"]["hours"] == pytest.approx(5 * 4.0 / 3600.0)
    assert sum(part["count"] for part in read["false_alarms"]["by_kind"].values()) == read["false_alarms"]["count"]
    assert sum(part["onsets"] for part in read["by"]["axes"].values()) == 3
    with onsets.open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 3
    assert float(rows[0]["latency_ms"]) == trials[0]["latency_ms"]
    assert figure.read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"
    lines = page.read_text().splitlines()
    assert len({line.count("|") for line in lines}) == 1


def test_points_are_chosen_for_what_they_are_good_at(trials):
    def point(p50_ms, alarms):
        return Point(
            setting="", p50_ms=p50_ms, p95_ms=2.0 * p50_ms, max_ms=math.inf, missed=0.0, alarms=alarms, hours=2.0
        )

    curve = [point(10.0, 50), point(20.0, 4), point(40.0, 0), point(80.0, 0)]
    assert silent(curve) == curve[2]
    assert silent(curve[:2]) == curve[1]
    assert as_quick(curve, 25.0) == curve[1]
    assert as_quick(curve, 5.0) is None
    assert curve[2].bound_per_hour == pytest.approx(1.498, abs=1e-3)
    assert curves(trials[:3], trials[3:8])[OURS][0].setting == DEFAULT


def test_other_settings_differ_from_the_default_and_from_each_other():
    tried = settings(process().case.monitor)
    assert tried[DEFAULT] == process().case.monitor
    assert len({str(config) for config in tried.values()}) == len(tried) > 3


def test_the_figure_can_be_drawn_of_nothing_and_of_much():
    detector_figure({OURS: []}, names={OURS: "ours"}).draw_without_rendering()
    late = [Point(setting="", p50_ms=math.inf, p95_ms=math.inf, max_ms=math.inf, missed=1.0, alarms=0, hours=1.0)]
    detector_figure({OURS: late, "thesis": late}, names={OURS: "ours", "thesis": "it"}).draw_without_rendering()


def test_the_result_depends_neither_on_the_workers_nor_on_a_pause(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(bench, "SHORT", TINY)
    with pytest.raises(SystemExit) as ended:
        app.main(["bench", "detector", "--workers", "2", "--out", str(tmp_path), "--json"])
    answer = json.loads(capsys.readouterr().out)
    assert ended.value.code == 0
    assert answer["detector"]["onsets"] == TINY.onsets
    kept = tmp_path / "detector-trials.jsonl"
    lines = kept.read_text().splitlines()
    assert len(lines) == 1 + TINY.onsets + TINY.stable
    jobs = bench.jobs_of(TINY, 1, TURRETS)
    two = perform_all(jobs, workers=2, kept=kept, progress=_nothing)
    kept.write_text("\n".join(lines[:2]) + "\n" + lines[2][:40])  # stopped while it wrote a line
    resumed = perform_all(jobs, workers=1, kept=kept, progress=_nothing)
    assert json.dumps(resumed) == json.dumps(two)
    assert list(two) == [job.name for job in jobs]


def test_what_older_code_has_left_does_not_count(tmp_path):
    kept = tmp_path / "detector-trials.jsonl"
    kept.write_text(
        json.dumps({"code": "older"})
        + "\n"
        + json.dumps([json.dumps(Job("onset", 1, 0, 0.0, True, TURRETS)), {}])
        + "\n"
    )
    assert perform_all([], workers=1, kept=kept, progress=_nothing) == {}
    assert kept.read_text().count("\n") == 1


def _nothing(_: float) -> None:
    pass
