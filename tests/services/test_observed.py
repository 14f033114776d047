"""A recording told on its own: whatever it lacks, what it holds is told right, and what it lacks is said."""

import json
from dataclasses import replace

import msgspec
import numpy as np
import pytest

from services.changes import changes_of
from services.closed_loop import judge
from services.errors import InputError, RefusalError
from services.figures import style
from services.figures.recorded import amplitude_spectrum, unrolled, write_recorded_figures
from services.messages import ChatterReport, Event, ForceBlock, MachineState, SampleBlock, Truth
from services.observed import held, observe
from services.recorded_report import ALONE, NO_CONFIG, NO_TRUTH, TRUTH, render_recorded, write_recorded_report
from services.recording_file import RecordingReader
from services.recording_writer import McapRecorder
from services.tape import Tape
from tests.services.test_cli import run
from tests.services.test_recording_file import message_of
from tests.services.test_replay import copy
from tests.services.test_report import read
from turning_sim import SurfaceTrace


@pytest.fixture(scope="module")
def seen(recorded):
    return observe(recorded[0])


@pytest.fixture
def _coarse(monkeypatch):
    """Draw few pixels: these tests look at whether, not at how."""
    monkeypatch.setattr(style, "DPI", 40)


def without(path, target, *kinds, metadata=None):
    return copy(path, target, lambda message: None if isinstance(message, kinds) else message, metadata)


def test_it_tells_what_the_run_itself_told(recorded, seen):
    _, case, tape = recorded
    run = judge(case, 7, tape, interrupted=True)
    told, own = seen.summary.as_dict(), run.summary.as_dict()
    same = own.keys() - {"outcome", "interrupted", "chatter_onset_s", "detection_latency_s", "ra_before_um",
                         "blocks_lost", "marked_length_twin_mm", "peak_vibration_twin_um", "loop_p50_ms",
                         "loop_p99_ms", "real_time_factor", "total_wall_s"}  # fmt: skip
    assert {name: told[name] for name in same} == {name: own[name] for name in same}
    twin = ("chatter_onset_s", "detection_latency_s", "ra_before_um", "marked_length_twin_mm", "peak_vibration_twin_um")
    assert [told[name] for name in twin] == [None] * 5
    assert told["outcome"] == "alarm_ended"
    for name in ("vibration_um", "force_x1_n", "dy1p_um", "z_mm", "in_cut", "ra_um"):
        expected = getattr(run.record.controlled, name)
        np.testing.assert_array_equal(getattr(seen.record.controlled, name), expected)
    np.testing.assert_allclose(seen.record.controlled.shift_applied_deg, run.record.controlled.shift_applied_deg)
    assert seen.notes == ()


def test_every_change_is_told_once_and_in_order(recorded, seen):
    tape = recorded[2]
    times = [change.time_s for change in seen.changes]
    assert times == sorted(times)
    reports = tape.of(ChatterReport)
    turns = sum(a.state != b.state for a, b in zip(reports, reports[1:], strict=False))
    assert sum(" → " in change.what for change in seen.changes if change.who == "monitor") == turns > 2
    said = [change for change in seen.changes if change.what.startswith("guard state: ")]
    assert len(said) == sum(event.kind == "guard_state" for event in tape.of(Event)) > 0
    silent = Tape()
    for message in tape.log:
        if isinstance(message, MachineState) and message.sequence > 200:
            silent.add(msgspec.structs.replace(message, guard_state="FAULT"))
        elif not isinstance(message, Event):
            silent.add(message)
    alone = changes_of(silent, replace(seen.record, events=()))
    [fault] = [change for change in alone if "→ FAULT" in change.what]
    assert (fault.time_s, fault.who) == (pytest.approx(2.02, abs=1e-3), "guard")
    assert fault.what.startswith("ACTIVE → FAULT")


def test_a_recording_that_joined_late_counts_from_its_own_beginning(recorded, tmp_path, seen):
    path = copy(recorded[0], tmp_path / "late.mcap", lambda m: m if m.sequence >= 150 or isinstance(m, Event) else None)
    late = observe(path)
    assert late.record.origin_s == 1.5
    for name in ("entered_cut_s", "detected_s", "first_shift_s", "suppressed_s"):
        assert getattr(late.summary, name) == pytest.approx(getattr(seen.summary, name) - 1.5, abs=1e-9), name
    part = observe(recorded[0], 1.5, 3.0)
    assert part.record.origin_s == 1.5
    assert part.summary.simulated_s == pytest.approx(1.5)


def test_lost_blocks_are_counted_and_held(recorded, tmp_path, seen):
    lost = (40, 41, 300)
    path = copy(recorded[0], tmp_path / "lost.mcap",
                lambda m: None if isinstance(m, ForceBlock | Truth) and m.sequence in lost else m)  # fmt: skip
    gappy = observe(path)
    assert gappy.missing == {"force": 3, "sim/truth": 3}
    assert "3 messages of force are missing" in gappy.notes
    force, whole = gappy.record.controlled.force_x1_n, seen.record.controlled.force_x1_n
    assert set(force[3600:3780]) == {whole[3599]}
    np.testing.assert_array_equal(force[3780:27000], whole[3780:27000])
    assert gappy.summary.first_shift_s == seen.summary.first_shift_s


def test_what_is_missing_is_held_from_before():
    nan = np.nan
    np.testing.assert_array_equal(held(np.array([nan, 1.0, nan, nan, 2.0, nan])), [1.0, 1.0, 1.0, 1.0, 2.0, 2.0])
    assert np.isnan(held(np.array([nan, nan]))).all()


