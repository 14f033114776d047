"""The audit log of a machine: one line of JSON for each event, appended, never rewritten."""

from __future__ import annotations

import contextlib
import os
import pathlib
import queue
import threading
from typing import Any, Self

import msgspec

from services.config import Case
from services.errors import InputError
from services.messages import Event

ROOM = 100_000
"""Lines that may wait for the disk; what comes beyond is counted, and the count is written."""


def _sync_folder(folder: pathlib.Path) -> None:
    """Hand the name of a new file to the disk too."""
    with contextlib.suppress(OSError):  # not every file system can
        number = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(number)
        finally:
            os.close(number)


def _torn(path: pathlib.Path) -> bool:
    """Whether a file ends within a line, because whoever wrote it was killed: the next line must not hang on to it."""
    if not path.is_file() or path.stat().st_size == 0:
        return False
    with path.open("rb") as file:
        file.seek(-1, os.SEEK_END)
        return file.read(1) != b"\n"


class EventLog:
    """Appends lines from a thread of its own and hands them to the disk at once: the machine never waits for it.

    Parameters
    ----------
    path
        File to append to; begun when missing.

    Attributes
    ----------
    failure
        Why nothing is written any more, such as a full disk; empty while all is well.
    """

    def __init__(self, path: pathlib.Path) -> None:
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._file = path.open("ab")
            _sync_folder(path.parent)
            if _torn(path):
                self._file.write(b"\n")
        except OSError as error:
            raise InputError("event-log", str(path), f"a file that can be appended to ({error.strerror})") from error
        self.path, self.failure = path, ""
        self._lost = self._told = 0
        self._lines: queue.Queue[bytes | None] = queue.Queue(ROOM)
        self._thread = threading.Thread(target=self._run, name="event-log", daemon=True)
        self._thread.start()

    def begin(self, case: Case, run: str) -> None:
        """Write what the following lines rest on: case, digest of its configuration, limits in force."""
        self._put({"run": run, "case": case.name, "sha256": case.digest, "limits": case.limits.describe()})

    def write(self, event: Event) -> None:
        """Append an event."""
        self._put(event)

    def close(self) -> None:
        """Write what is left and close the file."""
        self._lines.put(None)
        self._thread.join()
        with contextlib.suppress(OSError):  # what could not be written is in `failure` already
            self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _put(self, line: Any) -> None:
        try:
            self._lines.put_nowait(msgspec.json.encode(line) + b"\n")
        except queue.Full:
            self._lost += 1

    def _run(self) -> None:
        ended = False
        while not ended:
            lines = [self._lines.get()]
            waiting = self._lines.qsize()  # a batch ends, however fast more come
            lines += [self._lines.get_nowait() for _ in range(waiting)]
            ended = lines[-1] is None
            self._append([line for line in lines if line is not None])

    def _append(self, lines: list[bytes]) -> None:
        lost = self._lost
        if lost > self._told:
            note = {"lost": lost - self._told, "text": "events came faster than the disk takes them"}
            lines.append(msgspec.json.encode(note) + b"\n")
            self._told = lost
        if self.failure or not lines:
            return
        try:
            self._file.write(b"".join(lines))
            self._file.flush()
            os.fsync(self._file.fileno())
        except OSError as error:  # a full disk must not stop the machine; whoever asks is told
            self.failure = f"{self.path}: {error.strerror}"
