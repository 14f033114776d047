"""Choose the reader by what the file is."""

from __future__ import annotations

import pathlib
from collections.abc import Sequence
from typing import Any

from services.errors import InputError
from services.importers.audio import is_audio, read_audio
from services.importers.recording import Recording
from services.importers.table import read_csv
from services.importers.timebase import same_rate
from services.importers.wav import read_wav

_TEXT = (".csv", ".txt", ".tsv", ".dat", ".asc", ".prn")
_KNOWN = "a WAV, FLAC, MP3, OGG, CSV, TDMS, MAT, LVM, UFF, HDF5 or MCAP file"
_MP4 = "WAV or FLAC: sound in MP4 (m4a, AAC) must be converted first, for example by `ffmpeg -i sound.m4a sound.flac`"


def load_recording(path: pathlib.Path, rate_hz: float | None = None, channels: Sequence[str] = ()) -> Recording:
    """Read a recording of any known format.

    Parameters
    ----------
    path
        WAV, FLAC, MP3, OGG, CSV, TDMS, MAT, LVM, UFF, HDF5 or MCAP file; what is in it counts, not what it is called.
    rate_hz
        Sampling rate (Hz) for files that do not tell; a contradiction is an error.
    channels
        Names of channels that are wanted, where a file holds channels of several lengths.
    """
    if not path.is_file():
        raise InputError("file", str(path), "an existing file")
    if path.stat().st_size == 0:
        raise InputError("file", str(path), "a file with something in it (0 bytes)")
    try:
        with path.open("rb") as file:
            head = file.read(128)
    except OSError as error:
        raise InputError("file", str(path), f"a file that can be read ({error.strerror})") from error
    if head[:4] in (b"RIFF", b"RIFX", b"RF64"):
        return _at_its_rate(read_wav(path), rate_hz)
    if is_audio(head):
        return _at_its_rate(read_audio(path), rate_hz)
    if head[4:8] == b"ftyp":
        raise InputError("file", str(path), _MP4)
    found = _by_library(path, head, rate_hz, channels)
    if found is not None:
        return found
    if path.suffix.lower() in _TEXT:
        return read_csv(path, rate_hz)
    raise InputError("file", str(path), f"{_KNOWN} (it begins with {head[:4]!r})")


def load_rows(path: pathlib.Path, channels: Sequence[str] = ()) -> Recording:
    """Read a table whose rows need no time: a row for each cut, or for each sample.

    Parameters
    ----------
    path
        As for `load_recording`.
    channels
        Names of channels that are wanted.
    """
    try:
        return load_recording(path, None, channels)
    except InputError as error:
        if error.field != "rate-hz":
            raise
    return load_recording(path, 1.0, channels)


def frequency_responses(path: pathlib.Path) -> tuple[Any, list[str]] | None:
    """Return frequency responses and their names from a universal file that holds some, else None.

    Parameters
    ----------
    path
        Any file.
    """
    if not path.is_file() or path.stat().st_size == 0:
        return None
    with path.open("rb") as file:
        if not file.read(16).lstrip(b"\r\n").startswith(b"    -1"):
            return None
    from services.importers.uff import responses_of

    return responses_of(path)


def _by_library(path: pathlib.Path, head: bytes, rate_hz: float | None, channels: Sequence[str]) -> Recording | None:
    """Return a recording in a format that tells itself by its first bytes, None if it is none of them."""
    from services.importers.hdf5 import is_hdf5, read_hdf5
    from services.importers.lvm import is_lvm, read_lvm

    if is_hdf5(path):
        return read_hdf5(path, rate_hz, channels)
    if is_lvm(head):
        return read_lvm(path, rate_hz)
    if head.startswith(b"MATLAB") or path.suffix.lower() == ".mat":
        from services.importers.mat import read_mat

        return read_mat(path, rate_hz, channels)
    if head.startswith(b"TDSm") or path.suffix.lower() == ".tdms":
        from services.importers.tdms import read_tdms

        return read_tdms(path, rate_hz, channels)
    if head.lstrip(b"\r\n").startswith(b"    -1") or path.suffix.lower() in (".uff", ".unv"):
        from services.importers.uff import read_uff

        return read_uff(path, rate_hz)
    if head.startswith(b"\x89MCAP") or path.suffix.lower() == ".mcap":
        from services.importers.mcap import read_mcap

        return read_mcap(path, rate_hz)
    return None


def _at_its_rate(recording: Recording, rate_hz: float | None) -> Recording:
    if rate_hz is not None and not same_rate(rate_hz, recording.rate_hz):
        rule = f"the rate in the header of {recording.source} ({recording.rate_hz:g} Hz), or left out"
        raise InputError("rate-hz", rate_hz, rule)
    return recording
