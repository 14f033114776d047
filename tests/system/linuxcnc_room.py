"""A LinuxCNC of its own, with everything done to it that may go wrong; what happened goes to standard output as JSON.

It runs in a process of its own, so that it can be shut off from the rest of the computer (`unshare`).
"""

import contextlib
import json
import os
import pathlib
import sys
import time

import numpy as np

from services.closed_loop import Loop
from services.config import load_case
from services.machines.adapters import Choice, open_machine
from services.machines.conformance import RUN, Trial, conformance
from services.machines.linuxcnc.control import LOCK, Control, running
from services.machines.linuxcnc.settings import load_settings
from services.machines.linuxcnc.trace import Trace
from services.messages import ChatterReport, MachineState
from tests.system.linuxcnc_rig import TRIES, Busy, Pace, Rig, lathe, patient, picture
from tests.system.linuxcnc_scenes import QUIET, SCENES


def play(rig, name):
    """Play a scene; again when the watchdog spoke unasked, as it may where a computer tests on all its cores."""
    for _ in range(TRIES):
        rig.begin = len(rig.rows)
        with contextlib.suppress(Busy):
            seen = SCENES[name](rig)
            if name not in QUIET or not seen["fault"]:
                return seen
    return {"busy": f"the watchdog spoke unasked {TRIES} times", "fault": True}


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
        for name in SCENES:
            told[name] = play(rig, name)
            begins[name] = rig.begin
        rig.link.close()
        told["log"] = control.log()
    ends = [*begins.values(), len(rig.rows)][1:]
    axes = {"x1": rig.settings.first, "y1": rig.settings.second}
    for (name, begin), end in zip(begins.items() if out else (), ends, strict=False):
        rows = rig.rows[begin:end]
        marks = [mark for mark in rig.marks if rows[0].cycle <= mark[0] <= rows[-1].cycle]
        bounds = {key: (axis.low_mm, axis.high_mm) for key, axis in axes.items()} if name == "nonsense" else None
        picture(rows, pathlib.Path(out) / f"{name}.png", marks, bounds)
    return told


def conforms():
    """Let the adapter pass the conformance test, and find out how soon a joint moves."""
    case = load_case("thesis-652")
    with lathe() as folder, open_machine(Choice(adapter="linuxcnc", folder=patient(folder)), case, 1, RUN) as node:
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
