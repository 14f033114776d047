"""Recordings: MCAP files that hold every message as it travelled, the schemas, and what was run.

Written by a thread of its own: what came in the last 30 ms, or 64 KB of it, becomes one compressed chunk, so that a
process that is killed loses less than 100 ms. Read from the front, so that a file without an end gives all it has.
"""

from __future__ import annotations

import io
import pathlib
import struct
import threading
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import suppress
from typing import Any, Literal, NamedTuple, Self, cast

import zstandard
from mcap.exceptions import InvalidMagic, McapError
from mcap.reader import SeekingReader
from mcap.records import Channel, Chunk, DataEnd, McapRecord, Metadata
from mcap.records import Message as MessageRecord
from mcap.stream_reader import StreamReader, breakup_chunk
from mcap.writer import Writer

from services.errors import InputError
from services.messages import TOPICS, Message
from services.schemas.embedded import schema_of
from services.wire import DecodeError, decode, encode, encoding_of, topic_of

CHUNK_BYTES = 1 << 16
PERIOD_S = 0.03
"""How often what came is written (s): at 100 messages/s on each of 8 topics about 45 KB."""
ROOM_BYTES = 64 << 20
"""What may wait to be written: half a minute or more of everything, should the disk hang."""
MESSAGE_BYTES = 200
"""What a waiting message takes beside its payload."""
RUN, LOST = "antiphase.run", "antiphase.lost"
"""Names of the metadata records: what was run; how many messages did not get into the file so far."""
MOST_RECORD_BYTES = 1 << 28
"""Longest record and longest unpacked chunk that is read: those of others may be longer than ours."""
MAGIC_BYTES = 8
MOST_TIME_NS = 1 << 63
UNREADABLE = (McapError, zstandard.ZstdError, struct.error, ValueError, OverflowError)


class Recorded(NamedTuple):
    """A message in a file, or on its way into it; the topic is the one below the machine."""

    topic: str
    payload: bytes
    encoding: str
    log_time_ns: int


class McapRecorder:
    """Writes messages to an MCAP file without ever holding up who hands them over.

    What finds no room, and what comes after the disk has failed, is counted in `lost`; `failure` says why the file
    ends. Neither raises. A context manager: closing writes the index.

    Parameters
    ----------
    path
        File to write; one that exists is replaced.
    metadata
        What was run, see `run_metadata`; on disk before the constructor returns.
    room_bytes
        How much may wait to be written.

    Raises
    ------
    OSError
        If the file cannot be begun.
    """

    def __init__(self, path: pathlib.Path, metadata: Mapping[str, str], room_bytes: int = ROOM_BYTES) -> None:
        self.path = path
        self.lost = self.written = 0
        self.failure = ""
        self._room = room_bytes
        self._waiting: list[Recorded] = []
        self._taken = self._in_hand = 0
        self._change = threading.Condition()
        self._closing = self._hurry = False
        self._file = open_file(path)
        self._channels: dict[tuple[str, str], int] = {}
        self._writer = Writer(self._file, chunk_size=CHUNK_BYTES)
        self._told = 0
        try:
            self._writer.start(profile="", library="antiphase")
            self._writer.add_metadata(RUN, dict(metadata))
            self._file.flush()
        except OSError:
            self._shut()
            raise
        self._thread = threading.Thread(target=self._run, name="recorder", daemon=True)
        self._thread.start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def write(self, topic: str, payload: bytes, encoding: str, log_time_ns: int, *, wait: bool = False) -> bool:
        """Hand over a message; return whether it was taken.

        Parameters
        ----------
        topic
            Topic below the machine.
        payload, encoding
            As on the bus; the encoding names the schema.
        log_time_ns
            When it was received (ns); messages should come in this order.
        wait
            Wait for room instead of losing the message: only for who has no schedule to keep.
        """
        if not 0 <= log_time_ns < MOST_TIME_NS:
            raise ValueError(f"log_time_ns must be in 0..2^63, got {log_time_ns}")
        size = len(payload) + MESSAGE_BYTES
        with self._change:
            while wait and self._taken + size > self._room and self._taken and not self._over:
                self._hurry = True
                self._change.notify_all()
                self._change.wait()
            if self._over or self._taken + size > self._room:
                self.lost += 1
                return False
            self._waiting.append(Recorded(topic, payload, encoding, log_time_ns))
            self._taken += size
        return True

    def record(self, message: Message, log_time_ns: int, *, wait: bool = False) -> bool:
        """Hand over a message that is not encoded yet; see `write`."""
        kind = type(message)
        return self.write(topic_of(kind), encode(message), encoding_of(kind), log_time_ns, wait=wait)

    def close(self) -> None:
        """Write what waits and the index, and close the file; never raises, see `failure`."""
        with self._change:
            self._closing = True
            self._change.notify_all()
        self._thread.join()

    @property
    def _over(self) -> bool:
        return bool(self.failure) or self._closing

    def _run(self) -> None:
        """Write until closed, or until the disk says no."""
        try:
            while not self._closing:
                with self._change:
                    self._change.wait_for(lambda: self._closing or self._hurry, PERIOD_S)
                self._write_waiting()
            self._write_waiting()
            self._writer.finish()
            self._file.close()
        except OSError as error:
            self._fail(f"{self.path.name} ends early: {error.strerror or error}")

    def _write_waiting(self) -> None:
        """Write what came, ending the chunk."""
        with self._change:
            self._hurry = False
            batch, self._waiting = self._waiting, []
            size, lost, self._in_hand = self._taken, self.lost, len(batch)
        for message in batch:
            time = message.log_time_ns
            self._writer.add_message(self._channel(message.topic, message.encoding), time, message.payload, time)
        if lost != self._told:
            self._told = lost
            self._writer.add_metadata(LOST, {"messages": str(lost)})
        self._writer.flush()
        self.written += len(batch)
        with self._change:
            self._in_hand = 0
            self._taken -= size
            self._change.notify_all()

    def _channel(self, topic: str, encoding: str) -> int:
        """Return the channel of a topic, registered with its schema when first met."""
        known = self._channels.get((topic, encoding))
        if known is None:
            media, _, name = encoding.partition(";")
            message_encoding = media.removeprefix("application/")
            schema = schema_of(name)
            number = self._writer.register_schema(name, *schema) if schema else 0
            known = self._channels[topic, encoding] = self._writer.register_channel(topic, message_encoding, number)
        return known

    def _fail(self, why: str) -> None:
        """Count what cannot be written any more, and stand still."""
        self._shut()
        with self._change:
            self.failure = why
            self.lost += self._in_hand + len(self._waiting)
            self._waiting.clear()
            self._in_hand = self._taken = 0
            self._change.notify_all()

    def _shut(self) -> None:
        """Close the file, written or not."""
        with suppress(OSError):
            self._file.close()


