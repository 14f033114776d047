"""Recordings people bring: what can be read is read to the bit, what cannot is refused with the reason."""

import contextlib
import io
import struct
import wave

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.io import wavfile

from services.errors import InputError
from services.importers.load import load_recording

RATE = 8000


def tone(n=4000):
    return 0.5 * np.sin(2 * np.pi * 440.0 * np.arange(n) / RATE)


def wav_24(path, samples):
    with wave.open(str(path), "wb") as file:
        file.setnchannels(samples.shape[1])
        file.setsampwidth(3)
        file.setframerate(RATE)
        words = np.rint(samples * (2**23 - 1)).astype("<i4").reshape(-1, 1).view(np.uint8)[:, :3]
        file.writeframes(words.tobytes())


@pytest.mark.parametrize(
    ("kind", "scale", "offset", "tolerance"),
    [("uint8", 127, 128, 0.02), ("int16", 32767, 0, 1e-4), ("int32", 2**31 - 1, 0, 1e-8), ("float32", 1, 0, 1e-7)],
)
def test_every_sample_format_gives_the_same_signal(tmp_path, kind, scale, offset, tolerance):
    path = tmp_path / "tone.wav"
    wavfile.write(path, RATE, (tone() * scale + offset).astype(kind))
    recording = load_recording(path)
    assert recording.rate_hz == RATE
    assert recording.names == ("mono",)
    assert np.abs(recording.samples[:, 0] - tone()).max() < tolerance


def test_24_bit_stereo(tmp_path):
    path = tmp_path / "tone.wav"
    wav_24(path, np.column_stack([np.zeros(4000), tone()]))
    recording = load_recording(path)
    assert recording.names == ("left", "right")
    assert np.abs(recording.samples[:, 1] - tone()).max() < 1e-6
    name, samples = recording.channel(None)
    assert name == "right", "a dead side is not taken by default"
    assert samples.std() > 0.1
    assert recording.channel("0")[0] == "left"
    with pytest.raises(InputError, match="0: left, 1: right"):
        recording.channel("middle")


def test_a_wav_cut_short_is_read_as_far_as_it_goes_and_says_so(tmp_path):
    path = tmp_path / "tone.wav"
    wavfile.write(path, RATE, (tone() * 32767).astype("int16"))
    path.write_bytes(path.read_bytes()[:5000])
    recording = load_recording(path)
    assert 2000 < len(recording.samples) < 2500
    assert "ends early" in recording.notes[0]


@given(st.integers(0, 60), st.binary(max_size=40))
def test_no_bytes_make_a_traceback(tmp_path_factory, keep, tail):
    buffer = io.BytesIO()
    wavfile.write(buffer, RATE, np.zeros(100, dtype="int16"))
    path = tmp_path_factory.mktemp("wav") / "bad.wav"
    path.write_bytes(buffer.getvalue()[:keep] + tail)
    with contextlib.suppress(InputError):
        assert load_recording(path).samples.size > 0


def test_missing_values_in_a_float_wav_are_noted(tmp_path):
    path = tmp_path / "tone.wav"
    samples = tone().astype("float32")
    samples[100:110] = np.nan
    samples[200] = np.inf
    wavfile.write(path, RATE, samples)
    recording = load_recording(path)
    assert np.isnan(recording.samples).sum() == 11
    assert "11 of 4000" in recording.notes[0]


def test_a_wav_with_a_rate_that_is_not_its_own_is_refused(tmp_path):
    path = tmp_path / "tone.wav"
    wavfile.write(path, RATE, (tone() * 32767).astype("int16"))
    with pytest.raises(InputError, match="8000 Hz"):
        load_recording(path, rate_hz=44100.0)


def csv(tmp_path, text, name="table.csv"):
    path = tmp_path / name
    path.write_text(text)
    return path


