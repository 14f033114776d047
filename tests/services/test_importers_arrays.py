"""MAT and HDF5: which arrays are the signal, where their rate is, and what is refused."""

import pathlib

import h5py
import numpy as np
import pytest
from scipy.io import savemat

from services.errors import InputError
from services.importers.load import load_recording

RATE = 25600.0
COUNT = 2000
TIME = np.arange(COUNT) / RATE
ONE, TWO = np.sin(2 * np.pi * 1000 * TIME), 0.1 * np.cos(50 * TIME)
SERVO = pathlib.Path(__file__).resolve().parents[3] / "shared" / "data" / "emps-servo" / "DATA_EMPS.mat"

MAT = {
    "time and signal": ({"t": TIME, "x": ONE}, ["x"]),
    "rows are samples": ({"fs": RATE, "data": np.c_[ONE, TWO]}, ["data[0]", "data[1]"]),
    "columns are samples": ({"Fs": RATE, "data": np.c_[ONE, TWO].T}, ["data[0]", "data[1]"]),
    "time in the matrix": ({"tsDS": np.c_[TIME, ONE, TWO]}, ["tsDS[1]", "tsDS[2]"]),
    "a count in the matrix": ({"d": np.c_[np.arange(COUNT), ONE], "fs": RATE}, ["d[1]"]),
    "single precision": ({"a": ONE.astype("f4"), "dt": 1 / RATE}, ["a"]),
    "a struct": ({"rec": {"acc": {"x": ONE, "y": TWO}, "info": {"SampleRate": RATE, "who": "me"}}},
                 ["rec.acc.x", "rec.acc.y"]),
    "an array of structs": ({"ch": [{"data": ONE, "fs": RATE}, {"data": TWO, "fs": RATE}]},
                            ["ch[0].data", "ch[1].data"]),
    "named columns": ({"data": np.c_[ONE, TWO], "names": np.array(["accX", "mic_v"], dtype=object), "fs": RATE},
                      ["accX", "mic"]),
    "a slow channel beside": ({"slow": TWO[::10], "slow_fs": RATE / 10, "acc": ONE, "fs": RATE}, ["acc"]),
    "milliseconds": ({"time_ms": 1e3 * TIME, "a": ONE}, ["a"]),
    "milliseconds untold": ({"t": 1e3 * TIME, "a": ONE, "fs": RATE}, ["a"]),
    "a clock for each": ({"Data1_AccX": ONE, "Data1_time_AccX": TIME, "Sample_rate": RATE}, ["Data1_AccX"]),
    "words, an image, nothing": ({"a": ONE, "fs": RATE, "s": "hello", "i": np.zeros((300, 300)), "e": np.zeros((0, 0)),
                                  "z": ONE + 1j}, ["a"]),
}  # fmt: skip


def mat(tmp_path, variables, **options):
    path = tmp_path / "x.mat"
    savemat(path, variables, **options)
    return path


@pytest.mark.parametrize("name", MAT)
@pytest.mark.parametrize("compressed", [False, True])
def test_mat_tells_its_rate_and_channels(tmp_path, name, compressed):
    variables, names = MAT[name]
    recording = load_recording(mat(tmp_path, variables, do_compression=compressed))
    assert recording.rate_hz == pytest.approx(RATE, rel=1e-6)
    assert list(recording.names) == names
    assert recording.samples[:, 0] == pytest.approx(ONE, abs=1e-6)


def test_version_4_and_whole_numbers(tmp_path):
    recording = load_recording(mat(tmp_path, {"fs": RATE, "a": ONE}, format="4"))
    assert recording.samples[:, 0] == pytest.approx(ONE)
    recording = load_recording(mat(tmp_path, {"a": np.rint(1000 * ONE).astype("int16"), "fs": np.int32(25600)}))
    assert recording.samples.dtype == np.float64
    assert recording.samples[:, 0] == pytest.approx(np.rint(1000 * ONE))


def test_missing_values_are_noted(tmp_path):
    wave = ONE.copy()
    wave[5:8], wave[10] = np.nan, np.inf
    recording = load_recording(mat(tmp_path, {"a": wave, "fs": RATE}))
    assert np.isnan(recording.samples).sum() == 4
    assert any("4 of 2000" in note for note in recording.notes)


def test_channels_of_several_lengths(tmp_path):
    path = mat(tmp_path, {"a": ONE, "b": TWO[:1500], "fs": RATE})
    longest, asked = load_recording(path), load_recording(path, channels=["b"])
    assert (longest.names, len(longest.samples)) == (("a",), 2000)
    assert (asked.names, len(asked.samples)) == (("b",), 1500)
    assert "a (2000), b (1500)" in asked.notes[0]


def test_many_runs_are_not_channels_of_one(tmp_path):
    runs = [{"vib": ONE + k, "force": TWO} for k in range(12)]
    path = mat(tmp_path, {"mill": runs, "fs": RATE})
    assert load_recording(path).names == ("mill[0].vib", "mill[0].force")
    assert load_recording(path, channels=["mill[3].vib"]).samples[:, 0] == pytest.approx(ONE + 3)
    assert "12 runs" in load_recording(path).notes[0]


