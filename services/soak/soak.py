"""The loop with recorder and dashboards for a set time, on a busy computer and through cuts of the link.

The machine sits beside the router, everybody else behind a link that is cut now and then. Every block has a number, so
whoever should have had it either had it, or has counted it as missing; what is in neither is lost silently.
"""

from __future__ import annotations

import pathlib
from collections import Counter
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from services.bus import Received
from services.children import Child, end_all, private_folder
from services.clock import Clock, utc_now
from services.errors import RefusalError
from services.gaps import Gaps
from services.messages import MachineState, SampleBlock
from services.node import Say
from services.process import Stopped, StopSignal, command_line, router_line
from services.soak.browser import FrameReader
from services.soak.growth import judged
from services.soak.link import Link
from services.soak.load import busy, memory_mb
from services.supervisor import START_S, Plan
from services.wire import DecodeError
from services.zenoh_bus import ZenohBus

TICK_S, MEMORY_S = 0.002, 0.5
CUT_S = 1.0
SERVO = "servo/turret1"
LEASE_S = 1.0
"""A sign of life that goes within so long of a cut of the link is no false death."""
CLOSING_S = 1.5


@dataclass(frozen=True, slots=True, kw_only=True)
class Wishes:
    """What a soak is to be.

    Attributes
    ----------
    duration_s
        How long the machine works (s).
    load
        Busy processes for each core besides the services.
    cut_every_s
        How often the link is cut for a second (s); infinite for never.
    dashboards
        How many are attached.
    """

    duration_s: float
    load: float
    cut_every_s: float
    dashboards: int


@dataclass(slots=True)
class Seen:
    """What the soak itself hears at the far end of the link, and of the processes."""

    ages_s: list[float] = field(default_factory=list[float])
    gaps: Gaps = field(default_factory=Gaps)
    blocks: int = 0
    late_by_cut: int = 0
    undecodable: int = 0
    deaths: Counter[str] = field(default_factory=Counter[str])
    guard: Counter[str] = field(default_factory=Counter[str])
    memory: dict[str, list[float]] = field(default_factory=dict[str, list[float]])
    memory_at: list[float] = field(default_factory=list[float])
    cuts: int = 0


def soak(
    plan: Plan,
    wishes: Wishes,
    *,
    stop: StopSignal,
    clock: Clock,
    say: Say,
    show: Callable[[float, int], None],
    out: pathlib.Path | None,
) -> dict[str, Any]:
    """Run the services so long, and return what became of every block.

    Parameters
    ----------
    plan
        What the services are started with.
    wishes
        Duration, load, cuts, dashboards.
    stop
        Ends it early.
    clock
        Monotonic.
    say
        Told in words what happens.
    show
        Called with seconds done and blocks heard.
    out
        Folder for the recording; None: a folder that goes away.

    Raises
    ------
    RefusalError
        If a service cannot start.
    """
    with ExitStack() as stack:
        folder = stack.enter_context(private_folder())
        children: dict[str, Child] = {}
        readers: list[FrameReader] = []
        stack.callback(lambda: end_all(reversed(children.values())))
        router = children["router"] = Child("router", router_line("tcp/127.0.0.1:0"), folder, quiet=False)
        endpoint = _endpoint(router, stop, clock)
        link = Link(endpoint)
        stack.callback(link.close)
        bus = stack.enter_context(ZenohBus.client(plan.machine, link.endpoint, stop.check))
        watch = _Watch(bus, children, link, wishes, clock, say)
        for name, line in _lines(plan, wishes, link.endpoint, out or folder).items():
            children[name] = Child(name, line, folder, quiet=True)
        lasts = ("--duration-s", str(wishes.duration_s), "--arm-after-s", "0", "--wait-s", str(START_S))
        children["machine"] = Child("machine", plan.line("machine", endpoint, *lasts), folder, quiet=True)
        try:
            watch.until_begun(stop)
            readers = [FrameReader(str(children[name].said()["url"])) for name in children if name.startswith("dash")]
            for reader in readers:
                stack.callback(reader.close)
            say(f"{len(children)} services; {wishes.load:g} busy processes for each core")
            stack.enter_context(busy(wishes.load))
            watch.until_ended(stop, show)
        except Stopped:
            say("stopped early")
        frames = [reader.frames for reader in readers]
        end_all(children[name] for name in ("machine", "monitor", "controller", "recorder"))
        watch.look()
        said = {name: child.said() for name, child in children.items()}
        return _answer(watch.seen, said, wishes) | {"frames_per_s": [n / watch.lasted_s for n in frames]}


def _lines(plan: Plan, wishes: Wishes, endpoint: str, folder: pathlib.Path) -> dict[str, list[str]]:
    attached = ("--machine", plan.machine, "--connect", endpoint, "--json")
    lines = {name: plan.line(name, endpoint) for name in ("monitor", "controller")}
    lines["recorder"] = command_line(
        "record", *attached, "--child", "--part-s", "60", "--out", str(folder / "soak.mcap")
    )
    for number in range(wishes.dashboards):
        lines[f"dashboard-{number + 1}"] = command_line("dashboard", plan.case, *attached, "--port", "0")
    return lines


def _endpoint(router: Child, stop: StopSignal, clock: Clock) -> str:
    until = clock.now() + START_S
    while clock.now() < until:
        said = router.said()
        if "endpoint" in said:
            return str(said["endpoint"])
        if router.ended() is not None:
            break
        with stop.waiting():
            clock.sleep_until(clock.now() + TICK_S)
    raise RefusalError(f"the router does not start: {router.why()}")


