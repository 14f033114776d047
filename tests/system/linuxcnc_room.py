"""A LinuxCNC of its own, with everything done to it that may go wrong; what happened goes to standard output as JSON.

It runs in a process of its own, so that it can be shut off from the rest of the computer (`unshare`).
"""

import contextlib
import json
import os
import pathlib
import sys

from services.config import load_case
from services.machines.adapters import Choice, open_machine
from services.machines.conformance import RUN, Trial, conformance
from services.machines.linuxcnc.control import LOCK, Control, running
from services.machines.linuxcnc.settings import load_settings
from tests.system.linuxcnc_chain import chain
from tests.system.linuxcnc_rig import TRIES, Busy, Pace, Rig, lathe, patient, picture
from tests.system.linuxcnc_scenes import QUIET, SCENES


def play(rig, name):
    """Play a scene; again when the watchdog spoke unasked, as it may where a computer tests on all its cores."""
    for _ in range(TRIES):
        rig.begin, rig.end = len(rig.rows), 0
        with contextlib.suppress(Busy):
            seen = SCENES[name](rig)
            rig.end = rig.end or len(rig.rows)
            if name not in QUIET or not seen["fault"]:
                return seen
    return {"busy": f"the watchdog spoke unasked {TRIES} times", "fault": True}


def faults(out=None):
    """Play every scene on one control."""
    told, spans = {}, {}
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
            spans[name] = slice(rig.begin, rig.end)
        rig.link.close()
        told["log"] = control.log()
    axes = {"x1": rig.settings.first, "y1": rig.settings.second}
    for name, span in spans.items() if out else ():
        rows = rig.rows[span]
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


def cycles(count=3):
    """Start and stop control and bridge; nothing may be left."""
    left = []
    before = set(os.listdir("/tmp"))
    for _ in range(count):
        with lathe() as folder, Control(load_settings(folder)) as control:
            rig = Rig(folder, control)
            rig.link.bring_up()
            refused = running()
            rig.link.close()
        shared = pathlib.Path("/proc/sysvipc/shm").read_text().splitlines()[1:]
        left.append([control.left(), LOCK.exists(), len(shared), bool(refused), running()])
    ours = ("antiphase-linuxcnc-", "antiphase-lathe-", "lathe-")
    return {"left": left, "files": sorted(n for n in set(os.listdir("/tmp")) - before if n.startswith(ours))}


if __name__ == "__main__":
    name, *given = sys.argv[1:]
    values = [int(word) if word.isdigit() else word for word in given]
    scenes = {"faults": faults, "conforms": conforms, "moves": moves, "chain": chain, "cycles": cycles}
    sys.stdout.write(json.dumps(scenes[name](*values)) + "\n")
