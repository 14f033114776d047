"""A frame as it goes to the browsers: length, JSON, columns as float32, spectra as bytes.

Bytes 0..3 are the length H of the JSON (little-endian, a multiple of 4). From byte 4 + H on there are `rows` x
`columns.count` float32 (row after row, NaN where nothing is known), then `spectra.bins` bytes
of level for each of `spectra.numbers`.
"""

from __future__ import annotations

import struct
from typing import Any, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from services.dashboard.history import COLUMN_S, COLUMNS, RESENT, ROWS
from services.dashboard.spectra import COLUMNS as SPECTRA
from services.dashboard.spectra import FLOOR_DB, HOP_S, STEP_DB
from services.dashboard.view import View

FORMAT = 1
_ENCODER = msgspec.json.Encoder()


class Seen(NamedTuple):
    """How far a browser has been told: epoch of the picture, newest column, newest spectrum, newest event."""

    epoch: int = -1
    column: int = -1
    spectrum: int = -1
    event: int = 0


def encode_frame(view: View, seen: Seen, number: int, state: dict[str, Any]) -> tuple[bytes, Seen]:
    """Return the frame that follows on what was seen, and what is seen after it."""
    if seen.epoch != view.epoch:
        seen = Seen(view.epoch, -1, -1, seen.event)
    first, values = view.history.since(max(seen.column - RESENT, -1))
    spectra, levels = view.spectra.since(seen.spectrum)
    header: dict[str, Any] = {
        "format": FORMAT, "frame": number, "epoch": view.epoch, "state": state, "rows": ROWS,
        "columns": {"first": first, "count": values.shape[1], "column_s": COLUMN_S, "most": COLUMNS},
        "spectra": {
            "numbers": spectra, "bins": view.spectra.bins, "bin_hz": view.spectra.bin_hz, "column_s": HOP_S,
            "floor_db": FLOOR_DB, "step_db": STEP_DB, "most": SPECTRA,
        },
        "events": [line for number, line in view.events if number > seen.event],
    }  # fmt: skip
    text = _ENCODER.encode(header)
    text += b" " * (-len(text) % 4)
    frame = b"".join((struct.pack("<I", len(text)), text, values.astype("<f4").tobytes(), levels))
    newest = spectra[-1] if spectra else seen.spectrum
    return frame, Seen(view.epoch, view.history.head, newest, view.event_count)


class Frame(NamedTuple):
    """A frame taken apart: its JSON, the columns by row, and the levels of each spectrum."""

    header: dict[str, Any]
    columns: dict[str, NDArray[np.float32]]
    levels: NDArray[np.uint8]


def decode_frame(data: bytes) -> Frame:
    """Return what a frame holds, as the page reads it."""
    (length,) = struct.unpack_from("<I", data)
    header = msgspec.json.decode(data[4 : 4 + length])
    rows, count = header["rows"], header["columns"]["count"]
    start = 4 + length
    values = np.frombuffer(data, "<f4", len(rows) * count, start).reshape(len(rows), count)
    spectra = header["spectra"]
    levels = np.frombuffer(data, np.uint8, offset=start + values.nbytes).reshape(-1, spectra["bins"])
    if len(levels) != len(spectra["numbers"]):
        raise ValueError(f"levels must be those of {len(spectra['numbers'])} spectra, got {len(levels)}")
    return Frame(header, dict(zip(rows, values, strict=True)), levels)
