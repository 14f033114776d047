"""A long recording goes on in further files: its memory is bounded, and whoever reads the first reads all."""

import threading
import tracemalloc

import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap.reader import make_reader

from services import recording_writer
from services.errors import InputError, RefusalError
from services.history import alarms_of, recordings_in
from services.messages import TOPICS, Event
from services.playback import stretch
from services.recording_file import RecordingReader, first_part, part_path, parts_of, read_metadata
from services.recording_writer import McapRecorder
from tests.services.test_recording_file import METADATA, message_of, record, sequences

TURNS, PART_CHUNKS = 60, 10


@pytest.fixture
def one_by_one(monkeypatch):
    """The writer writes when it is full, and not by the clock."""
    monkeypatch.setattr(recording_writer, "PERIOD_S", 60.0)


@pytest.fixture
def rolled(one_by_one, tmp_path):
    """A recording in several parts: about a chunk for each turn."""
    recorder = record(tmp_path / "run.mcap", TURNS, room_bytes=20_000, part_chunks=PART_CHUNKS)
    assert (recorder.failure, recorder.lost, recorder.written) == ("", 0, TURNS * len(TOPICS))
    assert recorder.parts == len(list(tmp_path.iterdir())) > 4
    return tmp_path / "run.mcap"


def test_what_the_writer_holds_does_not_grow_with_what_it_has_written(one_by_one, tmp_path):
    event, held = message_of(Event, 1), []
    tracemalloc.start()
    try:
        with McapRecorder(tmp_path / "run.mcap", METADATA, room_bytes=400, part_chunks=200) as recorder:
            for total in (1000, 10_000):
                while recorder.written < total:
                    recorder.record(event, 0, wait=True)
                held.append(tracemalloc.get_traced_memory()[0])
    finally:
        tracemalloc.stop()
    assert recorder.parts > 40
    assert held[1] - held[0] < 500_000, "an index of all 9000 chunks takes 6 MB, of two parts 0.3 MB"


def test_all_parts_are_read_as_one(rolled):
    reader = RecordingReader(rolled)
    got = [(message.sequence, topic) for topic, message, _ in reader.messages()]
    assert got == [(number, topic) for number in range(TURNS) for topic in TOPICS]
    assert reader.whole
    assert reader.notes == []
    assert reader.metadata == read_metadata(rolled) == METADATA
    _, some = stretch(rolled, topics=frozenset({"event"}))
    assert [message.sequence for _, message in some] == list(range(TURNS))


def test_each_part_stands_for_itself(rolled):
    parts, seen = parts_of(rolled), []
    assert list(parts) == list(range(1, len(parts) + 1))
    for number, path in parts.items():
        assert (part_path(rolled, number), first_part(path)) == (path, rolled)
        with path.open("rb") as file:
            reader = make_reader(file)
            assert reader.get_summary().statistics.chunk_count <= PART_CHUNKS + 1
            seen += [(channel.topic, message.data) for _, channel, message in reader.iter_messages()]
        if number > 1:
            alone = RecordingReader(path)
            assert {recorded.topic for recorded in alone} == set(TOPICS)
            assert (alone.whole, alone.metadata) == (True, METADATA)
    assert seen == [(recorded.topic, recorded.payload) for recorded in RecordingReader(rolled)]


@pytest.fixture(scope="module")
def contents(tmp_path_factory):
    """Of each part: its name, its bytes, and the payloads in it."""
    first = tmp_path_factory.mktemp("whole") / "run.mcap"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(recording_writer, "PERIOD_S", 60.0)
        record(first, 25, room_bytes=20_000, part_chunks=PART_CHUNKS)
    found = []
    for path in parts_of(first).values():
        with path.open("rb") as file:
            said = [message.data for _, _, message in make_reader(file).iter_messages()]
        found.append((path.name, path.read_bytes(), said))
    return found


