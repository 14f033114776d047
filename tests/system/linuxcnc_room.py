"""A LinuxCNC of its own, with everything done to it that may go wrong; what happened goes to standard output as JSON.

It runs in a process of its own, so that it can be shut off from the rest of the computer (`unshare`).
"""

import contextlib
import json
import math
import os
import pathlib
import signal
import sys
import tempfile
import time

import numpy as np

from services.closed_loop import Loop
from services.config import load_case
from services.errors import RefusalError
from services.machines.adapters import Choice, open_machine
from services.machines.conformance import RUN, Trial, conformance
from services.machines.linuxcnc.control import LOCK, Control, running
from services.machines.linuxcnc.folder import init_folder
from services.machines.linuxcnc.link import Link
from services.machines.linuxcnc.settings import load_settings
from services.machines.linuxcnc.trace import Trace
from services.messages import ChatterReport, MachineState

PROGRAMS = {
    "feed": "G21 G90 G94\nG1 Z-190 F1200\nM2\n",
    "wall": "G21 G90 G94\nG0 X199.4\nG1 Z-190 F1200\nM2\n",
    "home": "G21 G90\nG0 X0 Y0 Z0\nM2\n",
}
REST_MM = 1e-4


class Rig:
    """A running control and the link to it; keeps every servo cycle."""

    def __init__(self, folder, control):
        self.folder, self.control = folder, control
        self.settings = load_settings(folder)
        self.rows, self.link = [], None
        self.join()

    def join(self):
        self.link = Link(self.settings, self.control.environment)
        self.link.ready()

    def see(self):
        new = self.link.take()
        self.rows += new
        return new

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
        """Leave the place that a program brought the axes to."""
        self.arm("home")
        self.until(lambda: self.link.status["program"] == "idle", x=0.0)

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


def settles(rig):
    """0.5 mm while the feed runs."""
    rig.arm("feed")
    rig.keep(0.1, 0.0)
    cycle = rig.rows[-1].cycle
    rig.keep(0.5, 0.5, -0.3)
    rows = rig.after(cycle)
    away = [row for row in rows if abs(row.applied_1_mm - 0.5) > 5e-3 or abs(row.applied_2_mm + 0.3) > 5e-3]
    feed = np.diff([row.feed_mm for row in rows[20:]])
    last = rows[-1]
    return {
        "settled_ms": away[-1].cycle - cycle, "rest_um": 1e3 * abs(last.applied_1_mm - 0.5),
        "feed_mm_per_s": [float(-1e3 * feed.max()), float(-1e3 * feed.min())], "fault": last.fault,
        "joint_um": 1e3 * abs(last.joint_1_mm - 0.5),
    }  # fmt: skip


def nonsense(rig):
    """What no client should say; the bounds are in the servo thread."""
    rig.arm()
    cycle = rig.rows[-1].cycle
    lines = ('{"do":"move","x":[NaN],"y":[0],"over_s":0.01}', '{"do":"move","x":[1e999],"y":[0],"over_s":0.01}',
             '{"do":"move","x":["a"],"y":[0],"over_s":0.01}', '{"do":"move","x":[],"y":[],"over_s":0.01}',
             '{"do":"move","x":[1],"y":[1],"over_s":-1}', '{"do":"jump"}', "{", "[]", '{"do":"turn"}')  # fmt: skip
    for line in lines:
        rig.link.write(line.encode() + b"\n")
        rig.keep(0.02, 0.0)
    still = max(abs(row.applied_1_mm) for row in rig.after(cycle))
    rejected = rig.link.status["rejected"]
    reached = {}
    for value in (50.0, 1e9, -1e9, 1.0, -1.0):
        rig.keep(0.35, value, -value)
        reached[str(value)] = [rig.rows[-1].applied_1_mm, rig.rows[-1].applied_2_mm]
    rows = rig.after(cycle)
    speed = 1e3 * np.abs(np.diff([(row.applied_1_mm, row.applied_2_mm) for row in rows], axis=0)).max()
    bounds = [(axis.low_mm, axis.high_mm) for axis in (rig.settings.first, rig.settings.second)]
    most = [max(abs(getattr(row, f"applied_{k}_mm")) for row in rows) for k in (1, 2)]
    return {
        "still_um": 1e3 * still, "rejected": rejected, "told": len(lines), "reached": reached, "bounds": bounds,
        "most": most, "speed_mm_per_s": float(speed), "fault": rows[-1].fault,
    }  # fmt: skip


def silent(rig):
    """The client says nothing any more."""
    rig.arm("feed")
    rig.keep(0.3, 0.5)
    return rig.fault(time.monotonic(), rig.rows[-1].cycle)


def killed(rig):
    """The bridge is killed in mid-move; another one takes over, and arms only when told."""
    rig.arm("feed")
    rig.keep(0.2, 0.2)
    rig.keep(0.02, 0.6)
    cycle, began = rig.rows[-1].cycle, time.monotonic()
    os.kill(rig.link.pid, signal.SIGKILL)
    rig.link.close()
    rig.join()
    told = rig.fault(began, cycle)
    rig.keep(0.1, 0.9)
    held = rig.rows[-1].fault
    rig.back()
    return told | {"held": held, "armed_again": rig.link.armed}