def open_file(path: pathlib.Path) -> io.BufferedWriter:
    """Return a new file to write to."""
    path.parent.mkdir(parents=True, exist_ok=True)
    return path.open("wb")


def run_metadata(
    *, case: str, seed: int, run: str, config: str, digest: str, version: str, clock: Literal["wall", "samples"]
) -> dict[str, str]:
    """Return the record with which a recording begins.

    Parameters
    ----------
    case, seed, run
        Name of the case, seed of its noise, identifier of the run.
    config, digest
        The resolved configuration as JSON, and its SHA-256.
    version
        Of this software.
    clock
        What the log times mean: when a message was received, or the time of the machine's samples (in lockstep).
    """
    known = {"case": case, "seed": str(seed), "run": run, "config": config, "sha256": digest}
    return known | {"version": version, "clock": clock}


class RecordingReader:
    """Reads a recording from the front, as far as it can be read.

    Iterating gives everything on the topics of `services.messages`, in the order in which it was received; then
    `notes` tell what is missing.

    Parameters
    ----------
    path : pathlib.Path
        MCAP file.

    Attributes
    ----------
    metadata : dict
        What was run, see `run_metadata`; empty when the file does not tell. Known from the first message on.
    whole : bool
        The file was closed properly.
    """

    def __init__(self, path: pathlib.Path) -> None:
        self.path = path
        self.metadata: dict[str, str] = {}
        self.whole = self._ended = False
        self._lost, self._undecodable = 0, ""
        self._broken: Counter[str] = Counter()
        self._channels: dict[int, tuple[str, str]] = {}

    def __iter__(self) -> Iterator[Recorded]:
        if not self.path.is_file():
            raise InputError("file", str(self.path), "an existing file")
        with self.path.open("rb") as file:
            self._look_ahead(file)
            for record in self._records(file):
                if isinstance(record, Chunk):
                    yield from self._unpacked(record)
                elif isinstance(record, Channel):
                    self._meet(record)
                elif isinstance(record, MessageRecord):
                    yield from self._message(record)
                elif isinstance(record, Metadata):
                    self._told(record)
        self._ended = True

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
        if self._ended and not self.whole:
            listed.append("the file has no end: whatever wrote it was stopped, or the rest is missing")
        return [f"{self.path.name}: {note}" for note in listed]

    def _look_ahead(self, file: io.BufferedReader) -> None:
        """Learn the channels from the end of a whole file: the first chunk, which tells them too, may be damaged."""
        try:
            summary = SeekingReader(file, record_size_limit=MOST_RECORD_BYTES).get_summary()
        except (*UNREADABLE, OSError):  # OSError: shorter than what is sought from its end
            summary = None
        for channel in summary.channels.values() if summary else ():
            self._meet(channel)
        file.seek(0)

    def _records(self, file: io.BufferedReader) -> Iterator[McapRecord]:
        """Yield the records of the data section, chunks packed."""
        size = self.path.stat().st_size
        reader = StreamReader(cast(Any, _Bounded(file, size)), emit_chunks=True, record_size_limit=MOST_RECORD_BYTES)
        records = reader.records
        try:
            for record in records:
                if isinstance(record, DataEnd):
                    self.whole = True
                    return
                yield record
        except InvalidMagic as error:
            raise InputError("file", str(self.path), "an MCAP file") from error
        except UNREADABLE as error:
            if file.tell() <= MAGIC_BYTES:
                raise InputError("file", str(self.path), "an MCAP file") from error

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
        if record.name == RUN and not self.metadata:
            self.metadata = record.metadata
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
    for _ in reader:
        break
    return reader.metadata
