"""Service processes as children: started from the same code, followed, and gone when their parent is."""

from __future__ import annotations

import json
import os
import pathlib
import subprocess
import tempfile
from collections.abc import Generator, Iterable, Sequence
from contextlib import contextmanager, suppress
from typing import IO, Any

from services.clock import WallClock
from services.process import GO

PATIENCE_S = 3.0
"""How long a child has to end when asked."""
TAIL = 12
CLOCK = WallClock()


class Child:
    """One process whose standard output, and standard error if wanted, go to files.

    Parameters
    ----------
    service
        What it is called.
    line
        How to start it.
    folder
        Where the files are.
    quiet
        Whether standard error goes to a file too, and not to the terminal.
    """

    def __init__(self, service: str, line: Sequence[str], folder: pathlib.Path, *, quiet: bool) -> None:
        self.service = service
        self._folder = pathlib.Path(tempfile.mkdtemp(prefix=f"{service}-", dir=folder))
        with self._file("out") as out, self._file("err") as err:
            self._process = subprocess.Popen(
                line, stdin=subprocess.PIPE, stdout=out, stderr=err if quiet else None, start_new_session=True
            )
        self.started = CLOCK.now()

    def _file(self, name: str) -> IO[bytes]:
        return (self._folder / name).open("wb")

    @property
    def pid(self) -> int:
        """Identifier of the process."""
        return self._process.pid

    def ended(self) -> int | None:
        """Return the exit code, None while it runs."""
        return self._process.poll()

    def go(self) -> None:
        """Let a child in reserve begin."""
        self._write(f"{GO}\n".encode())

    def _write(self, data: bytes) -> None:
        if self._process.stdin is not None:
            with suppress(OSError):  # it is gone; `ended` says so
                self._process.stdin.write(data)
                self._process.stdin.flush()

    def said(self) -> dict[str, Any]:
        """Return the JSON object on its standard output, empty if there is none."""
        try:
            lines = (self._folder / "out").read_text(encoding="utf-8").splitlines()
            answer = json.loads(lines[-1]) if lines else {}
        except (OSError, ValueError):
            return {}
        return answer if isinstance(answer, dict) else {}

    def why(self) -> str:
        """Return why it ended, in its own words."""
        said = self.said()
        words = said.get("reason") or said.get("error", {}).get("message")
        if not words:
            try:
                words = "\n".join((self._folder / "err").read_text(encoding="utf-8").splitlines()[-TAIL:])
            except OSError:
                words = ""
        return words or f"exit code {self.ended()}"

    def ask_to_end(self) -> None:
        """Send SIGTERM."""
        if self.ended() is None:
            self._process.terminate()

    def kill(self) -> None:
        """End it by force, now."""
        if self.ended() is None:
            self._process.kill()
        self._wait(None)

    def end(self, deadline: float) -> None:
        """Wait until it has ended, by force from `deadline` on (s)."""
        if not self._wait(max(0.0, deadline - CLOCK.now())):
            self.kill()

    def _wait(self, seconds: float | None) -> bool:
        try:
            self._process.wait(seconds)
        except subprocess.TimeoutExpired:
            return False
        if self._process.stdin is not None:
            with suppress(OSError):
                self._process.stdin.close()
        return True


def end_all(children: Iterable[Child]) -> None:
    """Ask all to end, and end by force who does not; a second Ctrl-C makes it quicker, not incomplete."""
    listed = list(children)
    for child in listed:
        child.ask_to_end()
    deadline = CLOCK.now() + PATIENCE_S
    for child in listed:
        try:
            child.end(deadline)
        except KeyboardInterrupt:
            deadline = 0.0
            child.end(deadline)


@contextmanager
def private_folder() -> Generator[pathlib.Path]:
    """Make a folder that only this user can read, and remove it at the end."""
    with tempfile.TemporaryDirectory(prefix=f"antiphase-{os.getpid()}-", ignore_cleanup_errors=True) as name:
        yield pathlib.Path(name)
