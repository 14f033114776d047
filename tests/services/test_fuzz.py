"""A few thousand bent inputs at every door, and what earlier ones found."""

import struct
import zlib

import h5py
import numpy as np
import pytest
from nptdms import ChannelObject, RootObject, TdmsWriter
from scipy.io import savemat

from services.errors import InputError
from services.importers.load import load_recording
from tests.fuzz.run import bent, survived
from tests.fuzz.targets import doors

DOORS = doors()
RUNS = {"message": 4000, "hdf5": 60, "tdms": 60, "uff": 60, "mcap": 60}


@pytest.mark.parametrize("name", DOORS)
def test_bent_inputs_are_read_or_refused(name):
    thrown, found = survived(name, RUNS.get(name, 100), seed=7)
    assert found == []
    assert thrown == RUNS.get(name, 100)


@pytest.mark.parametrize("name", DOORS)
def test_the_good_inputs_are_read(name):
    door = DOORS[name]
    for number, seed in enumerate(door.seeds):
        if name == "uff" and number == 2:
            with pytest.raises(InputError, match="time records"):
                door.open(seed)
        else:
            door.open(seed)


def test_the_same_seed_bends_the_same_way():
    seeds = DOORS["csv"].seeds
    one, two = ([bent(seeds, np.random.default_rng([3, k])) for k in range(50)] for _ in range(2))
    assert one == two
    assert len(set(one)) > 45


def test_a_finding_is_found(monkeypatch):
    import tests.fuzz.run as run

    def dies(data):
        raise (KeyError if len(data) % 2 else ZeroDivisionError)("bad")

    door = DOORS["csv"]
    monkeypatch.setattr(run, "doors", lambda: {"csv": type(door)(seeds=(b"ab",), open=dies, share=1.0)})
    thrown, found = survived("csv", 60, seed=1)
    assert thrown == 60
    assert sorted(line.split(": ")[1].split()[0] for line in found) == ["KeyError", "ZeroDivisionError"]


def test_a_labview_file_whose_rows_have_one_cell(tmp_path):
    path = tmp_path / "x.lvm"
    head = "LabVIEW Measurement\t\nSeparator\tTab\n***End_of_Header***\t\n"
    path.write_text(f"{head}Channels\t1\n***End_of_Header***\nX_Value\ta\n1\n2\n")
    with pytest.raises(InputError, match="at least two rows"):
        load_recording(path)


def test_a_tdms_file_of_a_type_that_nobody_reads(tmp_path, capfd):
    path = tmp_path / "x.tdms"
    with TdmsWriter(str(path)) as file:
        file.write_segment([RootObject({}), ChannelObject("a", "b", np.arange(9.0), {"wf_increment": 0.001})])
    raw = path.read_bytes()
    assert raw.count(b"\x14\0\0\0\x0a\0\0\0") == 1
    path.write_bytes(raw.replace(b"\x14\0\0\0\x0a\0\0\0", b"\x14\0\0\0\0\0\0\0")[:-5])
    with pytest.raises(InputError):
        load_recording(path)
    assert capfd.readouterr().err == "", "the bytes of the file are not for the terminal"


def matlab(path, changed):
    """A MATLAB file whose compressed matrix was changed by somebody who mends its checksum."""
    savemat(path, {"fs": 1000.0, "a": np.arange(50.0)}, do_compression=True)
    raw = path.read_bytes()
    kind, count = struct.unpack_from("<II", raw, 128)
    assert kind == 15
    inner = changed(bytearray(zlib.decompress(raw[136 : 136 + count])))
    packed = zlib.compress(bytes(inner))
    path.write_bytes(raw[:128] + struct.pack("<II", 15, len(packed)) + packed + raw[136 + count :])


@pytest.mark.parametrize("kind", [0, 8, 10, 11, 15, 19, 77, 65535])
def test_a_matlab_file_with_a_type_that_does_not_exist_is_refused_and_kills_nobody(tmp_path, kind):
    path = tmp_path / "x.mat"
    matlab(path, lambda inner: inner)
    assert load_recording(path).rate_hz == 1000.0
    for at in (8, 24, 40):
        matlab(path, lambda inner, at=at: inner[:at] + struct.pack("<I", kind) + inner[at + 4 :])
        with pytest.raises(InputError, match="damaged|arrays|samples"):
            load_recording(path)


def test_matrices_in_matrices_in_matrices(tmp_path):
    path = tmp_path / "x.mat"

    def deep(_):
        inner = b""
        for _ in range(200):
            inner = struct.pack("<II", 14, len(inner)) + inner
        return inner

    matlab(path, deep)
    with pytest.raises(InputError, match="too deep"):
        load_recording(path)


@pytest.mark.parametrize("size", [0, 1, 2**40])
def test_an_hdf5_file_with_a_heap_that_does_not_end(tmp_path, size):
    path = tmp_path / "x.h5"
    with h5py.File(path, "w") as file:
        file["a"] = np.arange(50.0)
        file["a"].attrs["unit"] = "g"
        file.attrs["sample_rate"] = 1000.0
    assert load_recording(path).units == ("g",)
    raw = bytearray(path.read_bytes())
    first = raw.find(b"GCOL") + 16
    struct.pack_into("<H6xQ", raw, first, 0 if size < 2 else 1, size)
    path.write_bytes(raw)
    with pytest.raises(InputError, match="heap"):
        load_recording(path)