REFUSED = {
    "no rate": ({"a": ONE, "b": TWO}, None, (), "rate-hz must be given.*a \\(2000\\), b \\(2000\\).*neither"),
    "another rate": ({"a": ONE, "fs": RATE}, 44100.0, (), "fs: 25600 Hz"),
    "complex": ({"a": ONE + 1j, "fs": RATE}, None, (), "a \\(complex\\)"),
    "complex asked": ({"a": ONE + 1j, "b": ONE, "fs": RATE}, None, ("a",), "a \\(complex\\)"),
    "words": ({"a": "hello"}, None, (), "arrays of real numbers"),
    "a number": ({"fs": RATE}, None, (), "arrays of real numbers"),
    "empty": ({"a": np.zeros((0, 0)), "fs": RATE}, None, (), "a \\(empty\\)"),
    "uneven": ({"t": np.cumsum(np.r_[1.0, 9.0, 1.0, 5.0] * np.ones((100, 1)), dtype=float), "a": np.arange(400.0)},
               None, (), "evenly spaced"),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_refusals_say_what_was_found_and_what_is_missing(tmp_path, name):
    variables, rate_hz, channels, said = REFUSED[name]
    with pytest.raises(InputError, match=said):
        load_recording(mat(tmp_path, variables), rate_hz, channels)


@pytest.mark.parametrize("compressed", [False, True])
@pytest.mark.parametrize("share", [0.01, 0.1, 0.5, 0.99])
def test_a_mat_cut_short(tmp_path, share, compressed):
    path = mat(tmp_path, {"t": TIME, "x": ONE}, do_compression=compressed)
    whole = path.read_bytes()
    path.write_bytes(whole[: int(share * len(whole))])
    with pytest.raises(InputError, match="damaged or ends early"):
        load_recording(path)


def attributes(file):
    file.create_dataset("run/acc", data=ONE).attrs.update({"sample_rate": RATE, "unit": "g"})


def of_the_group(file):
    file.create_dataset("run/acc", data=np.c_[ONE, TWO].T)
    file["run"].attrs["sampling_frequency"] = "25600 Hz"


def waveform(file):
    file.create_dataset("g/x", data=ONE.astype("f4")).attrs["wf_increment"] = 1 / RATE


def compound(file):
    file.create_dataset("table", data=np.rec.fromarrays([TIME, ONE, TWO], names="time,acc,mic"))


def beside(file):
    file["fs"], file["sig"] = RATE, ONE[None, :]
    file["broken"] = h5py.SoftLink("/nowhere")
    file["words"] = ["a", "b"]


@pytest.mark.parametrize("build", [attributes, of_the_group, waveform, compound, beside])
def test_hdf5_tells_its_rate(tmp_path, build):
    path = tmp_path / "x.h5"
    with h5py.File(path, "w") as file:
        build(file)
    recording = load_recording(path)
    assert recording.rate_hz == pytest.approx(RATE)
    assert recording.samples[:, 0] == pytest.approx(ONE, abs=1e-6)


def test_hdf5_units_and_two_rates(tmp_path):
    path = tmp_path / "x.h5"
    with h5py.File(path, "w") as file:
        attributes(file)
        file.create_dataset("run/mic", data=np.repeat(TWO, 2)).attrs["sample_rate"] = 2 * RATE
    one, other = load_recording(path), load_recording(path, channels=["mic"])
    assert (one.names, one.units, one.rate_hz) == (("run.acc",), ("g",), RATE)
    assert (other.names, other.rate_hz) == (("run.mic",), 2 * RATE)


def test_matlab_7_3(tmp_path):
    """Written as MATLAB does: 512 bytes of its own, arrays turned, words as numbers, cells as references."""
    path = tmp_path / "x.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        file.create_dataset("acc", data=np.c_[ONE, TWO].T).attrs["MATLAB_class"] = np.bytes_("double")
        file.create_dataset("fs", data=[[RATE]]).attrs["MATLAB_class"] = np.bytes_("double")
        file.create_dataset("note", data=np.array([[104], [105]], "u2")).attrs["MATLAB_class"] = np.bytes_("char")
        inside = file.create_dataset("#refs#/a", data=ONE[None])
        cell = file.create_dataset("cell", shape=(1, 1), dtype=h5py.ref_dtype)
        cell[0, 0] = inside.ref
        empty = file.create_dataset("none", data=np.zeros(2, "u8"))
        empty.attrs["MATLAB_empty"] = 1
    whole = bytearray(path.read_bytes())
    whole[:20] = b"MATLAB 7.3 MAT-file,"
    path.write_bytes(whole)
    recording = load_recording(path)
    assert (recording.names, recording.rate_hz) == (("acc[0]", "acc[1]", "cell[0]"), RATE)
    path.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(InputError, match="damaged or ends early"):
        load_recording(path)


@pytest.mark.skipif(not SERVO.is_file(), reason="the recorded servo axis lies beside the repository, not in it")
def test_the_recorded_servo_axis():
    recording = load_recording(SERVO)
    assert recording.rate_hz == pytest.approx(1000.0, rel=1e-4)
    assert recording.names == ("qg", "qm", "vir")
    assert recording.samples.shape == (24841, 3)
