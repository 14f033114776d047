"""A recording holds what travelled, survives whatever happens to its writer, and says what it lost."""

import errno
import io
import json
import pathlib
import signal
import subprocess
import sys
import threading

import msgspec
import numpy as np
import pytest
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from hypothesis import given
from hypothesis import strategies as st
from mcap.reader import make_reader

from services import recording_file, recording_writer
from services.errors import InputError, RefusalError
from services.messages import TOPICS, Event, Floats, ForceBlock, Message
from services.recording_file import RecordingReader, read_messages, read_metadata
from services.recording_writer import McapRecorder, run_metadata
from services.wire import encode, encoding_of, topic_of

METADATA = run_metadata(case="c", seed=3, run="r", config='{"case": {}}', digest="d", version="1.2.3", clock="wall")
TURN_NS = 10_000_000


def message_of(kind: type[Message], number: int) -> Message:
    """A message of any type that tells its number."""
    known = {"guard_state": "ACTIVE", "request": "arm", "action": "move", "sequence": number}
    plain = {int: 3, float: 2.5, bool: True, str: "x", float | None: None, str | None: "forced", bool | None: None}
    given = {
        field.name: known[field.name]
        if field.name in known
        else np.sin(number + np.arange(90.0))
        if field.type == Floats
        else plain.get(field.type, ())
        for field in msgspec.structs.fields(kind)
        if field.name not in ("version", "minor")
    }
    return kind(**given)


def record(path, turns, **options):
    """A recording with one message on each topic in each turn."""
    with McapRecorder(path, METADATA, **options) as recorder:
        for number in range(turns):
            for kind in TOPICS.values():
                recorder.record(message_of(kind, number), number * TURN_NS, wait=True)
    return recorder


def sequences(path):
    """Sequence numbers that a file gives, by topic."""
    found = {topic: [] for topic in TOPICS}
    for topic, message in read_messages(path):
        found[topic].append(message.sequence)
    return found


def test_everything_comes_back_in_order(tmp_path):
    path = tmp_path / "deep" / "run.mcap"
    recorder = record(path, 50)
    assert (recorder.written, recorder.lost, recorder.failure) == (50 * len(TOPICS), 0, "")
    reader = RecordingReader(path)
    got = list(reader.messages())
    assert [(topic, encode(message), time) for topic, message, time in got] == [
        (topic, encode(message_of(kind, number)), number * TURN_NS)
        for number in range(50)
        for topic, kind in TOPICS.items()
    ]
    assert reader.whole
    assert reader.notes == []
    assert reader.metadata == METADATA == read_metadata(path)
    assert [(topic, encode(message)) for topic, message in read_messages(path)] == [
        (topic, encode(message)) for topic, message, _ in got
    ]


def test_other_programs_can_read_it_with_what_is_in_it(tmp_path):
    path = tmp_path / "run.mcap"
    record(path, 20)
    with path.open("rb") as file:
        reader = make_reader(file)
        summary = reader.get_summary()
        assert summary.statistics.message_count == 20 * len(TOPICS)
        assert {channel.topic for channel in summary.channels.values()} == set(TOPICS)
        assert [metadata.name for metadata in reader.iter_metadata()] == ["antiphase.run"]
        for schema, channel, message in reader.iter_messages():
            kind = TOPICS[channel.topic]
            assert schema.name == f"antiphase.{kind.__name__}"
            if channel.message_encoding == "protobuf":
                assert schema.encoding == "protobuf"
                pool = descriptor_pool.DescriptorPool()
                for described in descriptor_pb2.FileDescriptorSet.FromString(schema.data).file:
                    pool.Add(described)
                block = message_factory.GetMessageClass(pool.FindMessageTypeByName(schema.name)).FromString(
                    message.data
                )
                assert len(block.samples) == 8 * block.samples_per_channel * len(block.channels)
            else:
                assert (channel.message_encoding, schema.encoding) == ("json", "jsonschema")
                properties = json.loads(schema.data)["properties"]
                assert properties.keys() == json.loads(message.data).keys()
                # Foxglove 2.x refuses a schema in which a property has no type, or more than one.
                parts = [rule.get("items", rule) for rule in properties.values()]
                parts += [rule for part in parts for rule in part.get("properties", {}).values()]
                assert {part["type"] for part in parts} <= {"string", "number", "integer", "boolean", "object"}