def tripped(rig):
    """The guard gives up in mid-move, at the speed of the path: it lets the beat stop."""
    rig.arm("feed")
    rig.keep(0.3, -1.1)
    cycle, began = rig.rows[-1].cycle, time.monotonic()
    rig.link.tell(do="trip")
    for step in range(48):
        rig.keep(0.005, -1.1 + 0.046 * step)
    return rig.fault(began, cycle)


def stopped(rig, how="estop"):
    """E-stop or machine off, and on again: stale counts must move nothing."""
    rig.arm("feed")
    rig.keep(0.3, 0.5, 0.4)
    cycle, began = rig.rows[-1].cycle, time.monotonic()
    rig.link.control(how)
    told = rig.fault(began, cycle)
    cycle = rig.rows[-1].cycle
    for name in ("estop_reset", "on"):
        rig.link.control(name)
        rig.keep(0.1, 0.5)
    rig.until(lambda: rig.link.status["enabled"])
    rig.keep(0.1, 0.0)
    places = [(row.joint_1_mm, row.joint_2_mm) for row in rig.after(cycle)]
    told["on_again_um"] = 1e3 * max(math.dist(places[0], place) for place in places)
    told["latched"] = rig.rows[-1].fault
    rig.link.ask("arm")
    rig.until(lambda: rig.link.answered)
    rig.keep(0.2, 0.0)
    places = [(row.joint_1_mm, row.joint_2_mm) for row in rig.after(cycle)]
    told["armed_um"] = 1e3 * max(math.dist(places[0], place) for place in places)
    rig.keep(0.3, 0.2)
    told["goes_um"] = 1e3 * abs(rig.rows[-1].joint_1_mm - places[-1][0])
    return told


def soft_limit(rig):
    """A program brings the axis near its soft limit, and the offset is cut short."""
    rig.arm("wall")
    rig.until(lambda: abs(rig.rows[-1].joint_1_mm - 199.4) < 1e-3, 10.0, x=0.0)
    cycle, began = rig.rows[-1].cycle, time.monotonic()
    rig.keep(0.3, 1.0)
    told = rig.fault(began, cycle)
    told["furthest_mm"] = max(row.joint_1_mm for row in rig.after(cycle))
    told["limited"] = any(row.limited for row in rig.after(cycle))
    rig.link.control("abort")
    rig.until(lambda: rig.link.status["program"] == "idle")
    told["unready"] = rig.link.unready()
    rig.back()
    return told


def aborted(rig):
    """The program is aborted: the feed stops, the offset stays."""
    rig.arm("feed")
    rig.keep(0.3, 0.5)
    cycle = rig.rows[-1].cycle
    rig.link.control("abort")
    rig.keep(0.4, 0.5)
    rows = rig.after(cycle)
    drift = 1e3 * max(abs(row.applied_1_mm - 0.5) for row in rows)
    fed = abs(rows[-1].feed_mm - rows[-100].feed_mm)
    refused = rig.link.unready()
    return {"drift_um": drift, "feeds_um": 1e3 * fed, "fault": rows[-1].fault, "unready": refused}


def second(rig):
    """Another bridge, and another LinuxCNC, are refused; the first goes on."""
    rig.arm()
    other = Link(rig.settings, rig.control.environment)
    said = ""
    try:
        until = time.monotonic() + 5.0
        while time.monotonic() < until:
            other.poll()
            rig.keep(0.01, 0.3)
    except RefusalError as error:
        said = error.reason
    other.close()
    rig.keep(0.2, 0.3)
    return {"bridge": said, "control": running(), "fault": rig.rows[-1].fault, "at_mm": rig.rows[-1].applied_1_mm}


SCENES = {
    "settles": settles, "nonsense": nonsense, "silent": silent, "killed": killed, "tripped": tripped,
    "estop": stopped, "off": lambda rig: stopped(rig, "off"), "soft_limit": soft_limit, "aborted": aborted,
    "second": second,
}  # fmt: skip


def faults(out=None):
    """Play every scene on one control."""
    told, begins = {}, {}
    with lathe() as folder, Control(load_settings(folder)) as control:
        rig = Rig(folder, control)
        told["off_at_start"] = rig.link.unready()
        for name in ("estop_reset", "on"):
            rig.link.control(name)
            rig.keep(0.1)
        rig.until(lambda: rig.link.status["enabled"])
        told["not_homed"] = rig.link.unready()
        rig.link.bring_up()
        for name, scene in SCENES.items():
            begins[name] = len(rig.rows)
            told[name] = scene(rig)
        rig.link.close()
        told["log"] = control.log()
    ends = [*begins.values(), len(rig.rows)][1:]
    for (name, begin), end in zip(begins.items() if out else (), ends, strict=False):
        picture(rig.rows[begin:end], pathlib.Path(out) / f"{name}.png")
    return told


