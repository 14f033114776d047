"""Runs the machine in real time: a start barrier, then one block every 10 ms by a monotonic clock.

Block k goes out at start + 10 ms k. What was commanded until then is taken before it. A machine that is itself late
by more than a block moves its schedule (and counts it) instead of catching up: commands would all come too late.
"""

from __future__ import annotations

import gc
import uuid
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from services.bus import Node
from services.clock import Clock
from services.errors import RefusalError
from services.messages import (
    BLOCK_S,
    Event,
    MachineState,
    Message,
    OperatorRequest,
    SampleBlock,
    Tick,
    Truth,
    TurretCommand,
)
from services.node import Herald, Say, refuse_second
from services.process import Stopped, StopSignal
from services.zenoh_bus import ZenohBus

NEEDED = frozenset(("monitor", "controller"))
MOST_TAKEN = 64
"""Messages of a topic that are looked at in one block; what floods beyond that is thrown away unread."""
FINE_S, WATCH_S, COARSE_S = 0.0002, 0.004, 0.001
MOST_LATENCIES = 100_000
"""Of how many commands the latency is kept: those of the last quarter of an hour; a machine runs for weeks."""
LINGER_S = 0.3
"""How long the command that the last block caused is waited for."""


@dataclass(slots=True)
class Paced:
    """What there is to count in a paced run."""

    blocks: int = 0
    overruns: int = 0
    slipped_s: float = 0.0
    wall_s: float = 0.0
    latency_ms: deque[float] = field(default_factory=lambda: deque(maxlen=MOST_LATENCIES))
    stopped: bool = False
    state: MachineState | None = None

    def summary(self, every_latency: bool) -> dict[str, Any]:
        """Return it for JSON."""
        known = np.array(self.latency_ms)
        p50, p99 = np.percentile(known, (50, 99)) if known.size else (None, None)
        last = self.state
        return {
            "blocks": self.blocks, "overruns": self.overruns, "slipped_s": self.slipped_s,
            "wall_s": self.wall_s, "loop_p50_ms": p50, "loop_p99_ms": p99, "stopped": self.stopped,
            "guard_state": last.guard_state if last else None,
            "shift_deg": last.shift_applied_deg if last else None,
            "commands_accepted": last.commands_accepted if last else 0,
            "commands_rejected": last.commands_rejected if last else 0,
            "commands_late": last.commands_late if last else 0,
        } | ({"latency_ms": list(self.latency_ms)} if every_latency else {})  # fmt: skip


