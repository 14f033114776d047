#!/usr/bin/python3
"""Between JSON lines on standard input and output and the pins of a running LinuxCNC.

It runs under the Python that LinuxCNC was built for and imports nothing but that and the standard library. It decides
nothing: bounds and watchdog are in the servo thread. In, one object per line:

{"do": "move", "x": [...], "y": [...], "over_s": 0.01}   points of the two offsets (mm), spread evenly over the time
{"do": "arm"}      clear the offsets, take back a latched fault; {"do": "disarm"} clear them and let go
{"do": "trip"}     stop beating: freezes the offset, holds the feed, latched
{"do": "hold", "on": true}                               feed hold
{"do": "control", "name": "estop_reset", "value": ...}   one of CONTROL; those in SLOW are answered when done
{"do": "ping"}

Out, one object per line: {"rows": [[cycle, ...], ...], "at": T, "status": {...}}; a row has what the sampler of
`antiphase.hal` samples, `at` is when the last row was read, on this computer's monotonic clock.
"""

import contextlib
import json
import math
import os
import select
import sys
import time
from collections import deque

ROW = "fffffffbbbb"
BOUNDED, FAULT, RUN, LIMITED, ENABLED, APPLIED = (6, 7), 8, 9, 10, 11, (4, 5)
PINS = {"x": "ask-1", "y": "ask-2", "beat": "beat", "arm": "arm", "ack": "ack", "clear": "clear", "hold": "hold"}
PREFIX = "antiphase-"
LOOP_S, SAY_S, STATUS_S = 0.001, 0.004, 0.01
MOST_POINTS, MOST_AHEAD_S, MOST_UNREAD = 100, 0.002, 1 << 20
REST_MM, NEAR_MM, ARMING_S, CYCLES = 1e-6, 5e-3, 3.0, 5
SLOW = ("home", "load")
NOT_HIS = "the state of LinuxCNC cannot be read: attach as the user who started it, with the same HOME"
CONTROL = ("estop", "estop_reset", "on", "off", "home", "load", "run", "abort", "manual")


def foreign(names):
    """Return the living bridge among names of components, and the pins' prefixes that dead ones left."""
    dead = []
    for name in sorted(names):
        pid = name[len(PREFIX) :]
        if not pid.isdigit() or int(pid) == os.getpid():
            continue
        if os.path.exists(f"/proc/{pid}"):
            return int(pid), dead
        dead.append(name)
    return None, dead


class Refused(Exception):  # noqa: N818  (an answer, not a failure)
    """The bridge cannot be, or cannot do what it was asked."""


def carry_out(linuxcnc, command, name, value):
    """Give an order to the control, and wait where the next one depends on it."""
    c = linuxcnc
    states = {"estop": c.STATE_ESTOP, "estop_reset": c.STATE_ESTOP_RESET, "on": c.STATE_ON, "off": c.STATE_OFF}
    if name in states:
        command.state(states[name])
    elif name == "home":
        command.mode(c.MODE_MANUAL)
        command.wait_complete()
        command.teleop_enable(0)
        command.wait_complete()
        command.home(-1)
    elif name == "load":
        command.mode(c.MODE_AUTO)
        command.wait_complete()
        command.program_open(value)
        command.wait_complete()
    elif name == "run":
        command.auto(c.AUTO_RUN, 0)
    elif name == "abort":
        command.abort()
    else:
        command.mode(c.MODE_MANUAL)


class Orders:
    """Gives orders to the control from a process of its own.

    The control answers when its task comes round, on a busy computer after tenths of a second: the beat cannot wait.

    Parameters
    ----------
    linuxcnc
        The module.
    """

    def __init__(self, linuxcnc):
        self._answers, answers = os.pipe()
        orders, self._orders = os.pipe()
        if os.fork() == 0:
            nothing = os.open(os.devnull, os.O_RDWR)
            for taken in (0, 1):
                os.dup2(nothing, taken)
            os.close(self._orders)
            try:
                self._serve(linuxcnc, orders, answers)
            finally:
                os._exit(0)
        os.close(orders)
        os.close(answers)
        os.set_blocking(self._answers, False)

    @staticmethod
    def _serve(linuxcnc, orders, answers):
        command = linuxcnc.command()
        with os.fdopen(orders) as lines:
            for line in lines:
                with contextlib.suppress(linuxcnc.error, TypeError):  # what was not done is seen in the state
                    carry_out(linuxcnc, command, *json.loads(line))
                os.write(answers, b"." if json.loads(line)[0] in SLOW else b" ")

    def give(self, name, value):
        """Pass an order on."""
        os.write(self._orders, json.dumps([name, value]).encode() + b"\n")

    def done(self):
        """Return how many of those that take long were carried out since the last call."""
        try:
            return os.read(self._answers, 1 << 10).count(b".")
        except BlockingIOError:
            return 0