def picture(rows, path):
    """Draw a scene, to be looked at."""
    from services.figures.linuxcnc import write_linuxcnc_figure
    from services.machines.linuxcnc.trace import COLUMNS

    path.parent.mkdir(parents=True, exist_ok=True)
    columns = {name: np.array([getattr(row, name, math.nan) for row in rows], dtype=float) for name in COLUMNS}
    columns["time_s"] = 1e-3 * (columns["cycle"] - columns["cycle"][0])
    for k, axis in ((1, "x1"), (2, "y1")):
        columns[f"requested_{axis}_mm"] = np.array([getattr(row, f"bounded_{k}_mm") for row in rows])
        columns[f"applied_{axis}_mm"] = np.array([getattr(row, f"applied_{k}_mm") for row in rows])
        columns[f"simulated_{axis}_mm"] = np.array([getattr(row, f"joint_{k}_mm") for row in rows])
    write_linuxcnc_figure(columns, path)


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


def conforms():
    """Let the adapter pass the conformance test, and find out how soon a joint moves."""
    case = load_case("thesis-652")
    with open_machine(Choice(adapter="linuxcnc"), case, 1, RUN) as node:
        found = conformance(node, case, Pace())
        return {"found": [(f.name, f.ok, f.detail) for f in found], "first_motion_ms": node.first_motion_ms}


def moves(count=9):
    """Move to and fro by 0.5 mm of slide Y1, commanded as of now."""
    case = load_case("thesis-652")
    with open_machine(Choice(adapter="linuxcnc"), case, 1, RUN) as node:
        node.prepare()
        trial = Trial(node, case, Pace())
        trial.tick(2)
        trial.ask("arm")
        assert trial.reaches("ACTIVE", seconds=3.0), trial.events
        for k in range(count):
            trial.tick(105, 1.62 * (k % 2 == 0))
        said = [event.text for event in trial.events if event.kind == "guard_state"]
        return {"first_motion_ms": node.first_motion_ms, "said": said, "load": os.getloadavg()[0]}


def loop(blocks=330):
    """Close the loop over LinuxCNC in one process, paced; the program feeds, the monitor is killed at the end."""
    case = load_case("thesis-652")
    closed = Loop(case, 1, _Still(), 2.2)
    run = closed.machine._run
    with lathe() as folder, open_machine(Choice(adapter="linuxcnc", folder=patient(folder)), case, 1, run) as node:
        node.prepare()
        closed.wrap("machine", lambda _: node)
        pace = Pace()
        for number in range(blocks):
            pace()
            closed.step(number)
        tape = closed.tape
        killed_at = blocks
        closed.wrap("monitor", lambda _: _Dead())
        while tape.of(MachineState)[-1].guard_state != "FAULT" and number < killed_at + 300:
            pace()
            number += 1
            closed.step(number)
        latest = number + 200
        while number < latest:  # until the watchdog has seen it, and for a while after that
            pace()
            number += 1
            closed.step(number)
            if node.link.last.fault and latest > number + 20:
                latest = number + 20
        last, trace = tape.of(MachineState), node.trace
        return summary_of(tape, last, trace, killed_at)


def summary_of(tape, states, trace: Trace, killed_at):
    from services.machines.linuxcnc.trace import COLUMNS

    values = dict(zip(COLUMNS, np.array(trace.rows).T, strict=True))
    frozen = values["applied_y1_mm"][values["fault"] > 0.5]
    before = values["time_s"] < 0.01 * killed_at
    return {
        "detected": any(r.state == "chatter" for r in tape.of(ChatterReport)),
        "at_end": [r.state for r in tape.of(ChatterReport)[-20:]],
        "shift_deg": states[killed_at - 1].shift_applied_deg,
        "states": sorted({state.guard_state for state in states[killed_at:]}), "reason": states[-1].reason,
        "latched": bool(values["fault"][-1]), "before": bool(values["fault"][before].any()),
        "drift_um": float(1e3 * np.ptp(frozen)) if frozen.size else None,
        "feed_mm": float(values["feed_mm"][before][-1]), "homed": states[-1].homed,
    }  # fmt: skip


class _Still:
    def now(self):
        return time.monotonic()

    def sleep_until(self, moment):
        pass


class _Dead:
    subscribes = ()

    def prepare(self):
        pass

    def handle(self, message):
        return []


def cycles(count=3):
    """Start and stop; nothing may be left."""
    left = []
    before = set(os.listdir("/tmp"))
    for _ in range(count):
        with lathe() as folder, Control(load_settings(folder)) as control:
            refused = running()
        shared = pathlib.Path("/proc/sysvipc/shm").read_text().splitlines()[1:]
        left.append([control.left(), LOCK.exists(), len(shared), bool(refused), running()])
    return {"left": left, "files": sorted(n for n in set(os.listdir("/tmp")) - before if "antiphase" in n)}


if __name__ == "__main__":
    name, *given = sys.argv[1:]
    values = [int(word) if word.isdigit() else word for word in given]
    sys.stdout.write(json.dumps(globals()[name](*values)) + "\n")