@given(st.data())
def test_a_later_part_cut_off_anywhere_costs_nothing_of_the_others(contents, tmp_path_factory, data):
    folder = tmp_path_factory.mktemp("cut")
    victim = data.draw(st.integers(1, len(contents) - 1))
    end = data.draw(st.integers(0, len(contents[victim][1]) - 1))
    for number, (name, content, _) in enumerate(contents):
        (folder / name).write_bytes(content[:end] if number == victim else content)
    reader = RecordingReader(folder / "run.mcap")
    got = [recorded.payload for recorded in reader]
    before = [payload for _, _, said in contents[:victim] for payload in said]
    after = [payload for _, _, said in contents[victim + 1 :] for payload in said]
    assert got[: len(before)] == before
    assert got[len(got) - len(after) :] == after
    had = got[len(before) : len(got) - len(after)]
    assert had == contents[victim][2][: len(had)]
    assert reader.whole == (not reader.notes)
    assert reader.whole or contents[victim][0] in reader.notes[-1]
    assert reader.whole or "no end" in reader.notes[-1]


def test_a_part_that_is_missing_is_said(rolled):
    part_path(rolled, 3).unlink()
    reader = RecordingReader(rolled)
    got = [recorded.topic for recorded in reader]
    assert 0 < len(got) < TURNS * len(TOPICS)
    assert not reader.whole
    assert reader.notes == ["run.mcap: 1 parts are missing"]


def test_a_recording_with_parts_is_kept_or_replaced_as_a_whole(rolled):
    rolled.unlink()
    with pytest.raises(InputError, match=r"run\.part0002\.mcap is a later part"):
        McapRecorder(rolled, METADATA, new=True)
    assert not rolled.exists()
    with McapRecorder(rolled, METADATA) as recorder:
        recorder.record(message_of(Event, 7), 0)
    assert list(parts_of(rolled)) == [1]
    assert sequences(rolled)["event"] == [7]


def test_the_first_part_keeps_other_recorders_away_until_the_end(one_by_one, tmp_path):
    path = tmp_path / "run.mcap"
    with McapRecorder(path, METADATA, room_bytes=400, part_chunks=5) as recorder:
        while recorder.parts < 3:
            recorder.record(message_of(Event, 1), 0, wait=True)
        with pytest.raises(RefusalError, match="another recorder is writing"):
            McapRecorder(path, METADATA)
    assert McapRecorder(path, METADATA).close() is None


def test_what_became_known_of_the_run_is_in_every_part(one_by_one, tmp_path):
    path = tmp_path / "run.mcap"
    with McapRecorder(path, METADATA | {"run": "", "case": ""}, room_bytes=400, part_chunks=5) as recorder:
        for told in ({"run": "r", "case": "c"}, {"run": "later", "case": "d"}):
            recorder.describe(told)
            for number in range(20):
                recorder.record(message_of(Event, number), 0, wait=True)
    last = max(parts_of(path))
    assert last > 4
    assert read_metadata(path) == read_metadata(part_path(path, last)) == METADATA


def test_a_part_that_cannot_be_begun_ends_the_recording_and_is_said(one_by_one, tmp_path):
    path = tmp_path / "run.mcap"
    recorder = McapRecorder(path, METADATA, room_bytes=400, part_chunks=5)
    part_path(path, 2).write_bytes(b"of others")
    count = 0
    while not recorder.failure:
        recorder.record(message_of(Event, count), 0, wait=True)
        count += 1
    recorder.close()
    assert recorder.failure == "run.part0002.mcap ends early: File exists"
    assert recorder.written + recorder.lost == count
    assert part_path(path, 2).read_bytes() == b"of others"
    part_path(path, 2).unlink()
    assert len(sequences(path)["event"]) == recorder.written


def test_an_index_that_finds_no_room_is_said_and_costs_no_message(one_by_one, tmp_path, monkeypatch):
    path, went = tmp_path / "run.mcap", threading.Event()

    def full(self):
        went.set()
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(recording_writer.Writer, "finish", full)
    with McapRecorder(path, METADATA, room_bytes=400, part_chunks=5) as recorder:
        while not went.is_set():
            recorder.record(message_of(Event, recorder.written), 0, wait=True)
    assert "No space left on device" in recorder.failure
    assert len(sequences(path)["event"]) >= recorder.written


def test_the_alarms_of_a_recording_in_parts_are_told_once(rolled):
    assert recordings_in([rolled.parent]) == [rolled]
    assert recordings_in([part_path(rolled, 2), rolled]) == [rolled]
    alarms, _ = alarms_of(rolled)
    rolled.unlink()
    assert recordings_in([rolled.parent])[0] == part_path(rolled, 2)
    assert all(alarm.file == str(rolled) for alarm in alarms)
