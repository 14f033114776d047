"""Look at the tags of a MATLAB file before anybody else does: SciPy's compiled reader trusts them and may crash.

Version 5 is a row of elements, each a tag (type, bytes) and a body; matrices hold elements, compressed ones a matrix.
"""

from __future__ import annotations

import mmap
import pathlib
import struct
import zlib

_HEADER, _TAG = 128, 8
_MATRIX, _COMPRESSED = 14, 15
_KNOWN = frozenset((*range(1, 8), 9, 12, 13, _MATRIX, 16, 17, 18))
_DEEPEST = 64
_LONGEST = 1 << 32
"""Bytes of the longest matrix that is unpacked."""


def check_tags(path: pathlib.Path) -> None:
    """Raise ValueError where a tag of a MATLAB 5 file names no type or more bytes than there are, else do nothing.

    Parameters
    ----------
    path
        A file; one of another version is not looked at.
    """
    with path.open("rb") as file:
        head = file.read(_HEADER)
        order = {b"IM": "<", b"MI": ">"}.get(head[126:128])
        if order is None or not head.startswith(b"MATLAB"):
            return
        with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as whole, memoryview(whole) as view:
            at = _HEADER
            while at + _TAG <= len(view):
                at = _top(view, at, order)


def _top(view: memoryview, at: int, order: str) -> int:
    """Check the element at a place of the file; returns where the next one begins."""
    kind, count = struct.unpack_from(f"{order}II", view, at)
    begin = at + _TAG
    if begin + count > len(view):
        raise ValueError(f"the element at byte {at} announces {count} bytes")
    with view[begin : begin + count] as body:
        if kind == _COMPRESSED:
            unpacker = zlib.decompressobj()
            inner = unpacker.decompress(body, _LONGEST)
            if not unpacker.eof:
                raise ValueError(f"the compressed element at byte {at} is damaged")
            _walk(memoryview(inner), order, 0)
        elif kind == _MATRIX:
            _walk(body, order, 1)
        else:
            raise ValueError(f"the element at byte {at} is of type {kind}")
    return begin + count


def _walk(view: memoryview, order: str, depth: int) -> None:
    """Check the elements in a body."""
    at = 0
    while at < len(view):
        if at + _TAG > len(view):
            raise ValueError("a tag is cut off")
        kind, count = struct.unpack_from(f"{order}II", view, at)
        short = kind >> 16
        kind, size = (kind & 0xFFFF, 4) if short else (kind, count)
        begin = at + (4 if short else _TAG)
        if kind not in _KNOWN or short > size or begin + size > len(view):
            raise ValueError(f"a tag names type {kind} and {short or count} bytes")
        if kind == _MATRIX:
            if depth > _DEEPEST or short:
                raise ValueError("matrices lie in each other too deep")
            with view[begin : begin + size] as body:
                _walk(body, order, depth + 1)
        at = begin + size if short else begin + size + -size % 8