@pytest.mark.parametrize(("name", "factor"), [("time_s", 1.0), ("time_ms", 1e3), ("t [us]", 1e6), ("Time (s)", 1.0)])
def test_the_rate_comes_from_the_time_column_in_its_unit(tmp_path, name, factor):
    rows = "\n".join(f"{k / RATE * factor!r},{v!r}" for k, v in enumerate(tone(500).tolist()))
    recording = load_recording(csv(tmp_path, f"{name},current_a\n{rows}\n"))
    assert recording.rate_hz == pytest.approx(RATE)
    assert (recording.names, recording.units) == (("current",), ("a",))
    assert np.allclose(recording.samples[:, 0], tone(500), atol=1e-15)


@pytest.mark.parametrize("delimiter", [",", ";", "\t"])
def test_delimiters_and_names(tmp_path, delimiter):
    text = delimiter.join(["force x [N]", "position_mm"]) + "\n" + "\n".join(f"{k}{delimiter}{2 * k}" for k in range(9))
    recording = load_recording(csv(tmp_path, text), rate_hz=1000.0)
    assert recording.names == ("force x", "position")
    assert recording.units == ("N", "mm")
    assert recording.samples[:, 1].tolist() == [2.0 * k for k in range(9)]


def test_a_decimal_comma(tmp_path):
    recording = load_recording(csv(tmp_path, "time_s;f_n\n0,0;1,5\n0,1;2,5\n0,2;3,5\n"))
    assert recording.samples[:, 0].tolist() == [1.5, 2.5, 3.5]


def test_rows_that_are_missing_become_gaps(tmp_path):
    rows = [f"{k / 100},{k}" for k in range(100) if k not in (50, 51, 52)]
    recording = load_recording(csv(tmp_path, "time_s,a\n" + "\n".join(rows)))
    assert len(recording.samples) == 100
    assert np.flatnonzero(np.isnan(recording.samples[:, 0])).tolist() == [50, 51, 52]
    assert "3 rows are missing" in recording.notes[0]


def test_cells_that_are_missing_become_gaps(tmp_path):
    recording = load_recording(csv(tmp_path, "a,b\n1,2\n,3\n4,nan\n5,6\n7,8\n"), rate_hz=10.0)
    assert np.isnan(recording.samples).sum() == 2
    assert "2 of 5 rows" in recording.notes[0]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "0 bytes"),
        ("\n", "names the columns"),
        ("1,2\n3,4\n", "columns without names"),
        ("a,b\n", "none of its lines"),
        ("a,b\n1,2\n", "at least two rows"),
        ("a,b\nx,y\nz,w\nq,r\n", "row of numbers"),
        ("time_s\n0\n1\n2\n", "beside the time"),
        ("time_s,a\n0,1\n1,2\n2,3\n1,4\n", "increasing"),
        ("time_s,a\n0,1\n,2\n2,3\n3,1\n", "row 3"),
        ("time_s,a\n0,1\n1,2\n1.6,3\n2,4\n2.1,5\n2.2,5\n", "evenly spaced"),
        ("a,b\n1,2\n3,4\n", "rate-hz"),
    ],
)
def test_what_a_table_must_have(tmp_path, text, said):
    with pytest.raises(InputError, match=said):
        load_recording(csv(tmp_path, text))


def test_a_column_of_words_is_no_channel(tmp_path):
    recording = load_recording(csv(tmp_path, "note,a\nx,1\ny,2\nz,3\n"), rate_hz=10.0)
    assert recording.channel(None)[0] == "a"
    with pytest.raises(InputError, match="holds numbers"):
        recording.channel("note")


def test_a_rate_that_contradicts_the_time_column_is_refused(tmp_path):
    with pytest.raises(InputError, match="time column"):
        load_recording(csv(tmp_path, "time_s,a\n0,1\n1,2\n2,3\n"), rate_hz=44.0)


@pytest.mark.parametrize("name", ["missing.wav", "picture.png"])
def test_other_files(tmp_path, name):
    path = tmp_path / name
    if name.endswith("png"):
        path.write_bytes(b"\x89PNG\r\n\x1a\n")
    with pytest.raises(InputError, match=r"existing file|a WAV, FLAC"):
        load_recording(path)


def test_binary_data_named_csv(tmp_path):
    path = tmp_path / "bad.csv"
    path.write_bytes(struct.pack("<8d", *range(8)) + b"\xff\xfe\n")
    with pytest.raises(InputError):
        load_recording(path)