LACKING = {
    "nothing": ((), None, [TRUTH, ALONE]),
    "truth": ((Truth,), None, [NO_TRUTH, ALONE]),
    "configuration": ((), {"version": "0"}, [NO_CONFIG]),
    "truth and configuration": ((Truth,), {}, [NO_TRUTH, NO_CONFIG]),
    "forces": ((ForceBlock, Truth), None, [NO_TRUTH]),
    "samples": ((SampleBlock, Truth), None, [NO_TRUTH]),
    "states": ((MachineState, Truth), None, [NO_TRUTH]),
    "reports": ((ChatterReport,), None, [TRUTH]),
    "all but reports": ((SampleBlock, MachineState, Truth, ForceBlock, Event), {}, [NO_TRUTH, NO_CONFIG]),
}


@pytest.mark.parametrize(("kinds", "metadata", "said"), LACKING.values(), ids=LACKING.keys())
def test_whatever_is_lacking_a_whole_page_says_so(recorded, tmp_path, kinds, metadata, said):
    path = without(recorded[0], tmp_path / "some.mcap", *kinds, metadata=metadata)
    some = observe(path)
    page = render_recorded(some, tmp_path)
    text = " ".join(read(page).text)
    assert all(sentence in text for sentence in said)
    assert "None" not in text
    assert "nan" not in text.replace("nano", "")
    assert all(reference.startswith("data:") for reference in read(page).references)
    if Truth in kinds:
        assert some.summary.marked_length_mm is some.summary.suppressed_s is None
    if ChatterReport not in kinds:
        assert some.summary.chatter_hz == pytest.approx(649, abs=60)


@pytest.mark.usefixtures("_coarse")
@pytest.mark.parametrize("name", ["nothing", "all but reports"])
def test_the_figures_are_in_the_page(recorded, tmp_path, name):
    kinds, metadata, _ = LACKING[name]
    some = observe(without(recorded[0], tmp_path / "some.mcap", *kinds, metadata=metadata))
    trace = some.surface.trace if some.surface else None
    drawn = write_recorded_figures(some.record, some.summary, trace, tmp_path)
    page = write_recorded_report(some, tmp_path).read_text(encoding="utf-8")
    assert len(drawn) == page.count("data:image/png;base64,") == 4


def test_a_recording_broken_off_is_told_as_far_as_it_goes(recorded, tmp_path):
    path = tmp_path / "cut.mcap"
    path.write_bytes(recorded[0].read_bytes()[:-300_000])
    some = observe(path)
    assert 2.2 < some.summary.simulated_s < 3.3
    assert "no end" in " ".join(some.notes)
    assert "no end" in render_recorded(some, tmp_path)


def test_another_run_in_the_same_file_is_left_out_and_said(recorded, tmp_path, seen):
    path = tmp_path / "two.mcap"
    reader = RecordingReader(recorded[0])
    messages = list(reader.messages())
    with McapRecorder(path, reader.metadata) as recorder:
        for again in (False, True):
            for _, message, time in messages[:500]:
                recorder.record(msgspec.structs.replace(message, run="other") if again else message, time, wait=True)
    two = observe(path)
    assert two.run == seen.run
    assert "1 other runs are in the same recording and were left out" in two.notes


def test_what_holds_no_blocks_is_refused(tmp_path):
    path = tmp_path / "run.mcap"
    with McapRecorder(path, {}) as recorder:
        recorder.record(message_of(Event, 1), 0)
    with pytest.raises(RefusalError, match="no blocks"):
        observe(path)
    with pytest.raises(InputError, match="an existing file"):
        observe(tmp_path / "nothing.mcap")


def test_a_spectrum_shows_the_amplitude_of_a_sine():
    at = np.arange(4500) / 9000.0
    frequency, amplitude = amplitude_spectrum(3.0 + 2.5 * np.sin(2 * np.pi * 652.0 * at), 9000.0)
    assert amplitude.max() == pytest.approx(2.5, rel=1e-3)
    assert frequency[amplitude.argmax()] == pytest.approx(652.0, abs=0.5)


def test_the_unrolled_surface_lays_both_tools_side_by_side():
    """Waves of n per turn, left by tool 1 at phase p and by tool 2 half a turn behind it, stand on one line."""
    phase, waves = np.linspace(0.0, 40 * np.pi, 18000), 33
    depth = 1e-6 * np.cos(waves * phase)
    trace = SurfaceTrace(depth, np.cos(waves * (phase - np.pi)) * 1e-6, phase, phase, 0.15e-3 * phase / (2 * np.pi))
    picture, extent = unrolled(trace)
    expected = np.cos(waves * np.linspace(0.0, 2 * np.pi, 361))
    np.testing.assert_allclose(picture, np.repeat(expected[:, None], picture.shape[1], 1), atol=0.02)
    assert extent[1] == pytest.approx(0.15 * 19, abs=0.2)
    assert picture.shape[1] in (38, 39)


@pytest.mark.usefixtures("_coarse")
def test_the_verbs(recorded, tmp_path, capsys):
    path = without(recorded[0], tmp_path / "real.mcap", Truth)
    code, answer = run(capsys, "report", path, "--out", tmp_path / "out")
    assert (code, answer["truth"], answer["outcome"]) == (0, False, "alarm_ended")
    assert (answer["config_sha256"], answer["seed"]) == (recorded[1].digest, 7)
    assert (tmp_path / "out" / "report.html").stat().st_size > 30_000
    code, answer = run(capsys, "replay", path, "--to", 2.5, "--out", tmp_path / "again")
    assert (code, answer["outcome"], answer["same_as_recorded"]) == (0, "alarm_lasts", True)
    assert answer["chatter_onset_s"] is answer["ra_before_um"] is None
    assert json.loads((tmp_path / "again" / "summary.json").read_text())["moves"] == 1
    for verb in ("report", "replay"):
        assert run(capsys, verb, tmp_path / "nothing.mcap")[0] == 2
