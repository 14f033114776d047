"""Tables hold what the recording holds, value for value, whatever their format."""

import csv
import json

import h5py
import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pyarrow import parquet

from services import convert as module
from services.convert import convert
from services.errors import InputError, RefusalError
from services.importers.load import load_recording
from services.messages import TOPICS, ChatterReport, Floats, ForceBlock, SampleBlock
from services.recording_file import RecordingReader
from services.recording_writer import McapRecorder
from tests.services.test_recording_file import METADATA, message_of
from tests.services.test_wire import example

FORMATS = ("csv", "parquet", "hdf5")


def table(folder, name):
    """A table as other programs read it: columns of values, None where there is nothing."""
    [path] = folder.glob(f"{name}.*")
    if path.suffix == ".parquet":
        return parquet.read_table(path).to_pydict()
    if path.suffix == ".h5":
        with h5py.File(path, "r") as file:
            return {name: (d.asstr()[()] if h5py.check_string_dtype(d.dtype) else d[()]).tolist()
                    for name, d in file.items()}  # fmt: skip
    with path.open(newline="", encoding="utf-8") as file:
        head, *rows = csv.reader(file)
    return dict(zip(head, map(list, zip(*rows, strict=True)), strict=True))


def same(cell, value):
    """Whether a cell says what a field said."""
    if value is None:
        return cell in (None, "", -1) or np.isnan(cell)
    if isinstance(value, tuple):
        return json.loads(cell) == json.loads(msgspec.json.encode(value))
    if isinstance(value, str):
        return cell == value
    read = float(cell)
    return read == float(value) or (np.isnan(read) and np.isnan(value))


def plain(kind):
    return [field.name for field in msgspec.structs.fields(kind) if field.type != Floats]


@pytest.mark.parametrize("to", FORMATS)
def test_every_topic_comes_back(tmp_path, to):
    path, folder = tmp_path / "run.mcap", tmp_path / "tables"
    said = {kind: [message_of(kind, number) for number in range(3)] for kind in TOPICS.values()}
    said[ChatterReport].append(msgspec.structs.replace(example(ChatterReport), frequency_hz=None, kind=None))
    with McapRecorder(path, METADATA) as recorder:
        for number, message in enumerate(message for messages in said.values() for message in messages):
            recorder.record(message, 10**7 * number)
    done = convert(path, to, folder)
    assert len(done.tables) == len(TOPICS) + 3
    for topic, kind in TOPICS.items():
        messages, name = said[kind], topic.replace("/", "_")
        blocks = kind in (SampleBlock, ForceBlock) or topic == "sim/truth"
        got = table(folder, f"{name}_blocks" if blocks else name)
        for field in plain(kind):
            values = [getattr(message, field) for message in messages]
            assert len(got[field]) == len(values)
            assert all(same(cell, value) for cell, value in zip(got[field], values, strict=True)), field
        if blocks:
            samples = table(folder, name)
            for field in set(msgspec.structs.asdict(messages[0])) - set(plain(kind)):
                values = np.concatenate([getattr(message, field) for message in messages])
                assert [float(cell) for cell in samples[field]] == values.tolist()
            at = np.concatenate([m.first_sample + np.arange(90) for m in messages])
            assert [int(cell) for cell in samples["sample"]] == at.tolist()
            assert [float(cell) for cell in samples["time_s"]] == (at / 2.5).tolist()
    told = json.loads((folder / "recording.json").read_text())
    assert told["run"]["sha256"] == METADATA["sha256"]
    assert told["tables"] == done.tables


@settings(max_examples=30)
@given(values=st.lists(st.floats(), min_size=1, max_size=40), to=st.sampled_from(FORMATS))
def test_any_number_comes_back_to_the_bit(tmp_path_factory, values, to):
    folder = tmp_path_factory.mktemp("numbers")
    block = msgspec.structs.replace(example(ForceBlock), force_x1_n=np.array(values), force_y1p_n=np.zeros(len(values)))
    with McapRecorder(folder / "run.mcap", {}) as recorder:
        recorder.record(block, 0)
    convert(folder / "run.mcap", to, folder)
    got = np.array(table(folder, "force")["force_x1_n"], dtype=float)
    np.testing.assert_array_equal(got, values)
    finite = ~np.isnan(got)
    assert np.signbit(got[finite]).tolist() == np.signbit(np.array(values))[finite].tolist()


@pytest.mark.parametrize("to", FORMATS)
def test_it_never_holds_more_than_a_few_rows(tmp_path, recorded, monkeypatch, to):
    """Any size of the pieces gives the same tables."""
    sizes = []
    monkeypatch.setattr(module, "BATCH_ROWS", 700)
    suffix, begin = module.WRITERS[to]

    def spied(path, kinds, told):
        file = begin(path, kinds, told)
        write = file.write
        file.write = lambda columns: (sizes.append(len(columns["time_s"])), write(columns))
        return file

    monkeypatch.setitem(module.WRITERS, to, (suffix, spied))
    convert(recorded[0], to, tmp_path, frozenset(("force", "chatter")))
    assert max(sizes) < 800
    force = recorded[2].series(ForceBlock, "force_x1_n")
    assert [float(value) for value in table(tmp_path, "force")["force_x1_n"]] == force.tolist()
    assert len(table(tmp_path, "chatter")["state"]) == len(recorded[2].of(ChatterReport))


@pytest.mark.parametrize("to", ["csv", "hdf5"])
def test_the_importers_read_what_was_converted(tmp_path, recorded, to):
    convert(recorded[0], to, tmp_path, frozenset(("force",)))
    [path] = [path for path in tmp_path.iterdir() if path.stem == "force"]
    read = load_recording(path)
    assert read.rate_hz == pytest.approx(9000.0, rel=1e-9)
    column = [name.removesuffix("_n") for name in read.names].index("force_x1")
    np.testing.assert_array_equal(read.samples[:, column], recorded[2].series(ForceBlock, "force_x1_n"))


def test_a_recording_cut_off_gives_what_it_has_and_says_so(tmp_path, recorded):
    path = tmp_path / "cut.mcap"
    path.write_bytes(recorded[0].read_bytes()[:-200_000])
    done = convert(path, "parquet", tmp_path / "tables")
    assert "no end" in done.notes[-1]
    rows = {entry["file"]: entry["rows"] for entry in done.tables}
    assert 90 * 100 < rows["force.parquet"] == 90 * rows["force_blocks.parquet"]


def test_what_cannot_be_converted_is_refused_and_leaves_nothing(tmp_path):
    path, folder = tmp_path / "run.mcap", tmp_path / "tables"
    with McapRecorder(path, {}) as recorder:
        recorder.write("cmd_vel", b"?", "application/cdr", 0)
    with pytest.raises(RefusalError, match="nothing that can be read") as refused:
        convert(path, "csv", folder)
    assert "no known topic" in refused.value.payload["notes"][0]
    (tmp_path / "text.mcap").write_text("time_s,force_n\n" * 9)
    with pytest.raises(InputError, match="an MCAP file"):
        convert(tmp_path / "text.mcap", "csv", folder)
    with pytest.raises(InputError, match="to must be one of parquet, csv, hdf5"):
        convert(path, "xls", folder)
    assert not folder.exists()
    with McapRecorder(path, {}) as recorder:
        recorder.record(message_of(ForceBlock, 0), 0)
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="out must be a folder"):
        convert(path, "csv", tmp_path / "file")
    assert [recorded.topic for recorded in RecordingReader(path)] == ["force"]
