"""WAV files: 8, 16, 24, 32 bit and float, any number of channels."""

from __future__ import annotations

import pathlib
import struct
import warnings

import numpy as np
from scipy.io import wavfile

from services.errors import InputError
from services.importers.recording import Recording


def read_wav(path: pathlib.Path) -> Recording:
    """Read `path`; integers are scaled to +-1 full scale, floats are left as they are.

    A file that ends before the length that its header announces is read as far as it goes, with a note.
    """
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            rate, data = wavfile.read(path)
        except (ValueError, EOFError, struct.error, UnboundLocalError, ZeroDivisionError, TypeError) as error:
            raise InputError(
                "file", str(path), f"a readable WAV file ({error or 'it ends within its header'})"
            ) from error
    samples = _to_float(np.atleast_1d(data))
    if rate <= 0 or samples.size == 0:
        raise InputError("file", str(path), f"a WAV file with samples and a rate ({samples.size} samples, {rate} Hz)")
    cut = any("EOF" in str(w.message) or "prematurely" in str(w.message) for w in caught)
    notes = [f"the file ends early: {len(samples) / rate:.2f} s are there, its header announces more"] if cut else []
    missing = int(np.count_nonzero(~np.isfinite(samples).all(axis=1)))
    if missing:
        notes.append(f"{missing} of {len(samples)} samples are not finite numbers and count as gaps")
    channels = samples.shape[1]
    names = (
        ("mono",) if channels == 1 else ("left", "right") if channels == 2 else tuple(f"ch{k}" for k in range(channels))
    )
    return Recording(
        source=str(path),
        rate_hz=float(rate),
        names=names,
        units=("full scale",) * channels,
        samples=samples,
        notes=tuple(notes),
    )


def _to_float(data: np.ndarray) -> np.ndarray:
    columns = data.reshape(len(data), -1) if data.size else data.reshape(0, 1)
    if columns.dtype.kind == "u":
        return (columns.astype(np.float64) - 128.0) / 128.0
    if columns.dtype.kind == "i":
        return columns.astype(np.float64) / -float(np.iinfo(columns.dtype).min)
    wide = columns.astype(np.float64)
    return np.where(np.isfinite(wide), wide, np.nan)
