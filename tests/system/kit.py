"""Real processes and a real bus on loopback; waiting is for states, never for time alone."""

import contextlib
import ctypes
import json
import os
import pathlib
import platform
import signal
import socket
import subprocess
import time

import numpy as np

from services.messages import MachineState, OperatorRequest, SampleBlock, TurretCommand
from services.process import command_line
from services.zenoh_bus import ZenohBus

LONG_S = 60.0
"""Deadline of what must happen at all, on a machine under load."""

TGKILL = {"x86_64": 234, "aarch64": 131}.get(platform.machine(), 0)
"""Number of the Linux system call that signals one thread of another process."""


def until(holds, seconds=LONG_S):
    """Wait until `holds()`; returns whether it did."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        if holds():
            return True
        time.sleep(0.002)
    return holds()


def free_endpoint():
    with socket.create_server(("127.0.0.1", 0)) as server:
        return f"tcp/127.0.0.1:{server.getsockname()[1]}"


class Process:
    """`antiphase` in a process of its own, with what it says in files."""

    def __init__(self, folder, *arguments, line=None):
        self.folder = pathlib.Path(folder)
        self.folder.mkdir(parents=True, exist_ok=True)
        with (self.folder / "out").open("wb") as out, (self.folder / "err").open("wb") as err:
            files = {"stdin": subprocess.DEVNULL, "stdout": out, "stderr": err}
            where = os.environ | {"TMPDIR": str(self.folder)}  # whoever is killed leaves his files here
            self.popen = subprocess.Popen(line or command_line(*arguments), start_new_session=True, env=where, **files)

    pid = property(lambda self: self.popen.pid)

    def said(self):
        lines = (self.folder / "out").read_text().splitlines()
        return json.loads(lines[-1]) if lines else {}

    def told(self):
        return (self.folder / "err").read_text()

    def ended(self):
        return self.popen.poll()

    def stop(self, number=signal.SIGTERM, seconds=20.0):
        """Send a signal and return the exit code; fail if it hangs."""
        if self.ended() is None:
            self.popen.send_signal(number)
        return self.popen.wait(seconds)

    def stop_by_another_thread(self, seconds=20.0):
        """Let SIGTERM be taken by a thread that is not the main one, as the kernel may; return the exit code."""
        others = [int(task.name) for task in pathlib.Path(f"/proc/{self.pid}/task").iterdir()]
        others.remove(self.pid)
        found = ctypes.CDLL(None).syscall(TGKILL, self.pid, max(others), int(signal.SIGTERM))
        assert found == 0, "no such thread"
        return self.popen.wait(seconds)

    def close(self):
        if self.ended() is None:
            self.popen.kill()
        self.popen.wait()


@contextlib.contextmanager
def processes(tmp_path):
    """Give a function that starts processes, and end all that are left."""
    started = []

    def start(*arguments, **more):
        started.append(Process(tmp_path / f"p{len(started)}", *arguments, **more))
        return started[-1]

    try:
        yield start
    finally:
        for process in started:
            process.close()


class Spy:
    """Hears everything about a machine; a client of the bus like any other."""

    def __init__(self, endpoint, machine="lathe-1"):
        self.bus = ZenohBus.client(machine, endpoint, lambda: None)
        self.inbox, self.presence = self.bus.subscribe(), self.bus.presence()
        self.messages, self.changes, self.last = [], [], {}

    def look(self):
        for received in self.inbox.take():
            message = received.message()
            self.messages.append(message)
            self.last[type(message)] = message
        now = time.monotonic()
        self.changes += [(now, who, came) for who, came in self.presence.changes()]

    def until(self, holds, seconds=LONG_S):
        def looked():
            self.look()
            return holds()

        return until(looked, seconds)

    def of(self, kind):
        return [message for message in self.messages if isinstance(message, kind)]

    def new(self, kind, count=1, seconds=LONG_S):
        """Wait for messages that are not there yet, and return the last of them (None: too late)."""
        self.look()
        before = len(self.of(kind))
        return self.last[kind] if self.until(lambda: len(self.of(kind)) >= before + count, seconds) else None

    def until_guard(self, *states, seconds=LONG_S):
        def there():
            state = self.last.get(MachineState)
            return state is not None and state.guard_state in states

        return self.until(there, seconds)

    def seen(self, who, came, since):
        """Return how long after `since` a sign of life came or went (s), None if it did not."""
        return next((t - since for t, name, what in self.changes if (name, what) == (who, came) and t >= since), None)

    def ask(self, request, nonce):
        run = self.last[MachineState].run
        self.bus.publish(OperatorRequest(run=run, source="operator", sequence=0, request=request, nonce=nonce))

    def close(self):
        self.bus.close()


def block(number, *, run="run-1", samples=90, **changes):
    """Return a block of servo samples that says its number everywhere."""
    values = np.full(samples, float(number))
    names = ("x1_thrust_n", "x1_motor_position_m", "x1_stage_position_m", "y1_thrust_n", "y1_motor_position_m",
             "y1_stage_position_m", "dx1_um", "dy1p_um")  # fmt: skip
    plain = {
        "first_sample": number * samples, "sample_rate_hz": 9000.0, "shift_applied_deg": 0.0,
        "shift_requested_deg": 0.0, "moving": False,
        "in_cut": True, "spindle_speed_rpm": 1200.0, "diameter_mm": 25.0, "guard_state": "ACTIVE", "session": "s",
    }  # fmt: skip
    return SampleBlock(run=run, source="machine", sequence=number, **dict.fromkeys(names, values), **(plain | changes))


def command(number, *, run="run-1", session="s", shift_deg=0.0, **changes):
    """Return a command that is due at once."""
    plain = {
        "source": "controller", "cause": number, "order": 0, "action": "move", "issued_sample": 90 * number,
        "apply_at_sample": 90 * number, "expires_at_sample": 90 * number + 900, "reason": "a test",
    }  # fmt: skip
    return TurretCommand(run=run, session=session, sequence=number, shift_deg=shift_deg, **(plain | changes))
