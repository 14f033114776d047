"""Everything that may go wrong on a running LinuxCNC, one scene each; a scene returns what was seen."""

import math
import os
import signal
import time

import numpy as np

from services.errors import RefusalError
from services.machines.linuxcnc.control import running
from services.machines.linuxcnc.link import Link


def settles(rig):
    """0.5 mm while the feed runs."""
    rig.arm("feed")
    rig.keep(0.1, 0.0)
    cycle = rig.rows[-1].cycle
    rig.event("0.5 and -0.3 mm")
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
    rig.event(f"{len(lines)} nonsense lines")
    for line in lines:
        rig.link.write(line.encode() + b"\n")
        rig.keep(0.02, 0.0)
    still = max(abs(row.applied_1_mm) for row in rig.after(cycle))
    rejected = rig.link.status["rejected"]
    reached = {}
    for value in (50.0, 1e9, -1e9, 1.0, -1.0):
        rig.mark(f"{value:g} mm")
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
    rig.event("the client falls silent")
    return rig.fault(time.monotonic(), rig.rows[-1].cycle)


def killed(rig):
    """The bridge is killed in mid-move; another one takes over, and arms only when told."""
    rig.arm("feed")
    rig.keep(0.2, 0.2)
    rig.keep(0.02, 0.6)
    cycle, began = rig.rows[-1].cycle, time.monotonic()
    rig.event("the bridge is killed")
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
    rig.event("the guard trips")
    rig.link.tell(do="trip")
    for step in range(48):
        rig.keep(0.005, -1.1 + 0.046 * step)
    return rig.fault(began, cycle)


def stopped(rig, how="estop"):
    """E-stop or machine off, and on again: stale counts must move nothing."""
    rig.arm("feed")
    rig.keep(0.3, 0.5, 0.4)
    cycle, began = rig.rows[-1].cycle, time.monotonic()
    rig.event("emergency stop" if how == "estop" else "machine off")
    rig.link.control(how)
    told = rig.fault(began, cycle)
    cycle = rig.rows[-1].cycle
    for name in ("estop_reset", "on"):
        rig.link.control(name)
        rig.keep(0.1, 0.5)
    rig.mark("on again")
    rig.until(lambda: rig.link.status["enabled"])
    rig.keep(0.1, 0.0)
    places = [(row.joint_1_mm, row.joint_2_mm) for row in rig.after(cycle)]
    told["on_again_um"] = 1e3 * max(math.dist(places[0], place) for place in places)
    told["latched"] = rig.rows[-1].fault
    rig.mark("armed again")
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
    rig.event("1 mm, 0.6 mm from the limit")
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
    rig.event("the program is aborted")
    rig.link.control("abort")
    rig.keep(0.4, 0.5)
    rows = rig.after(cycle)
    drift = 1e3 * max(abs(row.applied_1_mm - 0.5) for row in rows)
    fed = abs(rows[-1].feed_mm - rows[-100].feed_mm)
    refused = rig.link.unready()
    return {"drift_um": drift, "feeds_um": 1e3 * fed, "fault": rows[-1].fault, "unready": refused}


def disarmed(rig):
    """The offset goes back to zero and is let go: after that nothing moves, whoever speaks."""
    rig.arm()
    rig.keep(0.2, 0.4)
    cycle = rig.rows[-1].cycle
    rig.event("disarmed")
    rig.link.ask("disarm")
    rig.until(lambda: rig.link.answered)
    let_go = next(row.cycle for row in rig.after(cycle) if not row.run) - cycle
    rig.keep(0.2, 0.4)
    last, state = rig.rows[-1], rig.link.status["bridge"]
    return {"let_go_ms": let_go, "state": state, "at_um": 1e3 * abs(last.applied_1_mm), "fault": last.fault}


def second(rig):
    """Another bridge, and another LinuxCNC, are refused; the first goes on."""
    rig.arm()
    rig.event("0.3 mm, and a second bridge comes")
    other = Link(rig.settings, rig.control.environment)
    said = ""
    try:
        until = time.monotonic() + 5.0
        while time.monotonic() < until:
            other.poll()
            rig.keep(0.01, 0.3)
    except RefusalError as error:
        said = error.reason
    rig.mark("it is refused")
    other.close()
    rig.keep(0.2, 0.3)
    return {"bridge": said, "control": running(), "fault": rig.rows[-1].fault, "at_mm": rig.rows[-1].applied_1_mm}


SCENES = {
    "settles": settles, "nonsense": nonsense, "silent": silent, "killed": killed, "tripped": tripped,
    "estop": stopped, "off": lambda rig: stopped(rig, "off"), "soft_limit": soft_limit, "aborted": aborted,
    "disarmed": disarmed, "second": second,
}  # fmt: skip
QUIET = ("settles", "nonsense", "aborted", "disarmed", "second")
"""Scenes in which nothing may latch a fault."""
