"""Machine, monitor and controller in processes of their own over a real LinuxCNC, and the monitor killed in mid-cut."""

import os
import pathlib
import signal
from itertools import pairwise

import numpy as np

from services.config import load_case
from services.machines.linuxcnc.trace import read_trace
from services.messages import ChatterReport, MachineState, SampleBlock
from services.nodes.monitor import MonitorNode
from services.zenoh_bus import ZenohBus
from tests.system.kit import Spy, processes
from tests.system.linuxcnc_rig import lathe, patient, place_drift

CASE, QUIET_BLOCKS, PATIENCE_S, MOST_MOVES = "thesis-652", 60, 40.0, 3


def chain(when="moving", out=None):
    """Let chatter come and go, kill the monitor while the offset moves or is applied, and see what becomes of it."""
    with lathe() as folder, processes(folder / "p") as start:
        if out is None:
            patient(folder)
        with ZenohBus.router("lathe-1", "tcp/127.0.0.1:0") as router:
            spy = Spy(router.endpoint)
            plain = (CASE, "--connect", router.endpoint, "--json")
            monitor, _ = (start(service, *plain) for service in ("monitor", "controller"))
            path = folder / "trace.csv"
            own = ("--adapter", "linuxcnc", "--linuxcnc", str(folder), "--trace", str(path), "--arm-after-s", "0")
            machine = start("machine", *plain, *own, "--forever")
            try:
                return see(spy, monitor, machine, path, when, out)
            finally:
                spy.close()


def see(spy, monitor, machine, path, when, out):
    """Kill the monitor at its time, and return what followed, in the time of the samples."""
    case = load_case(CASE)
    ready = {"moving": mid_move, "applied": at_rest}[when]
    assert spy.until(lambda: MachineState in spy.last), machine.told()  # compiled, by then
    if not spy.until(lambda: ready(spy), PATIENCE_S):
        busy = too_late(spy, machine)
        assert busy, machine.told()
        return {"busy": busy}
    os.kill(monitor.pid, signal.SIGKILL)
    killed_s = spy.last[MachineState].sample / case.settings.sample_rate_hz
    shift_deg = spy.last[MachineState].shift_applied_deg
    assert spy.until_guard("FAULT"), machine.told()
    spy.new(MachineState, 100)
    states = spy.of(MachineState)
    assert machine.stop() == 0, machine.told()
    trace = read_trace(path)
    if out is not None:
        draw(trace, pathlib.Path(out) / f"monitor_killed_{when}.png", killed_s, states, case)
    last_s = last_taken(states, case)
    if held := held_before(states, min(last_s, killed_s) * case.settings.sample_rate_hz):
        return {"busy": held}
    latched, since = trace["fault"] > 0.5, trace["time_s"] > killed_s
    after = since & ~latched
    feeds = np.flatnonzero(since & (np.abs(np.diff(trace["feed_mm"], append=trace["feed_mm"][-1])) > 1e-4))
    return {
        "detected": any(r.state == "chatter" for r in spy.of(ChatterReport)), "at_end": heard_again(spy, states, case),
        "killed_s": killed_s, "shift_deg": shift_deg, "shift_at_end_deg": states[-1].shift_applied_deg,
        "guard_ms": {name: 1e3 * (reached(states, name, case, last_s) - last_s) for name in ("HOLDING", "FAULT")},
        "last_command_ms": 1e3 * (last_s - killed_s),
        "latched_ms": 1e3 * float(trace["time_s"][latched][0] - killed_s) if latched.any() else None,
        "feed_stands_ms": 1e3 * float(trace["time_s"][feeds[-1]] - killed_s), "reason": states[-1].reason,
        "before": bool((latched & ~since).any()), "latched": bool(latched[-1]),
        "moved_um": place_drift(trace, after), "drift_um": place_drift(trace, latched), "feed_mm": trace["feed_mm"][-1],
        "load": os.getloadavg()[0],
    }  # fmt: skip


def too_late(spy, machine):
    """Return how far this computer was from real time, empty if it kept up."""
    state, moved = spy.last[MachineState], machine.told().count("the schedule moves")
    late = f"{state.commands_late} of {state.commands_accepted} commands late, the schedule moved {moved} times"
    return late if state.commands_late > 0.02 * state.commands_accepted or moved >= MOST_MOVES else ""


def held_before(states, sample):
    """Return whether the guard missed commands before that sample, empty if not: this computer was too busy."""
    seen = [state.guard_state for state in states if state.sample <= sample]
    missed = seen[seen.index("ACTIVE") :].count("HOLDING") if "ACTIVE" in seen else 0
    return f"the guard held for {missed} blocks while all processes lived" if missed else ""


def heard_again(spy, states, case):
    """Return what a monitor that lived on would have said last before the guard gave up."""
    node, last = MonitorNode(case, states[0].run), round(100 * reached(states, "FAULT", case))
    node.prepare()
    said = [m for block in spy.of(SampleBlock) if block.sequence < last for m in node.handle(block)]
    return [report.state for report in said if isinstance(report, ChatterReport)][-100:]


def mid_move(spy):
    """Whether the turret is on its way."""
    state = spy.last.get(MachineState)
    return state is not None and abs(state.shift_target_deg) > 1.0 and 0.3 < abs(state.shift_applied_deg) < 1.5


def at_rest(spy):
    """Whether the turret has arrived, and the chatter has been gone for a while."""
    states, reports = spy.of(MachineState)[-QUIET_BLOCKS:], spy.of(ChatterReport)[-QUIET_BLOCKS:]
    moved = bool(states) and min(abs(s.shift_applied_deg) for s in states) > 2.0
    return moved and all(report.state != "chatter" for report in reports)


def last_taken(states, case):
    """Return when the last command was taken (s)."""
    taken = [now.sample for before, now in pairwise(states) if now.commands_accepted > before.commands_accepted]
    return taken[-1] / case.settings.sample_rate_hz


def reached(states, name, case, since_s=0.0):
    """Return when the guard was in a state first (s), from a time on."""
    since = since_s * case.settings.sample_rate_hz
    samples = [state.sample for state in states if state.guard_state == name and state.sample >= since]
    return samples[0] / case.settings.sample_rate_hz if samples else float("nan")


def draw(trace, path, killed_s, states, case):
    """Draw from the first motion on."""
    from services.figures.linuxcnc import write_linuxcnc_figure

    path.parent.mkdir(parents=True, exist_ok=True)
    marks = [(killed_s, "the monitor is killed")]
    marks += [(reached(states, name, case, killed_s), f"guard {name}") for name in ("HOLDING", "FAULT")]
    part = trace["time_s"] > min(killed_s - 0.3, 2.0)
    write_linuxcnc_figure(
        {name: values[part] for name, values in trace.items()}, path, title="monitor killed", marks=marks
    )