class _Watch:
    """Hears everything at the far end of the link, cuts it on time, and looks at the memory of the services."""

    def __init__(
        self, bus: ZenohBus, children: dict[str, Child], link: Link, wishes: Wishes, clock: Clock, say: Say
    ) -> None:
        self._children, self._link, self._wishes, self._clock, self._say = children, link, wishes, clock, say
        self._inbox, self._presence = bus.subscribe(), bus.presence()
        self.lasted_s = 1.0
        self._begun = self._cut_at = self._mend_at = self._looked = float("inf")
        self.seen = Seen()

    def until_begun(self, stop: StopSignal) -> None:
        """Wait for the first block."""
        until = self._clock.now() + 2 * START_S
        while not self.seen.blocks:
            self._wait(stop)
            ended = [name for name, child in self._children.items() if child.ended() is not None]
            if ended or self._clock.now() > until:
                name = ended[0] if ended else "machine"
                raise RefusalError(f"{name} does not start: {self._children[name].why()}")
        self._begun = self._looked = self._clock.now()
        self._cut_at = self._begun + self._wishes.cut_every_s

    def until_ended(self, stop: StopSignal, show: Callable[[float, int], None]) -> None:
        """Go on until the machine has done its work."""
        while self._children["machine"].ended() is None:
            self._wait(stop)
            show(self._clock.now() - self._begun, self.seen.blocks)
        until = self._clock.now() + CLOSING_S
        while self._clock.now() < until:
            self._wait(stop)
        self.lasted_s = self._clock.now() - self._begun

    def _wait(self, stop: StopSignal) -> None:
        self.look()
        now = self._clock.now()
        self._disturb(now)
        if now >= self._looked:
            self._looked = now + MEMORY_S
            self.seen.memory_at.append(now)
            for name, child in self._children.items():
                self.seen.memory.setdefault(name, []).append(memory_mb(child.pid))
        with stop.waiting():
            self._clock.sleep_until(now + TICK_S)

    def _disturb(self, now: float) -> None:
        last = self._begun + self._wishes.duration_s - 2.0 * CUT_S  # the loop shall have time to come back
        if now >= self._cut_at and now < last:
            self._link.cut()
            self.seen.cuts += 1
            self._say(f"{now - self._begun:.1f} s: the link is cut for {CUT_S:g} s")
            self._cut_at, self._mend_at = now + self._wishes.cut_every_s, now + CUT_S
        if now >= self._mend_at:
            self._link.mend()
            self._mend_at = float("inf")

    def _cut_lately(self, now: float) -> bool:
        since = now - (self._cut_at - self._wishes.cut_every_s)
        return self.seen.cuts > 0 and since < CUT_S + LEASE_S

    def look(self) -> None:
        """Take what has come."""
        for received in self._inbox.take():
            self._take(received)
        now = self._clock.now()
        for who, came in self._presence.changes():
            running = self._children.get(who)
            alive = running is not None and running.ended() is None and now - self._begun < self._wishes.duration_s
            if not came and alive and not self._cut_lately(now):
                self.seen.deaths[who] += 1
                self._say(f"{now - self._begun:.1f} s: {who} was taken for dead and is not")

    def _take(self, received: Received) -> None:
        try:
            message = received.message()
        except DecodeError:
            self.seen.undecodable += 1
            return
        self.seen.gaps.see(message)
        if isinstance(message, MachineState):
            self.seen.guard[message.guard_state] += 1
        if isinstance(message, SampleBlock):
            self.seen.blocks += 1
            if self._cut_lately(self._clock.now()):
                self.seen.late_by_cut += 1
            else:
                self.seen.ages_s.append(received.age_s(utc_now()))


def _answer(seen: Seen, said: dict[str, dict[str, Any]], wishes: Wishes) -> dict[str, Any]:
    sent = int(said["machine"].get("blocks") or 0)
    recorder, monitor = said["recorder"], said["monitor"]
    had = {
        "monitor": (int(monitor.get("handled") or 0), int(monitor.get("blocks_lost") or 0)),
        "recorder": (
            int(recorder.get("topics", {}).get(SERVO, 0)), int(recorder.get("missing_topics", {}).get(SERVO, 0))
        ),
        "soak": (seen.blocks, seen.gaps.missing().get(SERVO, 0)),
    }  # fmt: skip
    ages = 1e3 * np.array(seen.ages_s) if seen.ages_s else np.array([np.nan])
    return {
        "blocks_sent": sent,
        "blocks_lost_counted": sum(lost for _, lost in had.values()),
        "blocks_lost_silently": sum(abs(sent - heard - lost) for heard, lost in had.values()),
        "age_p50_ms": float(np.percentile(ages, 50)), "age_p99_ms": float(np.percentile(ages, 99)),
        "age_max_ms": float(ages.max()),
        **judged(seen.memory_at, seen.memory),
        "heard": {name: {"blocks": heard, "counted_missing": lost} for name, (heard, lost) in had.items()},
        "link_cuts": seen.cuts, "late_by_cut": seen.late_by_cut,
        "missed_deadlines": int(said["machine"].get("overruns") or 0),
        "commands_late": said["machine"].get("commands_late"), "loop_p50_ms": said["machine"].get("loop_p50_ms"),
        "loop_p99_ms": said["machine"].get("loop_p99_ms"), "guard_state": said["machine"].get("guard_state"),
        "guard_states": dict(seen.guard), "false_deaths": dict(seen.deaths), "undecodable": seen.undecodable,
        "recording_failure": recorder.get("failure"), "duration_s": wishes.duration_s,
        "dashboards": wishes.dashboards, "busy_per_core": wishes.load,
    }  # fmt: skip
