"""Sound in the formats of telephones and recorders."""

import contextlib
import pathlib

import numpy as np
import pytest
import soundfile
from hypothesis import given, settings
from hypothesis import strategies as st

from services.errors import InputError
from services.importers.load import load_recording

RATE = 16000
TIME = np.arange(2 * RATE) / RATE
TONES = np.stack([0.5 * np.sin(2.0 * np.pi * 440.0 * TIME), 0.25 * np.sin(2.0 * np.pi * 700.0 * TIME)], axis=1)


def written(folder, ending, samples=TONES, subtype=None):
    path = folder / f"sound.{ending}"
    soundfile.write(path, samples, RATE, subtype=subtype)
    return path


@pytest.mark.parametrize(
    ("ending", "subtype", "error"),
    [
        ("flac", "PCM_24", 1e-6), ("aiff", "PCM_16", 1e-4), ("au", "DOUBLE", 1e-15), ("caf", "PCM_16", 1e-4),
        ("w64", "PCM_16", 1e-4), ("wav", "ALAW", 0.02), ("wav", "IMA_ADPCM", 0.05), ("mp3", None, 0.02),
        ("ogg", "VORBIS", 0.05),
    ],
)  # fmt: skip
def test_what_was_written_is_read(tmp_path, ending, subtype, error):
    recording = load_recording(written(tmp_path, ending, subtype=subtype))
    assert recording.rate_hz == RATE
    assert recording.names == ("left", "right")
    assert recording.units == ("full scale", "full scale")
    count = min(len(recording.samples), len(TONES))
    assert count >= len(TONES) - 2000
    inside = slice(2000, count - 2000)
    if ending == "mp3":  # its coder delays by some samples
        for column, true in enumerate(TONES.T):
            spectrum = np.abs(np.fft.rfft(recording.samples[inside, column]))
            expected = np.abs(np.fft.rfft(true[inside]))
            assert spectrum.argmax() == expected.argmax()
            assert spectrum.max() == pytest.approx(expected.max(), rel=error)
    else:
        assert np.abs(recording.samples[inside] - TONES[inside]).max() < error
    assert any("with loss" in note for note in recording.notes) == (ending in ("mp3", "ogg"))
    assert not any("early" in note for note in recording.notes)


def test_the_file_counts_and_not_its_name(tmp_path):
    path = written(tmp_path, "flac", TONES[:, 0])
    other = path.rename(tmp_path / "sound.csv")
    assert load_recording(other).names == ("mono",)


def test_a_file_that_ends_early_is_read_as_far_as_it_goes(tmp_path):
    whole = written(tmp_path, "flac", np.random.default_rng(1).uniform(-0.5, 0.5, 2 * RATE))
    whole.write_bytes(whole.read_bytes()[: whole.stat().st_size // 2])
    recording = load_recording(whole)
    assert any("early" in note for note in recording.notes)
    assert 0.3 * 2 * RATE < len(recording.samples) < 0.6 * 2 * RATE


@pytest.mark.parametrize("ending", ["aiff", "au"])
def test_a_header_that_announces_more_than_is_there_is_said(tmp_path, ending):
    path = written(tmp_path, ending)
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    recording = load_recording(path)
    assert 0.45 * len(TONES) < len(recording.samples) < 0.55 * len(TONES)
    assert any("early" in note for note in recording.notes)


def test_a_stream_that_does_not_know_its_length_is_read_to_its_end(tmp_path):
    path = written(tmp_path, "flac")
    raw = bytearray(path.read_bytes())
    raw[21] &= 0xF0
    raw[22:26] = bytes(4)
    path.write_bytes(raw)
    recording = load_recording(path)
    assert len(TONES) - 1024 <= len(recording.samples) <= len(TONES)
    assert any("does not tell the length" in note for note in recording.notes)


@pytest.mark.parametrize(("ending", "subtype"), [("au", "FLOAT"), ("caf", "DOUBLE"), ("wav", "FLOAT")])
def test_numbers_that_are_not_finite_count_as_gaps_and_are_said(tmp_path, ending, subtype):
    spoilt = TONES.copy()
    spoilt[100], spoilt[200] = np.nan, np.inf
    recording = load_recording(written(tmp_path, ending, spoilt, subtype))
    assert any("2 of 32000 samples" in note for note in recording.notes)


@pytest.mark.parametrize("head", ["ID3", "FORM_x", "riff", "caff"])
def test_a_table_whose_first_column_is_called_like_a_sound_is_a_table(tmp_path, head):
    path = tmp_path / "table.csv"
    path.write_text(f"{head},time_s\n" + "".join(f"{k % 7},{k / 1000}\n" for k in range(200)))
    assert load_recording(path).rate_hz == pytest.approx(1000.0)


@settings(max_examples=60, deadline=None)
@given(st.sampled_from(["flac", "ogg", "aiff", "mp3"]), st.lists(st.tuples(st.floats(0, 1), st.integers(0, 255))))
def test_spoilt_bytes_are_read_or_refused(tmp_path_factory, ending, spoilt):
    path = written(tmp_path_factory.mktemp("spoilt"), ending, TONES[:4000])
    raw = bytearray(path.read_bytes())
    for place, value in spoilt:
        raw[min(int(place * len(raw)), len(raw) - 1)] = value
    path.write_bytes(raw)
    with contextlib.suppress(InputError):
        assert np.isfinite(load_recording(path).samples).any()


@pytest.mark.parametrize(
    ("raw", "rule"),
    [
        (b"\0\0\0\x20ftypM4A \0\0\0\0", "must be converted first"),
        (b"fLaC" + bytes(40), "readable sound file"),
        (b"OggS" + bytes(40), "readable sound file"),
    ],
)
def test_what_cannot_be_read_says_what_to_do(tmp_path, raw, rule):
    path = pathlib.Path(tmp_path / "telephone.m4a")
    path.write_bytes(raw)
    with pytest.raises(InputError, match=rule):
        load_recording(path)


def test_a_rate_that_contradicts_the_header_is_refused(tmp_path):
    with pytest.raises(InputError, match="the rate in the header"):
        load_recording(written(tmp_path, "flac"), rate_hz=44100.0)
