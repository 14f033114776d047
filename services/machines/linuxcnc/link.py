"""The client's end of the bridge: instructions out, rows of servo cycles and the state of the control in."""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
from collections.abc import Callable, Mapping
from importlib.resources import as_file, files
from typing import Any, NamedTuple

from services.clock import WallClock
from services.errors import RefusalError
from services.machines.linuxcnc.control import HURRY, PYTHON, old_version
from services.machines.linuxcnc.settings import Settings

CLOCK = WallClock()
READY_S, LOOK_S = 10.0, 0.002
ORDER = "XYZABCUVW"
SLOW = ("home", "load")


class Row(NamedTuple):
    """One servo cycle of the control; positions in mm."""

    cycle: int
    joint_1_mm: float
    joint_2_mm: float
    feed_mm: float
    applied_1_mm: float
    applied_2_mm: float
    bounded_1_mm: float
    bounded_2_mm: float
    fault: bool
    run: bool
    limited: bool
    enabled: bool


class Link:
    """A bridge process and the pipes to it.

    Parameters
    ----------
    settings
        Of the control.
    environment
        In which the control runs.
    """

    def __init__(self, settings: Settings, environment: Mapping[str, str]) -> None:
        self.settings = settings
        self.status: dict[str, Any] = {}
        self.rows: list[Row] = []
        self.last: Row | None = None
        self.at = self.heard = 0.0
        self._unread, self._asked = b"", 0
        with as_file(files("services.machines.linuxcnc") / "bridge.py") as script:
            self._process = subprocess.Popen(
                [*HURRY, PYTHON, str(script), str(settings.fresh_s)], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL, env=dict(environment), start_new_session=True,
            )  # fmt: skip
        pipes = self._process.stdin, self._process.stdout
        self._in, self._out = (pipe.fileno() if pipe is not None else -1 for pipe in pipes)
        os.set_blocking(self._in, False)
        os.set_blocking(self._out, False)

    @property
    def pid(self) -> int:
        """Of the bridge."""
        return self._process.pid

    @property
    def alive(self) -> bool:
        """Whether the bridge runs."""
        return self._process.poll() is None

    def ready(self) -> None:
        """Wait for the first state of the control, and refuse one that is too old or not the one meant."""
        self.wait(lambda: bool(self.status.get("ini")), "LinuxCNC says nothing through the bridge")
        if why := old_version(str(self.status["version"])):
            raise RefusalError(why)
        if not os.path.samefile(self.status["ini"], self.settings.path):
            raise RefusalError(f"LinuxCNC runs {self.status['ini']}, not {self.settings.path}")

    def wait(self, holds: Callable[[], bool], otherwise: str, seconds: float = READY_S) -> None:
        """Poll until something holds.

        Raises
        ------
        RefusalError
            If it does not in time, or the bridge ends.
        """
        until = CLOCK.now() + seconds
        while True:
            alive = self.alive
            self.poll()
            if holds():
                return
            if not alive:
                raise RefusalError(f"the bridge to LinuxCNC ended: {otherwise}")
            if CLOCK.now() > until:
                raise RefusalError(f"{otherwise} for {seconds:g} s (is LinuxCNC still whole?)")
            CLOCK.sleep_until(CLOCK.now() + LOOK_S)

    def poll(self) -> int:
        """Take what the bridge said, and return how many lines it was."""
        with contextlib.suppress(BlockingIOError):
            while got := os.read(self._out, 1 << 16):
                self._unread += got
        *lines, self._unread = self._unread.split(b"\n")
        for line in lines:
            told = json.loads(line)
            if "refused" in told:
                raise RefusalError(str(told["refused"]))
            self.status = told["status"] or self.status
            if told["rows"]:
                self.at = float(told["at"])
                self.rows += [Row(*row) for row in told["rows"]]
                self.last = self.rows[-1]
        if lines:
            self.heard = CLOCK.now()
        return len(lines)

    def take(self) -> list[Row]:
        """Return the servo cycles since the last call."""
        self.poll()
        rows, self.rows = self.rows, []
        return rows

    def tell(self, **told: Any) -> bool:
        """Give the bridge an instruction; returns whether it could be given."""
        return self.write(json.dumps(told).encode() + b"\n")

    def write(self, line: bytes) -> bool:
        """Write a line as it is; a bridge that does not read, or is gone, is not waited for."""
        try:
            return os.write(self._in, line) == len(line)
        except OSError:
            return False

    def ask(self, what: str) -> None:
        """Let the bridge arm or disarm; `answered` says when it is done."""
        self._asked += self.tell(do=what)

    @property
    def answered(self) -> bool:
        """Whether the bridge has done, or refused, what it was asked last."""
        return self.status.get("asked", 0) >= self._asked and self.status["bridge"] != "arming"

    @property
    def armed(self) -> bool:
        """Whether the offsets follow what the bridge is told."""
        return self.answered and self.status["bridge"] == "armed"

    def control(self, name: str, value: str | None = None) -> None:
        """Let the control do something, such as switch on; `answered` waits for what takes long."""
        self._asked += self.tell(do="control", name=name, value=value) and name in SLOW

    def bring_up(self) -> None:
        """Switch on and home a control of our own."""
        self.control("estop_reset")
        self.wait(lambda: not self.status["estop"], "the emergency stop does not let go")
        self.control("on")
        self.wait(lambda: bool(self.status["enabled"]), "the machine does not switch on")
        self.control("home")
        self.wait(self.homed, "the axes do not home")

    def homed(self) -> bool:
        """Whether the axes of the turret and the feed axis are homed."""
        joints = (self.settings.first.joint, self.settings.second.joint)
        return all(self.status["homed"][joint] for joint in joints)

    def unready(self) -> str:
        """Return why the offsets must not be armed, empty if they may."""
        status = self.status
        if not self.alive:
            return "the bridge to LinuxCNC has ended"
        if status["estop"] or not status["enabled"]:
            return "LinuxCNC is in emergency stop" if status["estop"] else "LinuxCNC is not switched on"
        if not self.homed():
            return "axes of LinuxCNC are not homed: home all of them first"
        if status["program"] != "idle":
            return "a program runs on LinuxCNC: arm before it starts, or abort it with the tool out of the cut"
        return self._room()

    def _room(self) -> str:
        """Return why the largest offset does not fit where the axes stand, empty if it does."""
        offsets = (self.last.applied_1_mm, self.last.applied_2_mm) if self.last else (0.0, 0.0)
        for axis, offset in zip((self.settings.first, self.settings.second), offsets, strict=True):
            position = float(self.status["position"][ORDER.index(axis.letter)]) - offset
            if why := axis.room(position, self.settings.clearance_mm):
                return why
        return ""

    def close(self) -> None:
        """End the bridge."""
        for pipe in (self._process.stdin, self._process.stdout):
            if pipe is not None:
                with contextlib.suppress(OSError):
                    pipe.close()
        try:
            self._process.wait(2.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
