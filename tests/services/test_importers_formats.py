"""TDMS, universal files, MCAP, and large files that are read piece by piece."""

import h5py
import numpy as np
import pytest
import pyuff
from nptdms import ChannelObject, RootObject, TdmsWriter
from scipy.io import wavfile

from services.errors import InputError
from services.importers import room, table, wav
from services.importers.load import frequency_responses, load_recording
from services.messages import SampleBlock
from services.recording_writer import McapRecorder

RATE = 2000.0
X = np.random.default_rng(1).standard_normal((3000, 2)).cumsum(axis=0)


@pytest.fixture
def small(monkeypatch):
    """Everything counts as large."""
    monkeypatch.setattr(room, "IN_MEMORY_BYTES", 1 << 12)
    monkeypatch.setattr("services.importers.hdf5.IN_MEMORY_BYTES", 1 << 12)
    monkeypatch.setattr(room, "CHUNK_ROWS", 700)
    monkeypatch.setattr(wav, "_LARGE", 1)
    monkeypatch.setattr(table, "_LARGE", 1)
    monkeypatch.setattr(table, "_HEAD", 4000)
    monkeypatch.setattr(table, "_PIECE", 5000)


def tdms(path, properties=None, second=X[:, 1]):
    told = {"wf_increment": 1 / RATE, "unit_string": "g"} if properties is None else properties
    with TdmsWriter(str(path)) as file:
        for part in (slice(0, 1000), slice(1000, 3000)):
            one, two = (ChannelObject("cut", name, x[part], told) for name, x in (("ax", X[:, 0]), ("ay", second)))
            file.write_segment([RootObject({"operator": "x"}), one, two])
    return path


def test_tdms(tmp_path):
    read = load_recording(tdms(tmp_path / "cut.tdms"))
    assert read.rate_hz == pytest.approx(RATE)
    assert read.names == ("cut.ax", "cut.ay")
    assert read.units == ("g", "g")
    np.testing.assert_array_equal(read.samples, X)


def test_a_tdms_file_that_does_not_tell_its_rate_or_is_damaged(tmp_path):
    path = tdms(tmp_path / "cut.tdms", {})
    with pytest.raises(InputError, match="rate-hz"):
        load_recording(path)
    assert load_recording(path, 500.0).rate_hz == 500.0
    raw = tdms(tmp_path / "whole.tdms").read_bytes()
    (tmp_path / "torn.tdms").write_bytes(raw[: len(raw) - 8000])
    torn = load_recording(tmp_path / "torn.tdms")
    assert any("ends within its last segment" in note for note in torn.notes)
    assert 1000 <= len(torn.samples) <= 3000
    (tmp_path / "head.tdms").write_bytes(raw[:40])
    with pytest.raises(InputError, match="TDMS|arrays"):
        load_recording(tmp_path / "head.tdms")


def uff(path, sets):
    file = pyuff.UFF(str(path))
    for values, more in sets:
        one = {
            "type": 58, "func_type": 1, "rsp_node": 1, "rsp_dir": 3, "ref_node": 0, "ref_dir": 0, "data": values,
            "x": np.arange(len(values)) / RATE, "id1": "x", "rsp_ent_name": "", "ref_ent_name": "", "ver_num": 0,
            "abscissa_spacing": 1, "abscissa_spec_data_type": 17, "ordinate_spec_data_type": 12, "load_case_id": 0,
            "orddenom_spec_data_type": 0, "z_axis_spec_data_type": 0, "binary": 0,
        }  # fmt: skip
        file.write_sets(one | more, "add")
    return path


def test_universal_files(tmp_path):
    force = {"ordinate_spec_data_type": 13, "rsp_node": 7}
    sets = [(X[:1000, 0], force), (X[:1000, 1], {}), (X[1000:2000, 0], force), (X[1000:2000, 1], {})]
    read = load_recording(uff(tmp_path / "taps.uff", sets))
    assert read.rate_hz == pytest.approx(RATE)
    assert read.names == ("force 7+z", "acceleration 1+z")
    assert read.units == ("N", "m/s^2")
    assert np.isnan(read.samples[1000]).all()
    np.testing.assert_allclose(np.delete(read.samples, 1000, axis=0), X[:2000], rtol=1e-6)