class Bridge:
    """The pins, the queue of points, and the sequence of arming.

    Parameters
    ----------
    hal, linuxcnc
        The modules of LinuxCNC, or what acts like them.
    orders
        `Orders`, or what acts like them.
    fresh
        Time without a move after which the beat stops (s).
    now
        Monotonic clock (s).
    """

    def __init__(self, hal, linuxcnc, orders, fresh, now=time.monotonic):
        self._now, self._fresh, self._linuxcnc = now, fresh, linuxcnc
        self._pins = self._join(hal)
        self._stream = hal.stream(self._pins, hal.sampler_base, ROW)
        self._stat, self._orders = linuxcnc.stat(), orders
        self._points = deque()
        self._rest((self._pins["x"], self._pins["y"]))
        self._heard, self._armed, self._tripped = -math.inf, -math.inf, False
        self._steps = self._done = self._row = None
        self._until, self._from, self.asked = 0.0, 0, 0
        self._beat, self._polled, self._said = False, -math.inf, -math.inf
        self.rows, self.status, self.rejected, self.state, self.why = [], {}, 0, "idle", ""

    def _join(self, hal):
        pins = hal.component(f"{PREFIX}{os.getpid()}")
        for name in PINS:
            pins.newpin(name, hal.HAL_FLOAT if name in "xy" else hal.HAL_BIT, hal.HAL_OUT)
        pins.ready()
        owners = {pin["NAME"].rsplit(".", 1)[0] for pin in hal.get_info_pins() if pin["NAME"].startswith(PREFIX)}
        alive, dead = foreign(owners)
        if alive is not None:
            pins.exit()
            raise Refused(f"another bridge (process {alive}) holds the offsets of this LinuxCNC: end it first")
        for name in dead:
            for pin in PINS:
                hal.disconnect(f"{name}.{pin}")
        signals = {signal["NAME"] for signal in hal.get_info_signals()}
        missing = sorted(set(PINS.values()) - signals)
        if missing:
            pins.exit()
            raise Refused(f"LinuxCNC runs without antiphase.hal: it has no signal {', '.join(missing)}")
        for name, signal in PINS.items():
            # request and arm stay as they were left: if a bridge died, the watchdog shall see that
            pins[name] = hal.get_value(signal) if name in ("x", "y", "arm") else False
            hal.connect(f"{PREFIX}{os.getpid()}.{name}", signal)
        return pins

    def hear(self, line):
        """Take one line; nonsense is counted and is no sign of life."""
        try:
            told = json.loads(line)
            getattr(self, "_do_" + told.pop("do"))(**told)
        except (ValueError, TypeError, AttributeError, KeyError, OverflowError):
            self.rejected += 1
        except Refused as refused:
            self.state, self.why = "refused", str(refused)

    def _do_ping(self):
        pass

    def _do_move(self, x, y, over_s):
        if not 0 < len(x) == len(y) <= MOST_POINTS or not 0 < over_s <= 1:
            raise ValueError
        points = [(float(a), float(b)) for a, b in zip(x, y, strict=True)]
        if not all(math.isfinite(a) and math.isfinite(b) for a, b in points):
            raise ValueError
        now = self._heard = self._now()
        if self.state != "armed":
            return
        begin = self._points[-1][0] if self._points else now
        if not self._points or begin > now + MOST_AHEAD_S:
            begin = now
            self._rest(self._here)
        step = over_s / len(points)
        self._points.extend((begin + (k + 1) * step, point) for k, point in enumerate(points))

    def _do_trip(self):
        self._tripped = True

    def _do_hold(self, on):
        self._pins["hold"] = bool(on)

    def _do_arm(self):
        self.asked += 1
        self._begin(self._arming)

    def _do_disarm(self):
        self.asked += 1
        self._begin(self._disarming)

    def _do_control(self, name, value=None):
        if name not in CONTROL:
            raise ValueError
        self._orders.give(name, value)

    def _begin(self, sequence):
        if self.status.get("program") != "idle":
            raise Refused("a program runs: abort it, and arm with the tool out of the cut")
        if not self.status.get("enabled"):
            raise Refused("the machine is not on")
        self._rest((0.0, 0.0))
        self._tripped = False
        self.state, self.why, self._until = "arming", "", self._now() + ARMING_S
        self._steps = sequence()
        self._next()

    def _next(self):
        """Go to the next step; only cycles after it can say that it is done."""
        self._step, self._done = next(self._steps, ("", None))
        self._drain()
        self._from = self._row[0] if self._row else 0

    def _rest(self, point):
        """Forget the path and stay at a point."""
        self._points.clear()
        self._here, self._left = point, (self._now(), point)

    def _arming(self):
        """Yield until each step of the sequence is done; what it waits for is seen in the servo thread."""
        pins = self._pins
        pins["arm"] = pins["ack"] = False
        yield "request at 0", lambda row: all(abs(row[k]) < NEAR_MM for k in BOUNDED)
        pins["clear"] = pins["arm"] = True
        yield "watchdog", lambda row: row[RUN]
        pins["ack"] = True
        yield "fault taken back", lambda row: not row[FAULT]
        pins["ack"] = False
        yield "offset at 0", lambda row: all(abs(row[k]) < REST_MM for k in APPLIED)
        pins["clear"] = False
        self.state, self._armed = "armed", self._now()

    def _disarming(self):
        pins = self._pins
        pins["clear"] = True
        yield "offset at 0", lambda row: row[FAULT] or all(abs(row[k]) < REST_MM for k in APPLIED)
        pins["arm"] = False
        yield "let go", lambda row: not row[RUN]
        pins["clear"] = False
        self.state = "idle"

    def turn(self):
        """Do what is due now."""
        now = self._now()
        self.asked += self._orders.done()
        self._drain()
        self._advance(now)
        self._play(now)
        arming = self.state == "arming"
        fresh = now - max(self._heard, self._armed) < self._fresh
        if arming or (self.state == "armed" and fresh and not self._tripped):
            self._beat = not self._beat
            self._pins["beat"] = self._beat
        if now - self._polled >= STATUS_S:
            self._polled = now
            self.look()

    def _drain(self):
        """Take all cycles that were sampled until now."""
        while self._stream.readable:
            values = self._stream.read()
            self._row = (self._stream.sampleno, *values)
            self.rows.append(self._row)

    def _advance(self, now):
        """Go on with a sequence when the last row says that its step is done."""
        if self.state == "armed" and self._row is not None and self._row[FAULT]:
            self.state, self.why = "fault", ""
            self._rest(self._here)
        if self.state != "arming":
            return
        if self._until < now:
            self.state, self.why = "refused", f"no '{self._step}' in the servo thread within {ARMING_S:g} s"
            self._pins["arm"] = False
        elif self._row is not None and self._row[0] >= self._from + CYCLES and self._done(self._row):
            self._next()

    def _play(self, now):
        """Set the request to where the path is now, on a straight line between two points."""
        while self._points and self._points[0][0] <= now:
            self._left = self._points.popleft()
        begin, here = self._left
        if self._points:
            until, goal = self._points[0]
            share = min(1.0, max(0.0, (now - begin) / (until - begin)))
            here = tuple(a + share * (b - a) for a, b in zip(here, goal, strict=True))
        self._here = here
        self._pins["x"], self._pins["y"] = here

    def look(self):
        """Read the state of the control."""
        stat, c = self._stat, self._linuxcnc
        stat.poll()
        self.status = {
            "estop": bool(stat.estop), "enabled": bool(stat.enabled), "homed": [bool(h) for h in stat.homed[:9]],
            "program": "idle" if stat.interp_state == c.INTERP_IDLE else "runs", "paused": bool(stat.paused),
            "position": list(stat.actual_position[:9]), "version": c.version, "ini": stat.ini_filename,
            "bridge": self.state, "why": self.why, "rejected": self.rejected,
        }  # fmt: skip

    def said(self):
        """Return the next line for the client, None when it is not time."""
        now = self._now()
        if now - self._said < SAY_S:
            return None
        self._said, rows, self.rows = now, self.rows, []
        self.status |= {"asked": self.asked, "bridge": self.state, "why": self.why, "rejected": self.rejected}
        return json.dumps({"rows": rows, "at": now, "status": self.status})


