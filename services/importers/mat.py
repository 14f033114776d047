"""MATLAB files: version 4 to 7.2 by SciPy; version 7.3 is HDF5."""

# SciPy has no complete type stubs.
# pyright: reportMissingTypeStubs=false

from __future__ import annotations

import pathlib
import struct
import warnings
import zlib
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from scipy.io import loadmat
from scipy.io.matlab import MatReadError, MatReadWarning

from services.errors import InputError
from services.importers.arrays import Contents, recording_of
from services.importers.mat_tags import check_tags
from services.importers.recording import Recording

_BROKEN = (
    MatReadError, ValueError, TypeError, KeyError, IndexError, AttributeError, OSError, EOFError, OverflowError,
    MemoryError, NotImplementedError, UnicodeError, struct.error, zlib.error,
)  # fmt: skip
_MOST_ITEMS = 4096


def read_mat(path: pathlib.Path, rate_hz: float | None, wanted: Sequence[str]) -> Recording:
    """Read `path`; structs and cells are walked, their parts have dotted names."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", MatReadWarning)
        warnings.simplefilter("ignore", UserWarning)
        try:
            check_tags(path)
            variables = loadmat(str(path), simplify_cells=True)
        except _BROKEN as error:
            damaged = f"a readable MAT file; it is damaged or ends early ({error})"
            raise InputError("file", str(path), damaged) from error
    contents = Contents()
    for name, value in variables.items():
        if not name.startswith("__"):
            _walk(name, value, contents)
    return recording_of(str(path), contents, rate_hz, wanted)


def _walk(name: str, value: Any, contents: Contents) -> None:
    if isinstance(value, Mapping):
        for key, item in value.items():
            _walk(f"{name}.{key}", item, contents)
        return
    if isinstance(value, np.ndarray) and value.dtype.names:
        contents.skipped.append(f"{name} (a MATLAB object: save its numbers as arrays)")
        return
    if isinstance(value, list | tuple) or (isinstance(value, np.ndarray) and value.dtype.kind == "O"):
        items = list(np.asarray(value, dtype=object).ravel()) if isinstance(value, np.ndarray) else list(value)
        if all(isinstance(item, str) for item in items):
            contents.labels[name] = [str(item) for item in items]
            return
        for k, item in enumerate(items[:_MOST_ITEMS]):
            _walk(f"{name}[{k}]", item, contents)
        return
    if isinstance(value, bool | int | float | complex | str | bytes | np.ndarray | np.generic):
        contents.add(name, value)
    else:
        contents.skipped.append(f"{name} ({type(value).__name__})")