def test_responses_in_universal_files(tmp_path):
    hz = np.arange(400) * 0.5
    h = 1.0 / (1.0 - (hz / 90.0) ** 2 + 0.02j * hz / 90.0)
    path = uff(tmp_path / "frf.uff", [(h, {"func_type": 4, "x": hz, "abscissa_spec_data_type": 18, "binary": 0})])
    found = frequency_responses(path)
    assert found is not None
    np.testing.assert_allclose(found[0].response[0], h, rtol=1e-5)
    assert found[0].coherence is None
    with pytest.raises(InputError, match="time records .found: frequency response"):
        load_recording(path)
    text = path.read_text()
    (tmp_path / "torn.uff").write_text(text[: len(text) // 2])
    with pytest.raises(InputError, match="universal file"):
        load_recording(tmp_path / "torn.uff")


def test_our_own_recordings(tmp_path):
    path = tmp_path / "run.mcap"
    with McapRecorder(path, {}) as file:
        for k in (0, 1, 3):
            rows = np.arange(90.0) + 90 * k
            block = SampleBlock(
                run="r", source="machine", sequence=k, first_sample=90 * k, sample_rate_hz=9000.0, x1_thrust_n=rows,
                x1_motor_position_m=rows, x1_stage_position_m=rows, y1_thrust_n=rows, y1_motor_position_m=rows,
                y1_stage_position_m=rows, dx1_um=rows, dy1p_um=rows, shift_requested_deg=0.0, shift_applied_deg=0.0,
                moving=False, in_cut=True, spindle_speed_rpm=1200.0, diameter_mm=25.0, guard_state="OFF", session="s",
            )  # fmt: skip
            file.record(block, k * 10_000_000)
    read = load_recording(path)
    assert read.rate_hz == 9000.0
    assert read.samples.shape == (360, 6)
    assert read.units == ("n", "m", "m", "n", "m", "m")
    assert np.isnan(read.samples[180:270]).all()
    np.testing.assert_array_equal(read.samples[270:, 0], np.arange(270.0, 360.0))
    assert "90 samples are missing" in read.notes[0]


def table_file(path, head="time_s,ax_g,ay_g", times=None):
    at = [f"{k / RATE:.6f}" for k in range(3000)] if times is None else times
    rows = [f"{t},{a:.9g},{b:.9g}" for t, (a, b) in zip(at, X, strict=True)]
    path.write_text("\n".join([head, *rows]) + "\n", encoding="utf-8")
    return path


@pytest.mark.usefixtures("small")
@pytest.mark.parametrize("kind", ["csv", "dates.csv", "wav", "h5", "turned.h5", "tdms"])
def test_large_files_read_in_pieces_give_the_same(tmp_path, monkeypatch, kind):
    path = tmp_path / f"cut.{kind}"
    if kind == "csv":
        table_file(path)
    elif kind == "dates.csv":
        table_file(path, times=[f"11:58:0{k // 2000}.{k % 2000 * 500:06d}" for k in range(3000)])
    elif kind == "wav":
        wavfile.write(path, int(RATE), (X / np.abs(X).max() * 30000).astype(np.int16))
    elif kind == "tdms":
        tdms(path)
    else:
        with h5py.File(path, "w") as file:
            file["cut"] = X.T if kind.startswith("turned") else X
            file.attrs["fs"] = RATE
    pieces = load_recording(path)
    assert isinstance(pieces.samples, np.memmap) or isinstance(pieces.samples.base, np.memmap)
    monkeypatch.undo()
    whole = load_recording(path)
    assert not isinstance(whole.samples, np.memmap)
    assert (pieces.rate_hz, pieces.names, pieces.units, pieces.notes) == (
        whole.rate_hz, whole.names, whole.units, whole.notes
    )  # fmt: skip
    np.testing.assert_array_equal(pieces.samples, whole.samples)


@pytest.mark.parametrize("name", ["a.tdms", "a.uff", "a.mcap", "a.lvm", "a.h5", "a.mat", "a.csv", "a.wav"])
def test_files_of_nothing_and_of_noise_are_refused(tmp_path, name):
    path = tmp_path / name
    path.write_bytes(b"")
    with pytest.raises(InputError, match="something in it"):
        load_recording(path)
    path.write_bytes(np.random.default_rng(1).integers(0, 256, 4000, dtype=np.uint8).tobytes())
    with pytest.raises(InputError):
        load_recording(path)
