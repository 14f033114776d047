"""A LinuxCNC of its own and the link to it; what moved is kept cycle by cycle, and drawn."""

import contextlib
import math
import pathlib
import tempfile
import time

import numpy as np

from services.config import load_case
from services.machines.linuxcnc.folder import init_folder
from services.machines.linuxcnc.link import Link
from services.machines.linuxcnc.settings import load_settings

PROGRAMS = {
    "feed": "G21 G90 G94\nG1 Z-190 F1200\nM2\n",
    "wall": "G21 G90 G94\nG0 X199.4\nG1 Z-190 F1200\nM2\n",
    "home": "G21 G90\nG0 X0 Y0 Z0\nM2\n",
}
REST_MM = 1e-4
TRIES = 4
LEAD_CYCLES = 250
"""A figure begins so long before the first event."""


class Busy(Exception):
    """The watchdog spoke before anything was done: this computer had no time for the client or the bridge."""


class Rig:
    """A running control and the link to it; keeps every servo cycle."""

    def __init__(self, folder, control):
        self.folder, self.control = folder, control
        self.settings = load_settings(folder)
        self.rows, self.marks, self.link = [], [], None
        self.begin = self.end = 0
        self.join()

    def join(self):
        self.link = Link(self.settings, self.control.environment)
        self.link.ready()

    def see(self):
        new = self.link.take()
        self.rows += new
        return new

    def mark(self, word):
        """Note in which cycle something is done, for the figure."""
        self.see()
        self.marks.append((self.rows[-1].cycle, word))

    def event(self, word):
        """Note what this scene is about; until then no fault may be latched."""
        self.mark(word)
        if self.rows[-1].fault:
            raise Busy(word)

    def keep(self, seconds, x=None, y=0.0):
        """Go on telling the bridge where to be (mm), or say nothing."""
        until = time.monotonic() + seconds
        while time.monotonic() < until:
            if x is not None:
                self.link.tell(do="move", x=[x] * 10, y=[y] * 10, over_s=0.01)
            time.sleep(0.01)
            self.see()

    def until(self, holds, seconds=5.0, x=None, y=0.0):
        until = time.monotonic() + seconds
        while not holds():
            assert time.monotonic() < until, (self.link.status, self.rows[-1:])
            self.keep(0.01, x, y)

    def arm(self, program=None):
        """Bring the program to its end, arm again, and start another."""
        link = self.link
        link.control("abort")
        self.until(lambda: link.status["program"] == "idle")
        if program is not None:
            path = self.folder / f"{program}.ngc"
            path.write_text(PROGRAMS[program])
            link.control("load", str(path))
        link.ask("arm")
        self.until(lambda: link.answered)
        assert link.armed, (link.status, self.rows[-2:])
        self.keep(0.03, 0.0)
        if program is not None:
            link.control("run")
            self.until(lambda: link.status["program"] == "runs", x=0.0)

    def back(self):
        """Leave the place that a program brought the axes to; the scene is over."""
        self.end = len(self.rows)
        for _ in range(TRIES):
            self.arm("home")
            self.until(lambda: self.link.status["program"] == "idle" or self.rows[-1].fault, x=0.0)
            if not self.rows[-1].fault:
                return
        raise Busy("back")

    def time_of(self, row):
        """Return when a cycle was, on the clock of this computer (s)."""
        return self.link.at - 1e-3 * (self.rows[-1].cycle - row.cycle)

    def after(self, cycle):
        return [row for row in self.rows if row.cycle > cycle]

    def fault(self, began, cycle):
        """Return how long it took from an event to the latched fault, and what moved after that."""
        with contextlib.suppress(AssertionError):
            self.until(lambda: self.rows[-1].fault, 3.0)
        self.keep(0.3)
        rows = self.after(cycle)
        faulty = [row for row in rows if row.fault]
        if not faulty:
            return {"fault": False}
        at = [(row.joint_1_mm, row.joint_2_mm) for row in faulty]
        drift = 1e3 * max(math.dist(at[0], place) for place in at)
        fed = [row for row in faulty if abs(row.feed_mm - faulty[-1].feed_mm) > REST_MM]
        return {
            "fault": True, "fault_ms": 1e3 * (self.time_of(faulty[0]) - began), "drift_um": drift,
            "feed_stops_ms": len(fed), "latched": all(row.fault for row in faulty),
        }  # fmt: skip


@contextlib.contextmanager
def lathe():
    with tempfile.TemporaryDirectory(prefix="lathe-") as folder:
        init_folder(pathlib.Path(folder), load_case("thesis-652"))
        yield pathlib.Path(folder)


def patient(folder):
    """Let a computer that tests on all its cores be late by a few tenths of a second."""
    path = folder / "lathe.ini"
    path.write_text(path.read_text().replace("WATCHDOG_S = 0.2", "WATCHDOG_S = 0.6").replace("= 0.1\n", "= 0.6\n"))
    return folder


class Pace:
    """Waits for the next 10 ms of wall time."""

    def __init__(self):
        self.due = time.monotonic()

    def __call__(self):
        self.due = max(self.due + 0.01, time.monotonic() - 0.01)
        time.sleep(max(0.0, self.due - time.monotonic()))


def picture(rows, path, marks, bounds=None):
    """Draw a scene, to be looked at; `marks` are cycles and words, the first is the event."""
    from services.figures.linuxcnc import write_linuxcnc_figure
    from services.machines.linuxcnc.trace import COLUMNS

    path.parent.mkdir(parents=True, exist_ok=True)
    rows = [row for row in rows if row.cycle >= marks[0][0] - LEAD_CYCLES]
    base = next(row for row in rows if row.cycle >= marks[0][0])
    columns = {name: np.array([getattr(row, name, math.nan) for row in rows], dtype=float) for name in COLUMNS}
    columns["time_s"] = 1e-3 * (columns["cycle"] - columns["cycle"][0])
    for k, axis in ((1, "x1"), (2, "y1")):
        columns[f"requested_{axis}_mm"] = np.array([getattr(row, f"bounded_{k}_mm") for row in rows])
        columns[f"applied_{axis}_mm"] = np.array([getattr(row, f"applied_{k}_mm") for row in rows])
        # where the program had it: the scenes stand at tenths of a millimetre, and a joint follows by some micrometres
        stood = round(getattr(base, f"joint_{k}_mm") - getattr(base, f"applied_{k}_mm"), 1)
        columns[f"simulated_{axis}_mm"] = np.array([getattr(row, f"joint_{k}_mm") - stood for row in rows])
    times = [(1e-3 * (cycle - rows[0].cycle), word) for cycle, word in marks]
    words = {"title": path.stem.replace("_", " "), "follower": "joint"}
    write_linuxcnc_figure(columns, path, marks=times, bounds=bounds, **words)


def place_drift(trace, part):
    """Return how far the joints went from where they were first in a part of a trace (um)."""
    places = np.array([trace["joint_1_mm"][part], trace["joint_2_mm"][part]])
    return 1e3 * float(np.hypot(*(places - places[:, :1])).max()) if places.size else 0.0
