"""WAV files: 8, 16, 24, 32 bit and float, any number of channels."""

from __future__ import annotations

import pathlib
import struct
import warnings

import numpy as np
from scipy.io import wavfile

from services.errors import InputError
from services.importers.audio import read_audio, sound
from services.importers.recording import Recording
from services.importers.room import CHUNK_ROWS, room, slices, watched
from services.messages import Floats

_LARGE = 1 << 26
"""Bytes from which on a file is mapped instead of read."""


def read_wav(path: pathlib.Path) -> Recording:
    """Read `path`; integers are scaled to +-1 full scale, floats are left as they are.

    A file that ends before the length that its header announces is read as far as it goes, with a note.
    """
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            rate, data = _opened(path)
        except (ValueError, EOFError, struct.error, UnboundLocalError, ZeroDivisionError, TypeError) as error:
            if "Unknown wave file format" in str(error):  # compressed: ADPCM, A-law
                return read_audio(path)
            raise InputError(
                "file", str(path), f"a readable WAV file ({error or 'it ends within its header'})"
            ) from error
    samples = _to_float(np.atleast_1d(data))
    if rate <= 0 or samples.size == 0:
        raise InputError("file", str(path), f"a WAV file with samples and a rate ({samples.size} samples, {rate} Hz)")
    cut = any("EOF" in str(w.message) or "prematurely" in str(w.message) for w in caught)
    notes = [f"the file ends early: {len(samples) / rate:.2f} s are there, its header announces more"] if cut else []
    return sound(path, float(rate), samples, notes)


def _opened(path: pathlib.Path) -> tuple[int, np.ndarray]:
    """Return rate and samples; those of a large file are left where they are until they are needed."""
    large = path.stat().st_size > _LARGE
    try:
        return wavfile.read(path, mmap=large)
    except ValueError:
        if not large:
            raise
        return wavfile.read(path)  # 24 bits can not be mapped


def _to_float(data: np.ndarray) -> Floats:
    columns = data.reshape(len(data), -1) if data.size else data.reshape(0, 1)
    out = room(*columns.shape)
    offset = 128.0 if columns.dtype.kind == "u" else 0.0
    full = 128.0 if offset else -float(np.iinfo(columns.dtype).min) if columns.dtype.kind == "i" else 1.0
    with watched("samples", len(out), CHUNK_ROWS) as advance:
        for part in slices(len(out)):
            np.subtract(columns[part], offset, out=out[part], dtype=np.float64)
            out[part] /= full
            advance(part.stop - part.start)
    return out
