"""Recordings written: every message as it travelled, with the schemas and what was run, as MCAP.

A thread of its own writes: what came in the last 30 ms, or 64 KB of it, becomes one compressed chunk, so that a
process that is killed loses less than 100 ms. The index of an MCAP file is held in memory until the file ends (about
1 KB for each chunk, 120 MB in an hour): so a long recording goes on in further parts, each with what was run and an
index of its own. `services.recording_file` reads them as one.
"""

from __future__ import annotations

import errno
import io
import os
import pathlib
import threading
from collections.abc import Mapping
from contextlib import suppress
from typing import Literal, Self

from mcap.writer import Writer

from services.errors import InputError, RefusalError
from services.messages import Message
from services.recording_file import LOST, RUN, Recorded, add_told, part_path, parts_of
from services.schemas.embedded import schema_of
from services.wire import encode, encoding_of, topic_of

CHUNK_BYTES = 1 << 16
PERIOD_S = 0.03
"""How often what came is written (s): at 100 messages/s on each of 8 topics about 45 KB."""
ROOM_BYTES = 64 << 20
"""What may wait to be written: half a minute or more of everything, should the disk hang."""
MESSAGE_BYTES = 200
"""What a waiting message takes beside its payload."""
PART_CHUNKS = 1 << 14
"""Chunks in one part, so that its index takes less than 20 MB: eight minutes or more."""
MOST_TIME_NS = 1 << 63


class McapRecorder:
    """Writes messages to an MCAP file without ever holding up who hands them over.

    What finds no room, and what comes after the disk has failed, is counted in `lost`; `written` messages make
    `bytes_written`; `failure` says why the file ends. Neither raises. A context manager: closing writes the index.

    Parameters
    ----------
    path
        File to write, or to begin with: see `part_path` for those that follow.
    metadata
        What was run, see `run_metadata`; on disk before the constructor returns.
    room_bytes
        How much may wait to be written.
    new
        Refuse a file that holds something, or of which there are later parts; otherwise they are replaced.
    part_chunks
        About how many chunks a part holds.

    Raises
    ------
    OSError
        If the file cannot be begun.
    RefusalError
        If another recorder is writing it.
    """

    def __init__(
        self, path: pathlib.Path, metadata: Mapping[str, str], room_bytes: int = ROOM_BYTES, *, new: bool = False,
        part_chunks: int = PART_CHUNKS,
    ) -> None:  # fmt: skip
        self.path, self.parts, self._part_chunks = path, 1, part_chunks
        self.lost = self.written = self.bytes_written = 0
        self.failure = ""
        self._room = room_bytes
        self._waiting: list[Recorded] = []
        self._taken = self._in_hand = 0
        self._change = threading.Condition()
        self._closing = self._hurry = False
        self._described: list[dict[str, str]] = []
        self._metadata = dict(metadata)
        self._told = self._before = 0
        self._indexing: threading.Thread | None = None
        self._trouble: OSError | None = None
        self._file = self._first = open_file(path, new)
        try:
            self._begin()
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

    def describe(self, metadata: Mapping[str, str]) -> None:
        """Add what became known of the run only after the file was begun; see `run_metadata`."""
        with self._change:
            if not self._over:
                self._described.append(dict(metadata))

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
            self._await_index()
            self._writer.finish()
            self._file.close()
            self._first.close()
        except OSError as error:
            name = pathlib.Path(error.filename or part_path(self.path, self.parts)).name
            self._fail(f"{name} ends early: {error.strerror or error}")

    def _begin(self) -> None:
        """Begin the file that is open, with what is known of the run."""
        self._channels: dict[tuple[str, str], int] = {}
        self._chunks = 0
        self._writer = Writer(self._file, chunk_size=CHUNK_BYTES)
        self._writer.start(profile="", library="antiphase")
        self._writer.add_metadata(RUN, self._metadata)
        self._file.flush()

    def _go_on(self) -> None:
        """Go on in a new part; the index of the last one is written beside it, so that nothing waits for that."""
        self._await_index()
        self._before = self.bytes_written
        self._indexing = threading.Thread(target=self._index, args=(self._writer, self._file), daemon=True)
        self._indexing.start()
        path = part_path(self.path, self.parts + 1)
        try:
            self._file = open_file(path, new=True)
        except (InputError, RefusalError) as error:
            raise OSError(errno.EEXIST, os.strerror(errno.EEXIST), str(path)) from error
        self.parts += 1
        self._begin()

    def _index(self, writer: Writer, file: io.BufferedWriter) -> None:
        """End a part; the first stays open, which keeps other recorders away."""
        try:
            writer.finish()
            file.flush()
            if file is not self._first:
                file.close()
        except OSError as error:
            self._trouble = error

    def _await_index(self) -> None:
        """Wait until the last part has its index."""
        if self._indexing is not None:
            self._indexing.join()
        if self._trouble is not None:
            raise self._trouble

    def _write_waiting(self) -> None:
        """Write what came, ending the chunk."""
        with self._change:
            self._hurry = False
            batch, self._waiting = self._waiting, []
            described, self._described = self._described, []
            size, lost, self._in_hand = self._taken, self.lost, len(batch)
        if batch and self._chunks >= self._part_chunks:
            self._go_on()
        self._chunks += bool(batch or described) + size // CHUNK_BYTES
        for metadata in described:
            add_told(self._metadata, metadata)
            self._writer.add_metadata(RUN, metadata)
        for message in batch:
            time = message.log_time_ns
            self._writer.add_message(self._channel(message.topic, message.encoding), time, message.payload, time)
        if lost != self._told:
            self._told = lost
            self._chunks += 1
            self._writer.add_metadata(LOST, {"messages": str(lost)})
        self._writer.flush()
        self.written += len(batch)
        self.bytes_written = self._before + self._file.tell()
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
        """Close what is open, written or not."""
        if self._indexing is not None:
            self._indexing.join()
        for file in (self._file, self._first):
            with suppress(OSError):
                file.close()


