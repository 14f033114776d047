"""What a benchmark sends must be what the loop sends; the speeds themselves are no test."""

import math

import numpy as np

from services.bench import delay, loop
from services.bench.transport import _sizes, sample_block
from services.cli.bench import table_of
from services.messages import SampleBlock
from services.wire import decode, encode


def test_the_block_of_the_benchmark_travels():
    block = sample_block(7)
    assert decode(SampleBlock, encode(block)).sequence == 7


def test_the_bare_round_trip_carries_as_many_bytes():
    assert all(size > 100 for size in _sizes())


def test_the_delay_table_has_a_row_for_each_peer_and_the_errors_hold(monkeypatch):
    """Small sizes; the speeds are no test. A peer that is not installed has a row that says so."""
    monkeypatch.setattr(delay.peers, "why_no_jitcdde", lambda: "not installed")
    monkeypatch.setattr(delay, "CONTACT_PEERS", (144e3,))
    monkeypatch.setattr(delay, "DOP853_S", 0.01)
    said = []
    rows = delay.measure(seconds=0.5, contact_s=0.3, runs=20, rounds=1, say=said.append)
    assert all({*row} == {"case", "ours", "peer", "ratio", "unit"} and row["ours"] > 0.0 for row in rows)
    absent = [row for row in rows if row["peer"] is None]
    assert [row["case"].split("beside ")[1] for row in absent] == [
        "jitcdde rtol 1e-5 (not installed)", "jitcdde rtol 1e-7 (not installed)",
    ]  # fmt: skip
    errors = {row["case"]: row for row in rows if row["case"].endswith(": error")}
    assert len(errors) == 5
    assert all(row["ours"] < 1e-8 and row["ours"] < row["peer"] < 0.1 for row in errors.values())
    growth = rows[-1]
    assert "median error of the growth" in growth["case"]
    assert max(growth["ours"], growth["peer"]) < 1e-2
    assert len(said) == 3
    assert table_of(rows).count("-  ") >= 2


def test_the_loop_table_says_how_much_faster_than_real_time():
    rows = loop.measure(seconds=0.2, rounds=1)
    assert [row["peer"] for row in rows] == [1.0, 1.0]
    assert all(row["ratio"] == row["ours"] > 0.0 for row in rows)


def test_estimators_are_set_beside_the_default_on_the_loop():
    from services.bench.estimators import DEFAULT, measure

    rows = measure(seeds=1, blocks=2, names=(DEFAULT, "dob"))
    assert len(rows) == 8
    assert set(rows[0]) == {"case", "ours", "peer", "ratio", "unit"}
    ended = {row["case"].split(":")[0]: row["ours"] for row in rows if "chatter ended" in row["case"]}
    assert ended == {DEFAULT: 1.0, "dob": 0.0}


def test_the_chart_agrees_with_a_nyquist_count_and_the_table_says_so():
    from services.bench.stability import measure

    rows = measure(cells=16, rounds=1, sweep_mm=0.0)
    assert [row["ours"] for row in rows if "differ from the Nyquist" in row["case"]] == [0.0]
    assert all(set(row) == {"case", "ours", "peer", "ratio", "unit"} for row in rows)


def test_semi_discretisation_sees_the_same_border():
    from pitch import OneModeProcess, critical_stiffness
    from services.bench.stability_peers import nyquist_column, semi_discretised

    bar = OneModeProcess(0.188, 421.0, 0.03)
    limit, _ = critical_stiffness(bar, 20.0, math.radians(5.52))
    assert semi_discretised(bar, 20.0, math.radians(5.52), 0.95 * limit, 200)
    assert not semi_discretised(bar, 20.0, math.radians(5.52), 1.05 * limit, 200)
    assert nyquist_column(bar, 20.0, math.radians(5.52), limit * np.array([0.999, 1.001])).tolist() == [0.0, 1.0]
