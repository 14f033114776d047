"""TDMS files of LabVIEW and its relatives, by npTDMS: groups and channels with their waveform properties."""

from __future__ import annotations

import logging
import pathlib
import struct
import warnings
from collections.abc import Sequence
from typing import Any

import numpy as np
from nptdms import TdmsFile
from nptdms.log import log_manager

from services.errors import InputError
from services.importers.arrays import Contents, recording_of
from services.importers.channels import answers_to
from services.importers.recording import Recording
from services.importers.room import room, watched

_BROKEN = (OSError, ValueError, TypeError, KeyError, IndexError, EOFError, AttributeError, OverflowError,
           UnicodeError, MemoryError, NotImplementedError, struct.error)  # fmt: skip
_UNITS = ("unit_string", "NI_UnitDescription", "Unit", "unit", "Units", "units")
_LARGE = 1 << 24
log_manager.set_level(logging.CRITICAL)  # it logs the bytes of damaged files to the terminal


def read_tdms(path: pathlib.Path, rate_hz: float | None, wanted: Sequence[str]) -> Recording:
    """Read `path` piece by piece; of a large file only the wanted channels, if any are named."""
    contents = Contents()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            with path.open("rb") as raw, TdmsFile.open(raw) as file:
                _walk(file, contents, wanted)
                cut = bool(file.file_status.incomplete_final_segment)
    except _BROKEN as error:
        raise InputError("file", str(path), f"a readable TDMS file; it is damaged or ends early ({error})") from error
    if cut:
        contents.notes.append("the file ends within its last segment: what is whole was read")
    return recording_of(str(path), contents, rate_hz, wanted)


def _walk(file: Any, contents: Contents, wanted: Sequence[str]) -> None:
    for name, value in file.properties.items():
        _number(name, value, contents)
    for group in file.groups():
        for name, value in group.properties.items():
            _number(f"{group.name}.{name}", value, contents)
        for channel in group.channels():
            name = f"{group.name}.{channel.name}"
            unit = next((str(channel.properties[key]) for key in _UNITS if channel.properties.get(key)), "")
            if unit:
                contents.units[name] = unit
            for key, value in channel.properties.items():
                _number(f"{name}.{key}", value, contents)
            if wanted and len(channel) > _LARGE and not any(answers_to(name, unit, one) for one in wanted):
                contents.skipped.append(f"{name} ({len(channel)} samples, not asked for)")
                continue
            _channel(name, channel, contents)


def _channel(name: str, channel: Any, contents: Contents) -> None:
    kind = np.dtype(channel.dtype).kind if channel.dtype is not None else "O"
    if kind not in "biuf" or len(channel) == 0:
        if kind == "M" and len(channel):
            stamps = np.asarray(channel[:])
            contents.add(name, (stamps - stamps[0]) / np.timedelta64(1, "s"))
        else:
            contents.skipped.append(f"{name} ({'empty' if len(channel) == 0 else channel.dtype})")
        return
    values, at = room(len(channel), 1)[:, 0], 0
    with watched(name, len(channel), _LARGE) as advance:
        for chunk in channel.data_chunks():
            part = chunk[:]
            values[at : at + len(part)] = part
            at += len(part)
            advance(len(part))
    contents.add(name, values[:at])


def _number(name: str, value: Any, contents: Contents) -> None:
    if isinstance(value, int | float | np.number) and not isinstance(value, bool):
        contents.numbers[name] = float(value)