def open_file(path: pathlib.Path, new: bool) -> io.BufferedWriter:
    """Return an empty file that no other recorder may write; what it held is gone, or refused if it must be new.

    So are later parts of the same recording.
    """
    later = list(parts_of(path).values())[1:]
    if new and later and not path.exists():
        raise _later(path, later[0])
    path.parent.mkdir(parents=True, exist_ok=True)
    file = os.fdopen(os.open(path, os.O_RDWR | os.O_CREAT, 0o644), "wb")
    try:
        _lock(file)
        if new and later:
            raise _later(path, later[0])
        if os.fstat(file.fileno()).st_size:
            if new:
                raise InputError("out", str(path), "a new file; this one holds something, and recordings are kept")
            file.truncate(0)
        for other in later:
            other.unlink()
    except BlockingIOError as error:
        file.close()
        raise RefusalError(f"another recorder is writing {path}", {"file": str(path)}) from error
    except (OSError, InputError):
        file.close()
        raise
    return file


def _later(path: pathlib.Path, other: pathlib.Path) -> InputError:
    return InputError("out", str(path), f"a new file; {other.name} is a later part of another recording")


def _lock(file: io.BufferedWriter) -> None:
    """Take a file for one writer; the system lets it go when the process ends, in whatever way."""
    try:
        import fcntl
    except ImportError:  # Windows does not let two write one file
        return
    fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)


def run_metadata(
    *, case: str, seed: int | None, run: str, config: str, digest: str, version: str, clock: Literal["wall", "samples"]
) -> dict[str, str]:
    """Return the record with which a recording begins.

    Parameters
    ----------
    case, seed, run
        Name of the case, seed of its noise, identifier of the run; empty and None while they are not known.
    config, digest
        The resolved configuration as JSON, and its SHA-256.
    version
        Of this software.
    clock
        What the log times mean: when a message was received, or the time of the machine's samples (in lockstep).
    """
    known = {"case": case, "seed": "" if seed is None else str(seed), "run": run, "config": config, "sha256": digest}
    return known | {"version": version, "clock": clock}
