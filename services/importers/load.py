"""Choose the reader by what the file is."""

from __future__ import annotations

import pathlib

from services.errors import InputError
from services.importers.recording import Recording
from services.importers.table import read_csv
from services.importers.wav import read_wav


def load_recording(path: pathlib.Path, rate_hz: float | None = None) -> Recording:
    """Read a recording of any known format.

    Parameters
    ----------
    path
        WAV or CSV file.
    rate_hz
        Sampling rate (Hz) for files that do not tell; a contradiction is an error.
    """
    if not path.is_file():
        raise InputError("file", str(path), "an existing file")
    if path.stat().st_size == 0:
        raise InputError("file", str(path), "a file with something in it (0 bytes)")
    with path.open("rb") as file:
        head = file.read(12)
    if head[:4] in (b"RIFF", b"RIFX", b"RF64"):
        recording = read_wav(path)
        if rate_hz is not None and abs(rate_hz / recording.rate_hz - 1.0) > 1e-6:
            raise InputError(
                "rate-hz", rate_hz, f"the rate in the header of {path} ({recording.rate_hz:g} Hz), or left out"
            )
        return recording
    if path.suffix.lower() in (".csv", ".txt", ".tsv"):
        return read_csv(path, rate_hz)
    raise InputError("file", str(path), f"a WAV or CSV file (it begins with {head[:4]!r})")