def test_what_is_written_is_on_disk_before_anything_is_closed(tmp_path):
    path = tmp_path / "run.mcap"
    with McapRecorder(path, METADATA) as recorder:
        assert read_metadata(path) == METADATA
        recorder.record(message_of(Event, 1), 0)
        done = threading.Event()
        while not recorder.written:
            done.wait(0.005)
        reader = RecordingReader(path)
        assert [recorded.topic for recorded in reader] == ["event"]
        assert not reader.whole
        assert "no end" in reader.notes[-1]


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    path = tmp_path_factory.mktemp("recording") / "run.mcap"
    record(path, 25)
    return path.read_bytes()


@given(st.data())
def test_a_file_cut_off_anywhere_gives_what_it_has(written, tmp_path_factory, data):
    path = tmp_path_factory.mktemp("cut") / "run.mcap"
    end = data.draw(st.integers(0, len(written) - 1))
    path.write_bytes(written[:end])
    reader = RecordingReader(path)
    try:
        got = [(message.sequence, topic) for topic, message, _ in reader.messages()]
    except InputError:
        assert end <= recording_file.MAGIC_BYTES
        return
    assert got == [(number, topic) for number in range(25) for topic in TOPICS][: len(got)]
    assert reader.whole == (not reader.notes)
    assert reader.whole or len(got) < 25 * len(TOPICS) or "no end" in reader.notes[-1]


