"""The alarms of many recordings, each once, with what became of it."""

import csv

import pytest

from services.errors import InputError
from services.history import COLUMNS, alarms_of, history, recordings_in, write_history
from services.messages import ChatterReport, Truth
from services.observed import observe
from services.recording_writer import McapRecorder, run_metadata
from tests.services.test_cli import run
from tests.services.test_recording_file import message_of
from tests.services.test_replay import copy

RATE_HZ = 9000.0


def report(number, state, frequency_hz=None, kind=None, run="r"):
    import msgspec

    return msgspec.structs.replace(
        message_of(ChatterReport, number), run=run, state=state, frequency_hz=frequency_hz, kind=kind,
        first_sample=90 * number, samples=90,
    )  # fmt: skip


def said(path, states, metadata=None, run="r"):
    """Write a recording of reports alone: a letter for each block of 10 ms."""
    words = {"c": ("chatter", 651.0, "regenerative"), "f": ("chatter", 640.0, "forced")}
    words |= {"q": ("quiet",), "u": ("chatter",)}
    with McapRecorder(path, metadata or {}) as recorder:
        for number, letter in enumerate(states):
            recorder.record(report(number, *words[letter], run=run), 10**7 * number, wait=True)
    return path


def test_an_alarm_of_the_loop_is_told_as_the_report_tells_it(recorded):
    [alarm], notes = alarms_of(recorded[0])
    seen = observe(recorded[0]).summary
    assert notes == []
    assert alarm.alarm_s == pytest.approx(seen.detected_s)
    assert (alarm.frequency_hz, alarm.kind, alarm.shift_deg) == (seen.chatter_hz, "regenerative", seen.shift_deg)
    assert alarm.moved_s == pytest.approx(seen.first_command_s)
    assert alarm.marked_mm == pytest.approx(seen.marked_length_mm, abs=0.05)
    assert alarm.onset_s < alarm.alarm_s + 0.05
    assert alarm.alarm_s < alarm.suppressed_s < alarm.alarm_s + 0.6
    assert (alarm.case, alarm.machine) == ("thesis-652", "lathe-1")


def test_without_truth_nobody_knows_what_was_marked(recorded, tmp_path):
    path = copy(recorded[0], tmp_path / "real.mcap", lambda m: None if isinstance(m, Truth) else m)
    [alarm], _ = alarms_of(path)
    [known], _ = alarms_of(recorded[0])
    assert (alarm.onset_s, alarm.marked_mm) == (None, None)
    assert (alarm.alarm_s, alarm.suppressed_s, alarm.shift_deg) == (known.alarm_s, known.suppressed_s, known.shift_deg)


@pytest.mark.parametrize(
    ("states", "expected"),
    [
        ("qqqqqqqq", []),
        ("qqcccqqq", [(0.03, 0.06)]),
        ("qqcccqqqcq", [(0.03, 0.1)]),
        ("qc" + 60 * "q" + "fff", [(0.02, 0.03), (0.63, None)]),
        ("cccccc", [(0.01, None)]),
    ],
)
def test_an_alarm_that_comes_back_at_once_is_the_same_one(tmp_path, states, expected):
    alarms, _ = alarms_of(said(tmp_path / "run.mcap", states))
    assert [(round(a.alarm_s, 6), a.suppressed_s and round(a.suppressed_s, 6)) for a in alarms] == expected


def test_a_frequency_that_is_found_later_belongs_to_the_alarm(tmp_path):
    [alarm], _ = alarms_of(said(tmp_path / "run.mcap", "quuccq"))
    assert (alarm.alarm_s, alarm.frequency_hz, alarm.kind) == (pytest.approx(0.02), 651.0, "regenerative")


def test_folders_files_and_what_cannot_be_read(tmp_path):
    told = run_metadata(case="c", seed=1, run="r", config="", digest="", version="0", clock="wall")
    later = {"begun_utc": "2026-01-05T09:00:00Z", "machine": "lathe-2"}
    monday = said(tmp_path / "a" / "late.mcap", "qcq", told | later)
    tuesday = said(tmp_path / "a" / "b" / "early.mcap", "qfqq", told | {"begun_utc": "2026-01-04T09:00:00Z"})
    (tmp_path / "a" / "broken.mcap").write_text("no recording")
    (tmp_path / "a" / "notes.txt").write_text("")
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(monday.read_bytes()[:600])
    alarms, read, notes = history([tmp_path / "a", monday, cut])
    assert read == [tuesday, monday, cut]
    assert [(alarm.file, alarm.kind) for alarm in alarms] == [(str(tuesday), "forced"), (str(monday), "regenerative")]
    assert alarms[1].machine == "lathe-2"
    assert any("an MCAP file" in note for note in notes)
    assert any("no end" in note for note in notes)
    for nothing in (tmp_path / "no", tmp_path / "a" / "empty"):
        (tmp_path / "a" / "empty").mkdir(exist_ok=True)
        with pytest.raises(InputError, match="file must be"):
            recordings_in([nothing])


def test_the_table_as_csv_and_the_verb(tmp_path, recorded, capsys):
    code, answer = run(capsys, "history", recorded[0].parent, "--out", tmp_path)
    assert (code, answer["recordings"], len(answer["alarms"])) == (0, 1, 1)
    assert tuple(answer["alarms"][0]) == COLUMNS
    with (tmp_path / "history.csv").open(newline="") as file:
        [row] = csv.DictReader(file)
    assert float(row["frequency_hz"]) == answer["alarms"][0]["frequency_hz"]
    write_history([], tmp_path / "none.csv")
    assert (tmp_path / "none.csv").read_text() == ",".join(COLUMNS) + "\n"
    assert run(capsys, "history", tmp_path / "nothing")[0] == 2
