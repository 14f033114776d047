"""What the server of the page costs: its share of a core while a machine runs on a real bus and browsers look on."""

from __future__ import annotations

import json
import pathlib
import re
import threading
import urllib.request
from collections.abc import Generator, Sequence
from contextlib import ExitStack, contextmanager
from typing import Any

import msgspec
from websockets.sync.client import connect

from services.bench.rounds import Row, Say, row, silent
from services.children import Child, end_all, private_folder
from services.clock import WallClock
from services.config import load_case
from services.dashboard.frame import decode_frame
from services.dashboard.rehearsal import rehearse
from services.messages import BLOCK_S, Message
from services.process import command_line
from services.zenoh_bus import ZenohBus

CASE, MACHINE = "thesis-652", "bench"
CLOCK = WallClock()
MOST_PERCENT, LEAST_FRAMES = 8.0, 20.0
PATIENCE_S = 30.0


def measure(*, seconds: float = 8.0, browsers: Sequence[int] = (0, 1, 3), say: Say = silent) -> list[Row]:
    """Return the rows of the table.

    Parameters
    ----------
    seconds
        For how long each number of browsers is measured (s).
    browsers
        How many look on.
    say
        Told what is being measured.
    """
    say(f"rehearsal of {CASE}")
    heard = rehearse(load_case(CASE), 1, 6.0, 3.0, CLOCK)
    rows: list[Row] = []
    with ZenohBus.router(MACHINE, "tcp/127.0.0.1:0") as bus, _talking(bus, heard), _page(bus.endpoint) as url:
        for count in browsers:
            say(f"{count} browsers")
            percent, frames = _share(url, count, seconds)
            what = f"server of the page, 100 blocks/s on the bus, {count} browsers"
            rows.append(row(f"{what}: share of a core", percent, MOST_PERCENT, "% of a core (peer: the most allowed)"))
            if count:
                rows.append(row(f"{what}: frames", frames, LEAST_FRAMES, "1/s to each (peer: the least wanted)"))
    return rows


@contextmanager
def _talking(bus: ZenohBus, heard: list[list[Message]]) -> Generator[None]:
    """Publish a run again and again at its own pace, each time as a new one."""
    ended = threading.Event()

    def talk() -> None:
        begin, number = CLOCK.now(), 0
        while not ended.is_set():
            for message in heard[number % len(heard)]:
                bus.publish(_again(message, number // len(heard)))
            number += 1
            CLOCK.sleep_until(begin + number * BLOCK_S)

    thread = threading.Thread(target=talk, daemon=True)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()


def _again(message: Any, time: int) -> Message:
    """Return a message as that of a later run."""
    return msgspec.structs.replace(message, run=f"{message.run}-{time}") if time else message


@contextmanager
def _page(endpoint: str) -> Generator[str]:
    with private_folder() as folder:
        line = command_line("dashboard", CASE, "--machine", MACHINE, "--connect", endpoint, "--port", "0", "--json")
        child = Child("dashboard", line, pathlib.Path(folder), quiet=False)
        try:
            until = CLOCK.now() + PATIENCE_S
            while "url" not in child.said() or not _state(child.said()["url"])["linked"]:
                if CLOCK.now() > until or child.ended() is not None:
                    raise RuntimeError(f"the page does not start: {child.why()}")
                CLOCK.sleep_until(CLOCK.now() + 0.1)
            yield child.said()["url"]
        finally:
            end_all([child])


def _get(url: str) -> bytes:
    opener = urllib.request.build_opener(urllib.request.ProxyHandler({}))
    with opener.open(url, timeout=PATIENCE_S) as answer:
        return answer.read()


def _state(url: str) -> dict[str, Any]:
    try:
        return json.loads(_get(f"{url}api/state"))
    except OSError:
        return {"linked": False}


def _computing_s(url: str) -> float:
    found = re.search(rb"^process_cpu_seconds_total (\S+)", _get(f"{url}metrics"), re.MULTILINE)
    if found is None:
        raise RuntimeError("this system does not say how long a process has computed")
    return float(found[1])


def _share(url: str, browsers: int, seconds: float) -> tuple[float, float]:
    """Return the share of a core (%), and the frames that each browser reads (1/s)."""
    with ExitStack() as stack:
        readers = [stack.enter_context(_Reader(url)) for _ in range(browsers)]
        CLOCK.sleep_until(CLOCK.now() + 1.0)
        begin, computed, read = CLOCK.now(), _computing_s(url), [reader.frames for reader in readers]
        CLOCK.sleep_until(begin + seconds)
        took, computed = CLOCK.now() - begin, _computing_s(url) - computed
        frames = [(reader.frames - before) / took for reader, before in zip(readers, read, strict=True)]
    return 100.0 * computed / took, min(frames, default=0.0)


class _Reader:
    """Reads frames as a browser does."""

    def __init__(self, url: str) -> None:
        self.frames = 0
        self._stack = ExitStack()
        self._link = self._stack.enter_context(
            connect(url.replace("http", "ws", 1) + "ws", proxy=None, compression=None)
        )
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._read, daemon=True)

    def _read(self) -> None:
        while not self._ended.is_set():
            data = self._link.recv(PATIENCE_S)
            if isinstance(data, bytes):
                self._link.send(str(decode_frame(data).header["frame"]))
                self.frames += 1

    def __enter__(self) -> _Reader:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        self._thread.join(PATIENCE_S)
        self._stack.close()
