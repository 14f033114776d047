"""Recordings read: MCAP files that hold every message as it travelled, the schemas, and what was run.

Read from the front: a file without an end gives all it has. A long recording goes on in further parts, `cut.mcap`,
`cut.part0002.mcap` and so on: who names the first reads all, who names another reads that one.
`services.recording_writer` tells how they are made.
"""

from __future__ import annotations

import io
import pathlib
import re
import struct
from collections import Counter
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple, cast

import zstandard
from mcap.exceptions import InvalidMagic, McapError
from mcap.reader import SeekingReader
from mcap.records import Channel, Chunk, DataEnd, McapRecord, Metadata
from mcap.records import Message as MessageRecord
from mcap.stream_reader import StreamReader, breakup_chunk

from services.errors import InputError
from services.messages import TOPICS, Message
from services.wire import DecodeError, decode

RUN, LOST = "antiphase.run", "antiphase.lost"
"""Names of the metadata records: what was run; how many messages did not get into the file so far."""
MOST_RECORD_BYTES = 1 << 28
"""Longest record and longest unpacked chunk that is read: those of others may be longer than ours."""
MAGIC_BYTES = 8
FEW = 5000
"""Messages before which a recording tells what was run, if it does: several seconds of everything."""
_PART = re.compile(r"(.+)\.part(\d{4,})")
UNREADABLE = (McapError, zstandard.ZstdError, struct.error, ValueError, OverflowError)


class Recorded(NamedTuple):
    """A message in a file, or on its way into it; the topic is the one below the machine."""

    topic: str
    payload: bytes
    encoding: str
    log_time_ns: int


def part_path(first: pathlib.Path, number: int) -> pathlib.Path:
    """Return the file of a part of a recording, of which the first has the number 1."""
    return first if number == 1 else first.with_name(f"{first.stem}.part{number:04d}{first.suffix}")


def first_part(path: pathlib.Path) -> pathlib.Path:
    """Return the file that a recording begins with, of which a part is given."""
    found = _PART.fullmatch(path.stem)
    return path.with_name(found[1] + path.suffix) if found else path


def parts_of(path: pathlib.Path) -> dict[int, pathlib.Path]:
    """Return the files of a recording by number, the one given first; a later part stands for itself."""
    later: dict[int, pathlib.Path] = {}
    for other in path.parent.glob(f"*.part*{path.suffix}") if path.suffix else ():
        found = _PART.fullmatch(other.stem)
        if found and first_part(other) == path:
            later[int(found[2])] = other
    return {1: path} | dict(sorted(later.items()))


def add_told(known: dict[str, str], more: Mapping[str, str]) -> None:
    """Add what was told later of what was run; of several runs, the first stays."""
    if known.get("run", "") in ("", more.get("run", "")):
        known |= {name: value for name, value in more.items() if value}


