"""Choose the reader by what the file is."""

from __future__ import annotations

import pathlib
from collections.abc import Sequence

from services.errors import InputError
from services.importers.recording import Recording
from services.importers.table import read_csv
from services.importers.timebase import same_rate
from services.importers.wav import read_wav

_TEXT = (".csv", ".txt", ".tsv", ".dat", ".asc", ".prn")
_KNOWN = "a WAV, CSV, MAT or HDF5 file"


def load_recording(path: pathlib.Path, rate_hz: float | None = None, channels: Sequence[str] = ()) -> Recording:
    """Read a recording of any known format.

    Parameters
    ----------
    path
        WAV, CSV, MAT or HDF5 file; what is in it counts, not what it is called.
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
        return _wav(path, rate_hz)
    from services.importers.hdf5 import is_hdf5, read_hdf5

    if is_hdf5(path):
        return read_hdf5(path, rate_hz, channels)
    if head.startswith(b"MATLAB") or path.suffix.lower() == ".mat":
        from services.importers.mat import read_mat

        return read_mat(path, rate_hz, channels)
    from services.importers.lvm import is_lvm, read_lvm

    if is_lvm(head):
        return read_lvm(path, rate_hz)
    if path.suffix.lower() in _TEXT:
        return read_csv(path, rate_hz)
    raise InputError("file", str(path), f"{_KNOWN} (it begins with {head[:4]!r})")


def _wav(path: pathlib.Path, rate_hz: float | None) -> Recording:
    recording = read_wav(path)
    if rate_hz is not None and not same_rate(rate_hz, recording.rate_hz):
        rule = f"the rate in the header of {path} ({recording.rate_hz:g} Hz), or left out"
        raise InputError("rate-hz", rate_hz, rule)
    return recording
