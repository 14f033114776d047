"""Messages of a machine that is easy to predict, a clock that is set by hand, and a feed that is filled by hand."""

import numpy as np

from services.bus import Received
from services.dashboard.facts import Facts
from services.dashboard.hub import Hub
from services.dashboard.view import View
from services.messages import ChatterReport, Event, ForceBlock, MachineState, TurretCommand
from services.wire import encode, encoding_of, topic_of

RATE_HZ = 9000.0
BLOCK = 90
FACTS = Facts(
    machine="lathe-1", case="thesis-652", title="a bar", sample_rate_hz=RATE_HZ, band_hz=(500.0, 750.0), tools=2,
    shift_limits_deg=(0.0, 4.5),
)  # fmt: skip


class HandClock:
    def __init__(self):
        self.time = 100.0

    def now(self):
        return self.time

    def sleep_until(self, moment):
        self.time = max(self.time, moment)


def state(number, *, run="r1", **changes):
    values = {
        "source": "machine", "sequence": number, "sample": (number + 1) * BLOCK - 1, "spindle_speed_rpm": 1200.0,
        "spindle_angle_rad": 0.0, "z_mm": 6.0, "feed_mm_per_rev": 0.15, "diameter_mm": 25.0, "override_percent": 100.0,
        "in_cut": True, "homed": True, "feed_hold": False, "tool": 1, "guard_state": "ACTIVE", "session": "s",
        "shift_requested_deg": 0.0, "shift_target_deg": 0.0, "shift_applied_deg": 0.0, "slide_x1_um": 0.0,
        "slide_y1_um": 0.0, "commands_accepted": number, "commands_rejected": 0, "commands_late": 0, "reason": "",
    }  # fmt: skip
    return MachineState(run=run, **(values | changes))


def report(number, *, run="r1", **changes):
    values = {
        "source": "monitor", "sequence": number, "first_sample": number * BLOCK, "samples": BLOCK,
        "guard_state": "ACTIVE", "session": "s", "state": "quiet", "indicator": 1.0, "limit": 5.0,
        "limit_source": "cutting", "frequency_hz": None, "amplitude_n": 0.5, "kind": None, "confidence": 0.0,
        "gap_samples": 0, "moving": False, "in_cut": True, "spindle_speed_rpm": 1200.0, "diameter_mm": 25.0,
        "shift_requested_deg": 0.0, "shift_applied_deg": 0.0, "line_n": 0.5, "line_limit_n": 4.0, "lines": (),
        "cutting": True, "comb_hz": None, "notes": (), "false_alarms_per_h": 0.01,
    }  # fmt: skip
    return ChatterReport(run=run, **(values | changes))


def chatter(number, hz=652.0, **changes):
    values = {"state": "chatter", "frequency_hz": hz, "kind": "regenerative", "indicator": 40.0, "confidence": 0.9}
    return report(number, **(values | changes))


def force(number, x1=None, y1p=None, *, run="r1", samples=BLOCK, **changes):
    zeros = np.zeros(samples)
    values = {"source": "monitor", "sequence": number, "first_sample": number * BLOCK, "sample_rate_hz": RATE_HZ,
              "latency_s": 0.0}  # fmt: skip
    return ForceBlock(
        run=run, force_x1_n=zeros if x1 is None else x1, force_y1p_n=zeros if y1p is None else y1p, **(values | changes)
    )


def command(number, *, run="r1", **changes):
    values = {"source": "controller", "sequence": number, "session": "s", "shift_deg": 2.76, "order": 0,
              "action": "move", "issued_sample": number * BLOCK, "apply_at_sample": number * BLOCK,
              "expires_at_sample": number * BLOCK + 900, "reason": "chatter"}  # fmt: skip
    return TurretCommand(run=run, **(values | changes))


def event(number, text="something", **changes):
    values = {"run": "r1", "source": "machine", "sample": number * BLOCK, "kind": "guard_state"}
    return Event(sequence=number, text=text, **(values | changes))


def block(number, **of_report):
    """What is said of one block."""
    verdict = of_report.pop("verdict", report)
    return [state(number), force(number), verdict(number, **of_report)]


def received(message):
    return Received(topic_of(type(message)), encode(message), encoding_of(type(message)))


class HandFeed:
    where = "tcp/127.0.0.1:1"

    def __init__(self):
        self.waiting, self.peers, self.published, self.there = [], [], [], True
        self.asked, self.text = 0, None

    def say(self, *messages):
        self.waiting += [received(message) for message in messages]

    def linked(self):
        return self.there

    def take(self):
        taken, self.waiting = self.waiting, []
        return taken

    def changes(self):
        changed, self.peers = self.peers, []
        return changed

    def ask(self):
        self.asked += 1

    def told(self):
        text, self.text = self.text, None
        return text

    def publish(self, message):
        self.published.append(message)


def make_view():
    clock = HandClock()
    return View(FACTS, clock), clock


def make_hub():
    clock, feed = HandClock(), HandFeed()
    return Hub(View(FACTS, clock), feed, clock), feed, clock


def play(view, clock, blocks, make=block):
    """Let a view hear some blocks in real time."""
    for number in blocks:
        clock.time += 0.01
        for message in make(number):
            view.handle(message)
