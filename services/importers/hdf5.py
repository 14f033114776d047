"""HDF5 files, MATLAB 7.3 among them: groups are walked, attributes tell rates and units."""

# h5py has no complete type stubs.
# pyright: reportMissingTypeStubs=false

from __future__ import annotations

import pathlib
from collections.abc import Sequence
from typing import Any

import h5py
import numpy as np

from services.errors import InputError
from services.importers.arrays import Contents, recording_of
from services.importers.hdf5_heap import check_heaps
from services.importers.recording import Recording
from services.importers.room import CHUNK_ROWS, IN_MEMORY_BYTES, room, slices, watched

_BROKEN = (OSError, ValueError, TypeError, KeyError, RuntimeError, IndexError, UnicodeError)
_UNIT_NAMES = ("unit", "units", "unit_string", "Unit", "Units")
_MOST_ITEMS = 4096
_DEEPEST = 12
_LONGEST_NOTE = 1 << 16
"""Bytes of the longest attribute that is read: rates and units are short."""


def is_hdf5(path: pathlib.Path) -> bool:
    """Whether a file is HDF5, perhaps behind the header of MATLAB."""
    return bool(h5py.is_hdf5(str(path)))


def read_hdf5(path: pathlib.Path, rate_hz: float | None, wanted: Sequence[str]) -> Recording:
    """Read `path`; groups, references and compound types are walked, their parts have dotted names."""
    contents = Contents()
    try:
        check_heaps(path)
        with h5py.File(str(path), "r") as file:
            _attributes("", file.attrs, contents)
            _walk("", file, file, contents, 0)
    except _BROKEN as error:
        raise InputError("file", str(path), f"a readable HDF5 file; it is damaged or ends early ({error})") from error
    return recording_of(str(path), contents, rate_hz, wanted)


def _walk(name: str, group: Any, file: Any, contents: Contents, depth: int) -> None:
    for key in group:
        item = group.get(key)
        below = f"{name}.{key}" if name else str(key)
        if item is None or key.startswith("#") or depth > _DEEPEST:  # a broken link, or MATLAB's own drawer
            continue
        _attributes(below, item.attrs, contents)
        if isinstance(item, h5py.Group):
            _walk(below, item, file, contents, depth + 1)
        elif isinstance(item, h5py.Dataset):
            _dataset(below, item, file, contents, depth)


def _dataset(name: str, item: Any, file: Any, contents: Contents, depth: int) -> None:
    if item.shape is None or item.attrs.get("MATLAB_empty", 0):
        contents.skipped.append(f"{name} (empty)")
    elif _class_of(item) == "char":
        contents.labels[name] = ["".join(map(chr, np.asarray(item[()]).ravel(order="F").tolist()))]
    elif h5py.check_ref_dtype(item.dtype) is not None:
        _cells(name, item, file, contents, depth)
    elif item.dtype.names:
        _compound(name, item, contents)
    elif h5py.check_string_dtype(item.dtype) is not None:
        contents.add(name, np.asarray(item.asstr(errors="replace")[()], dtype=object))
    else:
        contents.add(name, _values(item))


def _values(item: Any) -> np.ndarray:
    """Return the numbers of a data set; of a large one piece by piece, the longer side as rows."""
    if item.dtype.kind not in "biuf" or item.ndim not in (1, 2) or 8 * item.size <= IN_MEMORY_BYTES:
        return np.asarray(item[()])
    across = item.ndim == 2 and item.shape[0] < item.shape[1]
    rows = max(item.shape)
    out = room(rows, item.size // rows)
    with watched(str(item.name), rows, CHUNK_ROWS) as advance:
        for part in slices(rows):
            piece = item[:, part].T if across else item[part]
            out[part] = piece.reshape(part.stop - part.start, -1)
            advance(part.stop - part.start)
    return out


def _compound(name: str, item: Any, contents: Contents) -> None:
    values = item[()]
    if {"real", "imag"} == set(item.dtype.names):
        contents.skipped.append(f"{name} (complex)")
        return
    for part in item.dtype.names:
        contents.add(f"{name}.{part}", values[part])


def _cells(name: str, item: Any, file: Any, contents: Contents, depth: int) -> None:
    words: list[str] = []
    for k, reference in enumerate(np.asarray(item[()]).ravel()[:_MOST_ITEMS]):
        target = file[reference] if reference else None
        if isinstance(target, h5py.Group) and depth < _DEEPEST:
            _walk(f"{name}[{k}]", target, file, contents, depth + 1)
        elif isinstance(target, h5py.Dataset) and _class_of(target) == "char":
            words.append("".join(map(chr, np.asarray(target[()]).ravel(order="F").tolist())))
        elif isinstance(target, h5py.Dataset) and depth < _DEEPEST:
            _dataset(f"{name}[{k}]", target, file, contents, depth + 1)
    if words:
        contents.labels[name] = words


def _class_of(item: Any) -> str:
    kind = item.attrs.get("MATLAB_class", b"")
    return kind.decode() if isinstance(kind, bytes) else str(kind)


def _attributes(name: str, attributes: Any, contents: Contents) -> None:
    for key in attributes:
        if attributes.get_id(key).get_storage_size() > _LONGEST_NOTE:
            continue
        value = attributes[key]
        word = value.decode("utf-8", errors="replace") if isinstance(value, bytes) else value
        if key in _UNIT_NAMES and isinstance(word, str):
            contents.units[name] = word.strip()
            continue
        number = _number(word)
        if number is not None:
            contents.numbers[f"{name}.{key}" if name else key] = number


def _number(value: Any) -> float | None:
    if isinstance(value, str):
        value = (value.split() or [""])[0]
    elif np.size(value) != 1:
        return None
    try:
        return float(value if isinstance(value, str) else np.asarray(value).ravel()[0])
    except (ValueError, TypeError):
        return None