@given(st.data())
def test_a_damaged_file_gives_sound_messages_or_says_no(written, tmp_path_factory, data):
    path = tmp_path_factory.mktemp("damaged") / "run.mcap"
    damaged = bytearray(written)
    start = data.draw(st.sampled_from([0, 0, len(written) // 2]))
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(start, min(start + 700, len(damaged) - 9)))
        damaged[at : at + 8] = data.draw(st.binary(min_size=8, max_size=8))
    path.write_bytes(damaged)
    reader = RecordingReader(path)
    try:
        got = [encode(message) for _, message, _ in reader.messages()]
    except InputError:
        return
    assert set(got) <= {encode(message_of(kind, number)) for number in range(25) for kind in TOPICS.values()}


def chunks_of(data):
    """Start and length of the content of every chunk record (opcode 6), by the published layout of MCAP."""
    position, found = 8, []
    while position + 9 <= len(data) and data[position] != 0x0F:
        length = int.from_bytes(data[position + 1 : position + 9], "little")
        if data[position] == 0x06:
            found.append((position + 9, length))
        position += 9 + length
    return found


def test_one_damaged_chunk_costs_that_chunk_only(tmp_path):
    path = tmp_path / "run.mcap"
    record(path, 800)  # several times 64 KB, whatever the writer's pace
    data = bytearray(path.read_bytes())
    assert len(chunks_of(data)) > 1
    start, length = max(chunks_of(data), key=lambda chunk: chunk[1])
    data[start + length // 2] ^= 0x10
    path.write_bytes(data)
    reader = RecordingReader(path)
    got = [message.sequence for topic, message, _ in reader.messages() if topic == "force"]
    lost = sorted(set(range(800)) - set(got))
    assert got == sorted(set(got))
    assert 0 < len(lost) < 800
    assert lost == list(range(lost[0], lost[-1] + 1)), "what is lost stood together"
    assert reader.notes == ["run.mcap: 1 chunks are damaged and were left out"]


def test_what_cannot_be_decoded_is_left_out_and_noted(tmp_path):
    path = tmp_path / "run.mcap"
    with McapRecorder(path, METADATA) as recorder:
        recorder.write("event", b'{"version": 77}', encoding_of(Event), 0)
        recorder.write("of/others", b"?", "application/octet-stream", 0)
        recorder.record(message_of(Event, 1), 0)
    reader = RecordingReader(path)
    assert [message.sequence for _, message, _ in reader.messages()] == [1]
    assert any("version 77" in note for note in reader.notes)
    assert any("1 messages are on no known topic" in note for note in reader.notes)


@pytest.mark.parametrize("content", [b"", b"\x89MCAP0", b"time_s,force_n\n0,1\n" * 10])
def test_what_is_no_recording_is_refused(tmp_path, content):
    path = tmp_path / "run.mcap"
    path.write_bytes(content)
    with pytest.raises(InputError, match="an MCAP file"):
        list(read_messages(path))
    with pytest.raises(InputError, match="an existing file"):
        read_metadata(tmp_path / "nothing.mcap")


class SlowFile(io.BytesIO):
    """A disk that does nothing until it is let go, and is full after some bytes."""

    def __init__(self, full_after=10**9):
        super().__init__()
        self.go, self.full_after, self.saved = threading.Event(), full_after, b""

    def write(self, data):
        if self.tell() > 1000:
            self.go.wait(60.0)
        if self.tell() + len(data) > self.full_after:
            raise OSError(errno.ENOSPC, "No space left on device")
        return super().write(data)

    def close(self):
        if not self.closed:
            self.saved = self.getvalue()
        super().close()


@pytest.fixture
def slow(monkeypatch):
    file = SlowFile()
    monkeypatch.setattr(recording_writer, "open_file", lambda *_: file)
    yield file
    file.go.set()


def test_a_hanging_disk_holds_nobody_up_and_every_loss_is_counted(slow, tmp_path):
    block = message_of(ForceBlock, 0)
    recorder = McapRecorder(tmp_path / "run.mcap", METADATA, room_bytes=200_000)
    taken = sum(recorder.record(block, number) for number in range(1000))
    assert 0 < taken < 250
    assert recorder.lost == 1000 - taken
    slow.go.set()
    recorder.close()
    assert recorder.written == taken
    (tmp_path / "run.mcap").write_bytes(slow.saved)
    reader = RecordingReader(tmp_path / "run.mcap")
    assert sum(1 for _ in reader) == taken
    assert reader.notes == [f"run.mcap: {1000 - taken} messages did not get into the file while it was written"]


def test_who_waits_loses_nothing(tmp_path):
    path = tmp_path / "run.mcap"
    recorder = record(path, 100, room_bytes=20_000)
    assert recorder.lost == 0
    assert all(found == list(range(100)) for found in sequences(path).values())


def test_a_full_disk_ends_the_recording_and_nothing_else(slow, tmp_path):
    slow.full_after = 100_000
    slow.go.set()
    block = message_of(ForceBlock, 0)
    recorder = McapRecorder(tmp_path / "run.mcap", METADATA)
    pause = threading.Event()
    count = 0
    while not recorder.failure:
        recorder.record(block, count)
        count += 1
        pause.wait(0.0005)
    assert recorder.failure == "run.mcap ends early: No space left on device"
    assert not recorder.record(block, count)
    assert not recorder.record(block, count, wait=True)
    recorder.close()
    recorder.close()
    assert recorder.written + recorder.lost == count + 2
    (tmp_path / "run.mcap").write_bytes(slow.saved)
    assert recorder.written <= sum(1 for _ in read_messages(tmp_path / "run.mcap")) <= count


@pytest.mark.skipif(not pathlib.Path("/dev/full").exists(), reason="only Linux has a disk that is always full")
def test_a_disk_that_is_full_from_the_start_is_said_at_once():
    with pytest.raises(OSError, match="No space"):
        McapRecorder(pathlib.Path("/dev/full"), METADATA)


def test_one_file_has_one_writer_and_a_recording_is_kept(tmp_path):
    path = tmp_path / "run.mcap"
    with McapRecorder(path, METADATA, new=True) as recorder:
        recorder.record(message_of(Event, 1), 0)
        for new in (True, False):
            with pytest.raises(RefusalError, match=r"another recorder is writing .*run\.mcap"):
                McapRecorder(path, METADATA, new=new)
    with pytest.raises(InputError, match="out must be a new file"):
        McapRecorder(path, METADATA, new=True)
    assert sequences(path)["event"] == [1]
    with McapRecorder(path, METADATA):
        pass
    assert sequences(path)["event"] == []


def test_what_is_told_later_is_added_to_what_was_run(tmp_path):
    path = tmp_path / "run.mcap"
    with McapRecorder(path, METADATA | {"run": "", "config": "", "case": ""}) as recorder:
        recorder.record(message_of(Event, 1), 0)
        recorder.describe({"run": "r"})
        recorder.describe({"run": "r", "config": "{}", "case": "c"})
        recorder.describe({"run": "later", "config": "{1}", "case": "d"})
        recorder.record(message_of(Event, 2), 0)
    assert read_metadata(path) == METADATA | {"config": "{}"}


def test_a_time_that_no_file_can_hold_is_the_callers_mistake(tmp_path):
    with McapRecorder(tmp_path / "run.mcap", METADATA) as recorder, pytest.raises(ValueError, match="log_time_ns"):
        recorder.record(message_of(Event, 0), -1)


WRITER = """
import pathlib, sys, time
from services.messages import TOPICS
from services.recording_writer import McapRecorder
from tests.services.test_recording_file import METADATA, message_of
recorder = McapRecorder(pathlib.Path(sys.argv[1]), METADATA, part_chunks=int(sys.argv[2]))
start, number = time.monotonic(), 0
while True:
    time.sleep(max(0.0, start + 0.01 * number - time.monotonic()))
    for kind in TOPICS.values():
        recorder.record(message_of(kind, number), time.monotonic_ns())
    print(number, time.monotonic_ns(), flush=True)
    number += 1
"""
CALM_TURNS, CALM_NS = 40, 25_000_000


@pytest.mark.system
@pytest.mark.parametrize("part_chunks", [10**6, 8])
def test_a_writer_that_is_killed_loses_less_than_100_ms(tmp_path, part_chunks):
    """100 turns a second on 8 topics; killed when its last 40 turns came in time, so a busy machine only delays it."""
    path = tmp_path / "run.mcap"
    root = pathlib.Path(__file__).resolve().parents[2]
    command = [sys.executable, "-c", WRITER, str(path), str(part_chunks)]
    with subprocess.Popen(command, cwd=root, stdout=subprocess.PIPE, text=True) as writer:
        turns = []
        for line in writer.stdout:
            turns.append(tuple(map(int, line.split())))
            times = [time for _, time in turns[-CALM_TURNS:]]
            if len(turns) > 2 * CALM_TURNS and max(np.diff(times)) < CALM_NS:
                break
        writer.send_signal(signal.SIGKILL)
        turns += [tuple(map(int, line.split())) for line in writer.stdout if line.endswith("\n")]
    killed = turns[-1][1]
    due = [number for number, time in turns if time < killed - 100_000_000]
    found = sequences(path)
    assert len(due) > CALM_TURNS
    for topic, numbers in found.items():
        assert numbers[: len(due)] == due, topic
    reader = RecordingReader(path)
    assert {topic_of(type(message)) for _, message, _ in reader.messages()} == set(TOPICS)
    assert reader.metadata == METADATA
    assert "no end" in reader.notes[-1]
    assert (len(list(tmp_path.iterdir())) > 3) == (part_chunks == 8)