def main(arguments):
    """Serve until standard input ends."""
    import hal
    import linuxcnc

    try:
        bridge = Bridge(hal, linuxcnc, Orders(linuxcnc), float(arguments[0]))
        bridge.look()
        bridge.look()  # without the file in the home of whoever started LinuxCNC only the first one works
    except (Refused, hal.error, linuxcnc.error, RuntimeError, SystemError) as error:
        why = NOT_HIS if isinstance(error, SystemError) else str(error) or "LinuxCNC does not answer"
        os.write(1, json.dumps({"refused": why}).encode() + b"\n")
        return 3
    os.set_blocking(0, False)
    os.set_blocking(1, False)
    unread, unsaid = b"", b""
    while True:
        ready, _, _ = select.select([0], [], [], LOOP_S)
        if ready:
            got = os.read(0, 1 << 16)
            if not got:
                return 0
            *lines, unread = (unread + got).split(b"\n")
            for line in lines:
                bridge.hear(line)
        bridge.turn()
        said = bridge.said()
        if said is not None and len(unsaid) < MOST_UNREAD:
            unsaid += said.encode() + b"\n"
        if unsaid:
            try:
                unsaid = unsaid[os.write(1, unsaid) :]
            except BlockingIOError:
                pass
            except BrokenPipeError:
                return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