class RecordingReader:
    """Reads a recording from the front, with its further parts, as far as it can be read.

    Iterating gives everything on the topics of `services.messages`, in the order in which it was received; then
    `notes` tell what is missing.

    Parameters
    ----------
    path : pathlib.Path
        MCAP file.

    Attributes
    ----------
    metadata : dict
        What was run, see `run_metadata`; empty when the file does not tell. Known from the first message on, but for
        a recorder that came before the run: it adds what it is told. Of several runs, the first.
    whole : bool
        Every part was closed properly.
    """

    def __init__(self, path: pathlib.Path) -> None:
        self.path = path
        self.metadata: dict[str, str] = {}
        self.whole = False
        self._unended: list[str] = []
        self._lost, self._undecodable = 0, ""
        self._broken: Counter[str] = Counter()
        self._channels: dict[int, tuple[str, str]] = {}

    def __iter__(self) -> Iterator[Recorded]:
        if not self.path.is_file():
            raise InputError("file", str(self.path), "an existing file")
        parts, self._unended = parts_of(self.path), []
        missing = max(parts) - len(parts)
        if missing:
            self._broken["parts are missing"] = missing
        for part in parts.values():
            yield from self._part(part)
        self.whole = not self._unended and not missing

    def _part(self, path: pathlib.Path) -> Iterator[Recorded]:
        with path.open("rb") as file:
            self._look_ahead(file)
            for record in self._records(file, path):
                if isinstance(record, Chunk):
                    yield from self._unpacked(record)
                elif isinstance(record, Channel):
                    self._meet(record)
                elif isinstance(record, MessageRecord):
                    yield from self._message(record)
                elif isinstance(record, Metadata):
                    self._told(record)

    def messages(self) -> Iterator[tuple[str, Message, int]]:
        """Yield topic, message and log time (ns); what cannot be decoded is left out and noted."""
        for recorded in self:
            try:
                message = decode(TOPICS[recorded.topic], recorded.payload)
            except DecodeError as error:
                self._undecodable = self._undecodable or str(error)
                self._broken["messages cannot be decoded"] += 1
                continue
            yield recorded.topic, message, recorded.log_time_ns

    @property
    def notes(self) -> list[str]:
        """What a reader should know: how the file ends, if that was reached, and what could not be read."""
        listed = [f"{count} {what}" for what, count in self._broken.items()]
        if self._undecodable:
            listed.append(f"the first that cannot be decoded: {self._undecodable}")
        if self._lost:
            listed.append(f"{self._lost} messages did not get into the file while it was written")
        no_end = "the file has no end: whatever wrote it was stopped, or the rest is missing"
        return [f"{self.path.name}: {note}" for note in listed] + [f"{name}: {no_end}" for name in self._unended]

    def _look_ahead(self, file: io.BufferedReader) -> None:
        """Learn the channels from the end of a whole file: the first chunk, which tells them too, may be damaged."""
        self._channels.clear()
        try:
            summary = SeekingReader(file, record_size_limit=MOST_RECORD_BYTES).get_summary()
        except (*UNREADABLE, OSError):  # OSError: shorter than what is sought from its end
            summary = None
        for channel in summary.channels.values() if summary else ():
            self._meet(channel)
        file.seek(0)

    def _records(self, file: io.BufferedReader, path: pathlib.Path) -> Iterator[McapRecord]:
        """Yield the records of the data section, chunks packed."""
        size = path.stat().st_size
        reader = StreamReader(cast(Any, _Bounded(file, size)), emit_chunks=True, record_size_limit=MOST_RECORD_BYTES)
        records = reader.records
        try:
            for record in records:
                if isinstance(record, DataEnd):
                    return
                yield record
        except UNREADABLE as error:
            if path == self.path and (isinstance(error, InvalidMagic) or file.tell() <= MAGIC_BYTES):
                raise InputError("file", str(path), "an MCAP file") from error
        self._unended.append(path.name)

    def _unpacked(self, chunk: Chunk) -> Iterator[Recorded]:
        """Yield the messages of a chunk; one that is broken is skipped as a whole."""
        try:
            if chunk.uncompressed_size > MOST_RECORD_BYTES:
                raise ValueError(f"chunk must unpack to at most {MOST_RECORD_BYTES} bytes")
            records = breakup_chunk(chunk, validate_crc=True)
        except UNREADABLE:
            self._broken["chunks are damaged and were left out"] += 1
            return
        for record in records:
            if isinstance(record, Channel):
                self._meet(record)
            elif isinstance(record, MessageRecord):
                yield from self._message(record)

    def _meet(self, channel: Channel) -> None:
        self._channels[channel.id] = channel.topic, channel.message_encoding

    def _message(self, record: MessageRecord) -> Iterator[Recorded]:
        topic, encoding = self._channels.get(record.channel_id, ("", ""))
        if topic in TOPICS:
            yield Recorded(topic, record.data, f"application/{encoding}", record.log_time)
        else:
            self._broken["messages are on no known topic"] += 1

    def _told(self, record: Metadata) -> None:
        if record.name == RUN:
            add_told(self.metadata, record.metadata)
        elif record.name == LOST:
            count = record.metadata.get("messages", "")
            self._lost = int(count) if count.isdecimal() else self._lost


class _Bounded:
    """A file that never sets aside more than it has, whatever a damaged length field asks for."""

    def __init__(self, file: io.BufferedReader, size: int) -> None:
        self._file, self._size = file, size

    def read(self, count: int) -> bytes:
        return self._file.read(min(count, self._size))


def read_messages(path: pathlib.Path) -> Iterator[tuple[str, Message]]:
    """Yield topic and message of everything in a recording, in the order in which it was received.

    A file that was cut off gives what it has. `RecordingReader` tells besides what was run and what is missing.
    """
    for topic, message, _ in RecordingReader(path).messages():
        yield topic, message


def read_metadata(path: pathlib.Path) -> dict[str, str]:
    """Return what was run, see `run_metadata`; empty when the file does not tell."""
    reader = RecordingReader(path)
    for number, _ in enumerate(reader):
        if "config" in reader.metadata or number >= FEW:
            break
    return reader.metadata
