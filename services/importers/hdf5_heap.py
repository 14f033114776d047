"""Look at the global heaps of an HDF5 file before the library does: a damaged one lets it turn for ever.

A heap is `GCOL`, version 1, three zeros, its size; then objects: index, count, 4 bytes, size of the data, data in steps
of 8 bytes. Index 0 is the free space up to the end of the heap.
"""

from __future__ import annotations

import mmap
import pathlib
import struct

_MAGIC = b"GCOL\x01\x00\x00\x00"
_HEAD = 16


def check_heaps(path: pathlib.Path) -> None:
    """Raise ValueError where an object of a heap is longer than what is left of it, else do nothing.

    Parameters
    ----------
    path
        HDF5 file.
    """
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as whole:
        at = whole.find(_MAGIC)
        while at >= 0:
            _check(whole, at)
            at = whole.find(_MAGIC, at + 1)


def _check(whole: mmap.mmap, start: int) -> None:
    if start + _HEAD > len(whole):
        raise ValueError("a heap is cut off")
    end = start + struct.unpack_from("<Q", whole, start + 8)[0]
    if end > len(whole) or end < start + _HEAD:
        raise ValueError(f"the heap at byte {start} ends at byte {end}")
    at = start + _HEAD
    while end - at >= _HEAD:
        index, size = struct.unpack_from("<H6xQ", whole, at)
        step = size if index == 0 else _HEAD + size + -size % 8
        if step < _HEAD or at + step > end:
            raise ValueError(f"an object of the heap at byte {start} has {size} bytes")
        at += step