class PacedMachine:
    """The machine on the bus.

    Parameters
    ----------
    node
        Answers a tick with a block, and takes commands and requests.
    bus
        An open bus.
    run
        Identifier of the run, as the node has it.
    clock
        Monotonic.
    stop
        Ends it between two blocks.
    say
        Told in words what happens.
    log
        Given every event of the node, for the audit.
    """

    def __init__(
        self,
        node: Node,
        bus: ZenohBus,
        run: str,
        *,
        clock: Clock,
        stop: StopSignal,
        say: Say,
        log: Callable[[Event], None] | None = None,
    ) -> None:
        self._node, self._bus, self._run, self._log = node, bus, run, log
        self._clock, self._stop, self._say = clock, stop, say
        self._herald = Herald("machine", bus, clock, say)
        self._herald.run = run
        self._published: dict[int, float] = {}
        self._owed: int | None = None
        self._taken = 0
        self.counts = Paced()

    def run(self, blocks: int | None, *, arm_block: int | None, wait_s: float) -> Paced:
        """Wait until monitor and controller are alive, then go on for `blocks` (None: until stopped).

        Parameters
        ----------
        blocks
            How many.
        arm_block
            Before which block the operator's request to arm is given; None: only if it comes over the bus.
        wait_s
            How long to wait for the others (s).
        """
        bus = self._bus
        refuse_second(bus, "machine")
        self._node.prepare()
        bus.offer(SampleBlock, MachineState, Truth, Event, OperatorRequest)
        self._presence = bus.presence()
        self._inbox = bus.subscribe(TurretCommand, OperatorRequest)
        bus.announce("machine")
        try:
            self._barrier(wait_s)
            gc.collect()
            gc.freeze()
            self._go(blocks, arm_block)
        except Stopped:
            self.counts.stopped = True
        return self.counts

    def noticed(self) -> dict[str, int]:
        """Return how often what was noticed on the bus."""
        counts = self._herald.counts
        return {"decode_errors": counts["decode_error"], "thrown_away": counts["flood"]}

    def _barrier(self, wait_s: float) -> None:
        until, said = self._clock.now() + wait_s, ""
        while missing := ", ".join(sorted(NEEDED - self._presence.alive)):
            self._look_around()
            self._take()
            self._taken = 0
            if missing != said:
                said = missing
                self._say(f"machine {self._bus.machine} at {self._bus.endpoint}: waiting for {missing}")
            if self._clock.now() > until:
                raise RefusalError(
                    f"not alive after {wait_s:g} s: {missing}; sample 0 is issued when monitor and controller are",
                    {"service": "machine", "machine": self._bus.machine},
                )
            with self._stop.waiting():
                self._clock.sleep_until(self._clock.now() + 0.005)
        self._say(f"machine {self._bus.machine}: monitor and controller are alive, run {self._run} begins")

    def _go(self, blocks: int | None, arm_block: int | None) -> None:
        counts, clock = self.counts, self._clock
        begin = begun = clock.now()
        try:
            while blocks is None or counts.blocks < blocks:
                number = counts.blocks
                self._listen(begin + number * BLOCK_S)
                late = clock.now() - (begin + number * BLOCK_S)
                if late > BLOCK_S:
                    counts.overruns += 1
                    counts.slipped_s += late
                    begin += late
                    self._herald.note("overrun", f"block {number} is {1e3 * late:.0f} ms late: the schedule moves")
                if number == arm_block:
                    self._arm()
                self._block(number)
                counts.wall_s = clock.now() - begun
            self._linger()
        finally:
            counts.wall_s = clock.now() - begun if blocks is None or counts.blocks < blocks else counts.wall_s

    def _block(self, number: int) -> None:
        self._publish(self._node.handle(Tick(block=number)))
        self.counts.blocks = number + 1
        self._taken = 0
        self._bus.answer()
        self._look_around()

    def _publish(self, messages: Any) -> None:
        for message in messages:
            if isinstance(message, SampleBlock):
                self._herald.sample = message.first_sample
                self._published = {k: t for k, t in self._published.items() if k > message.sequence - 50}
                self._published[message.sequence] = self._clock.now()
                self._owed = message.sequence
            elif isinstance(message, MachineState):
                self.counts.state = message
            elif isinstance(message, Event) and self._log is not None:
                self._log(message)
            self._bus.publish(message)

    def _arm(self) -> None:
        request = OperatorRequest(
            run=self._run, source="operator", sequence=0, request="arm", nonce=uuid.uuid4().hex
        )
        self._say("machine: the guard is armed on request of the command line")
        self._bus.publish(request)
        self._publish(self._node.handle(request))

    def _listen(self, until: float) -> None:
        """Take what comes until it is time; look closely only while a command is due."""
        clock = self._clock
        while True:
            self._take()
            now = clock.now()
            if now >= until:
                self._stop.check()
                return
            step = until
            if self._owed is not None:
                step = now + (FINE_S if now < self._published[self._owed] + WATCH_S else COARSE_S)
            with self._stop.waiting():
                clock.sleep_until(min(step, until))

    def _take(self) -> None:
        for received in self._inbox.take():
            self._taken += 1
            if self._taken > 2 * MOST_TAKEN:
                self._herald.note("flood", f"too much on {received.topic}: thrown away unread")
                continue
            message: Message | None = self._herald.read(received)
            if message is None:
                continue
            if isinstance(message, TurretCommand) and message.run == self._run:
                self._time(message.cause)
            self._publish(self._node.handle(message))

    def _time(self, cause: int) -> None:
        """Note how long the first command that names a block took."""
        if cause == self._owed:
            self._owed = None
        sent = self._published.pop(cause, None)
        if sent is not None:
            self.counts.latency_ms.append(1e3 * (self._clock.now() - sent))

    def _look_around(self) -> None:
        for who, came in self._presence.changes():
            if who != "machine":
                self._herald.peer("machine", who, came)

    def _linger(self) -> None:
        last = self.counts.blocks - 1
        until = self._clock.now() + LINGER_S
        while self._owed == last and self._clock.now() < until and self._presence.alive >= NEEDED:
            self._listen(min(until, self._clock.now() + 0.002))
            self._look_around()
