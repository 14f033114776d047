"""The numbers of a run against runs whose numbers are known by construction."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from services import metrics
from services.metrics import summarize
from tests.services.synthetic import CHATTER_HZ, FEED_MM_S, RATE_HZ, SHIFT_DEG, event, make_record, with_twin

CONTRACT_KEYS = [
    "case", "seed", "chatter_onset_s", "detected_s", "detection_latency_s", "chatter_hz",
    "pitch_difference_deg", "shift_deg", "first_command_s", "suppressed_s", "ra_before_um", "ra_after_um",
    "marked_length_mm", "commands_accepted", "commands_rejected", "commands_late", "blocks_lost", "loop_p50_ms",
    "loop_p99_ms", "real_time_factor", "total_wall_s",
]


@settings(max_examples=25)
@given(st.floats(500.0, 800.0), st.floats(0.1, 100.0), st.floats(0.0, 6.0))
def test_the_envelope_of_a_sine_is_its_amplitude(frequency_hz, amplitude, phase):
    time_s = np.arange(4500) / RATE_HZ
    wave = amplitude * np.sin(2 * np.pi * frequency_hz * time_s + phase) + 30.0
    inner = metrics.vibration_envelope(wave, RATE_HZ, (400.0, 1000.0))[900:-900]
    np.testing.assert_allclose(inner, amplitude, rtol=0.06)
    assert abs(inner.mean() / amplitude - 1.0) < 0.01


def test_the_envelope_has_no_delay():
    time_s = np.arange(9000) / RATE_HZ
    burst = np.exp(-(((time_s - 0.5) / 0.05) ** 2)) * np.sin(2 * np.pi * CHATTER_HZ * time_s)
    envelope = metrics.vibration_envelope(burst, RATE_HZ, (489.0, 815.0))
    centre = np.sum(envelope * time_s) / np.sum(envelope)
    assert abs(centre - 0.5) < 2e-4


@given(st.lists(st.booleans(), max_size=60), st.integers(1, 8), st.integers(0, 10))
def test_first_held_is_the_plain_search(bits, hold, start):
    start = min(start, len(bits))
    plain = [i for i in range(start, len(bits) - hold + 1) if all(bits[i : i + hold])]
    assert metrics.first_held(np.array(bits, dtype=bool), hold, start) == (plain[0] if plain else None)


@settings(max_examples=15)
@given(st.floats(15.0, 60.0), st.floats(0.3, 2.0))
def test_onset_is_where_the_amplitude_passes_the_threshold(rate_1_s, start_um):
    record = make_record(rate_1_s=rate_1_s, start_um=start_um, duration_s=3.0, detected_s=None)
    expected = max(2.0 + np.log(3.75 / start_um) / rate_1_s, 2.05)
    onset = metrics.onset_time(record)
    assert onset is not None
    # The ring of the entry, still 1.7 um after a revolution, adds to the growth; it can only make onset earlier.
    assert expected - 0.025 <= onset <= expected + 0.003


def test_a_run_that_goes_well_gives_every_key_of_the_contract():
    record = make_record()
    values = summarize(record, ra_before_um=6.1, ra_after_um=1.6, total_wall_s=3.0).as_dict()
    assert set(CONTRACT_KEYS) <= set(values)
    assert all(values[key] is not None for key in CONTRACT_KEYS)
    assert values["outcome"] == "suppressed"
    assert values["chatter_hz"] == pytest.approx(CHATTER_HZ + 0.4)
    assert values["shift_deg"] == SHIFT_DEG
    assert values["pitch_difference_deg"] == 2 * SHIFT_DEG
    assert values["detected_s"] == values["first_command_s"] == pytest.approx(2.19)
    assert values["detection_latency_s"] == pytest.approx(2.19 - values["chatter_onset_s"])
    assert values["real_time_factor"] == pytest.approx(60.0)
    assert (values["moves"], values["max_shift_deg"]) == (1, pytest.approx(SHIFT_DEG, rel=1e-6))


def test_suppressed_is_when_the_amplitude_falls_through_the_threshold():
    record = make_record()
    top = 0.02 * np.exp(30.0 * 0.25)
    assert metrics.suppressed_time(record) == pytest.approx(2.25 + np.log(top / 3.75) / 60.0, abs=0.008)


def test_marked_length_is_feed_rate_times_time_above():
    record = make_record()
    summary = summarize(record)
    assert summary.marked_length_mm == pytest.approx(
        FEED_MM_S * (summary.suppressed_s - summary.chatter_onset_s), abs=FEED_MM_S * 0.002
    )
    assert summary.marked_length_twin_mm == pytest.approx(FEED_MM_S * (6.0 - summary.chatter_onset_s), abs=0.01)


def test_without_chatter_nothing_has_a_time():
    values = summarize(make_record(start_um=0.0, detected_s=None)).as_dict()
    nothing = [
        "chatter_onset_s", "detected_s", "detection_latency_s", "chatter_hz", "pitch_difference_deg",
        "shift_deg", "first_command_s", "first_shift_s", "suppressed_s", "gave_up_reason",
    ]
    assert [values[key] for key in nothing] == [None] * len(nothing)
    assert (values["outcome"], values["marked_length_mm"], values["moves"]) == ("stable", 0.0, 0)


def test_chatter_that_is_never_suppressed():
    summary = summarize(make_record(calm=False))
    assert (summary.outcome, summary.suppressed_s) == ("not_suppressed", None)
    assert summary.marked_length_mm == pytest.approx(summary.marked_length_twin_mm)


def test_leaving_the_part_is_not_suppression():
    record = make_record(calm=False)
    gone = np.arange(record.controlled.in_cut.size) / RATE_HZ > 3.0
    quiet = replace(
        record.controlled,
        in_cut=np.where(gone, 0.0, record.controlled.in_cut),
        vibration_um=np.where(gone, 0.0, record.controlled.vibration_um),
    )
    assert metrics.suppressed_time(replace(record, controlled=quiet)) is None


def test_a_move_before_the_threshold_is_passed():
    summary = summarize(make_record(start_um=0.05, rate_1_s=20.0, detected_s=2.12))
    assert summary.outcome == "prevented"
    assert summary.detection_latency_s < 0.0
    assert summary.marked_length_mm == 0.0
    assert summary.suppressed_s == summary.first_shift_s == pytest.approx(2.16, abs=0.02)


@pytest.mark.parametrize(
    ("record", "outcome"),
    [
        (make_record(duration_s=1.0, detected_s=None, interrupted=True), "no_cut"),
        (make_record(duration_s=0.0, detected_s=None, interrupted=True), "no_cut"),
        (make_record(detected_s=None), "missed"),
        (make_record(shift_deg=None), "not_moved"),
        (make_record(start_um=0.0, detected_s=None, kind="forced"), "forced"),
        (make_record(duration_s=2.4, interrupted=True), "undecided"),
        (make_record(calm=False, events=[event(2.5, "give_up", "no pitch within 6 deg")]), "gave_up"),
        (with_twin(make_record(), vibration_um=np.zeros(54000)), "false_alarm"),
    ],
)
def test_the_outcome_in_one_word(record, outcome):
    assert summarize(record).outcome == outcome


def test_a_guard_armed_late_commands_nothing_before():
    record = make_record(detected_s=3.0)
    silent = record.reports.first_sample / RATE_HZ < 2.985
    requested = np.where(silent, np.nan, record.reports.shift_requested_deg)
    late = replace(record, reports=replace(record.reports, shift_requested_deg=requested))
    assert summarize(late).first_command_s == summarize(record).first_command_s
    assert (summarize(late).moves, summarize(late).outcome) == (1, "suppressed")


@given(st.floats(-4.0, 4.0))
def test_holding_where_the_turret_stands_is_no_move(shift_deg):
    record = make_record(duration_s=0.2, detected_s=None)
    there = replace(record.controlled, shift_applied_deg=np.full(1800, shift_deg) + 1e-3)
    reports = replace(record.reports, shift_requested_deg=np.full(20, shift_deg))
    assert metrics.command_blocks(replace(record, controlled=there, reports=reports)).size == 0


def test_an_empty_run_has_no_numbers_and_no_error():
    values = summarize(make_record(duration_s=0.0, detected_s=None, interrupted=True)).as_dict()
    assert values["interrupted"] is True
    assert all(values[key] is None for key in ("marked_length_mm", "loop_p50_ms", "real_time_factor", "limit_source"))


def test_the_reason_for_giving_up_is_kept():
    record = make_record(events=[event(2.5, "give_up", "no pitch within 6 deg")])
    assert summarize(record).gave_up_reason == "no pitch within 6 deg"


@settings(max_examples=10)
@given(st.integers(100, 1500))
def test_a_run_cut_anywhere_has_a_summary(tenths):
    values = summarize(make_record(duration_s=tenths / 400.0, interrupted=True)).as_dict()
    assert values["simulated_s"] == pytest.approx(tenths / 400.0, abs=1e-3)


def test_a_forced_vibration_is_no_detection():
    record = make_record(start_um=0.0, detected_s=None, kind="forced")
    assert metrics.detection_block(record) is None
    assert record.reports.first_sample[metrics.forced_block(record)] / RATE_HZ == pytest.approx(2.5, abs=0.02)
