"""How many machines a core carries: monitors in one process for all machines, and in one process each.

The same recorded cut is published for every machine at its own pace, 100 blocks a second each; what the monitors took
of a core is read from their processes, and how late a report is from when its block went out.
"""

from __future__ import annotations

import pathlib
from contextlib import ExitStack
from typing import Any

import msgspec
import numpy as np

from services.bench.rounds import Row, Say, row, silent
from services.children import Child, end_all, private_folder
from services.clock import WallClock
from services.closed_loop import Loop
from services.config import load_case
from services.errors import RefusalError
from services.messages import BLOCK_S, ChatterReport, SampleBlock
from services.process import command_line
from services.zenoh_bus import Inbox, ZenohBus, open_client

CASE = "thesis-652"
CLOCK = WallClock()
START_S, FIRST = 60.0, 220
"""How long the monitors may take to start (s); blocks of the cut before those that are played: air."""
_TICKS = 100.0
"""Of a clock of /proc each second."""


def measure(*, machines: tuple[int, ...] = (1, 4, 8), seconds: float = 4.0, say: Say = silent) -> list[Row]:
    """Return the rows of the table.

    Parameters
    ----------
    machines
        How many there are.
    seconds
        For how long each number of them is measured (s).
    say
        Told what is being measured.
    """
    blocks = _blocks(round(seconds / BLOCK_S))
    rows: list[Row] = []
    for count in machines:
        say(f"{count} machines")
        together, age = _share([count], blocks)
        apart, late = _share([1] * count, blocks)
        what = f"{count} machine{'s' if count > 1 else ''}, 100 blocks/s each"
        rows += [
            row(f"{what}: monitors in one process (peer: in one each)", together, apart, "% of a core"),
            row(f"{what}: machines that a core carries", 100.0 * count / together, 100.0 * count / apart, "machines"),
            row(f"{what}: from block to report, p99", age, late, "ms"),
        ]
    return rows


def _blocks(count: int) -> list[SampleBlock]:
    """Return the servo blocks of a cut, from sample 0 on."""
    loop = Loop(load_case(CASE), 1, CLOCK)
    for number in range(FIRST + count):
        loop.step(number)
    return [
        msgspec.structs.replace(block, sequence=number, first_sample=number * block.x1_thrust_n.size)
        for number, block in enumerate(loop.tape.of(SampleBlock)[FIRST:])
    ]


def _share(groups: list[int], blocks: list[SampleBlock]) -> tuple[float, float]:
    """Play blocks to monitors; return what they take of a core (%), and p99 from block to report (ms).

    Parameters
    ----------
    groups
        Machines of each monitor process.
    blocks
        Of every machine.
    """
    names = [f"bench-{number}" for number in range(sum(groups))]
    with ExitStack() as stack:
        folder = stack.enter_context(private_folder())
        router = stack.enter_context(ZenohBus.router("bench", "tcp/127.0.0.1:0"))
        children: list[Child] = []
        stack.callback(lambda: end_all(children))
        rest = iter(names)
        for size in groups:
            own = [word for _, name in zip(range(size), rest, strict=False) for word in ("--machine", name)]
            line = command_line("monitor", CASE, *own, "--connect", router.endpoint, "--json")
            children.append(Child("monitor", line, folder, quiet=True))
        buses = [stack.enter_context(ZenohBus(open_client(router.endpoint), name, router.endpoint)) for name in names]
        _wait_for(buses, children)
        inboxes = [bus.subscribe(ChatterReport) for bus in buses]
        before = sum(_computed_s(child.pid) for child in children)
        begin = CLOCK.now()
        ages = _play(buses, inboxes, blocks)
        wall = CLOCK.now() - begin
        took = sum(_computed_s(child.pid) for child in children) - before
    return 100.0 * took / wall, float(np.percentile(ages, 99)) if ages else float("nan")


def _wait_for(buses: list[ZenohBus], children: list[Child]) -> None:
    until = CLOCK.now() + START_S
    while not all("monitor" in bus.alive() for bus in buses):
        ended = next((child for child in children if child.ended() is not None), None)
        if ended is not None or CLOCK.now() > until:
            raise RefusalError(f"a monitor does not start: {(ended or children[0]).why()}")
        CLOCK.sleep_until(CLOCK.now() + 0.05)


def _play(buses: list[ZenohBus], inboxes: list[Inbox], blocks: list[SampleBlock]) -> list[float]:
    """Publish every block for every machine on time, and return how long after it its report came (ms)."""
    begin, sent, ages = CLOCK.now(), dict[tuple[int, int], float](), list[float]()

    def hear() -> None:
        for which, inbox in enumerate(inboxes):
            for received in inbox.take():
                report: Any = received.message()
                ages.append(1e3 * (CLOCK.now() - sent[which, report.sequence]))

    for number, block in enumerate(blocks):
        for which, bus in enumerate(buses):
            sent[which, number] = CLOCK.now()
            bus.publish(msgspec.structs.replace(block, run=f"run-{which}"))
        while CLOCK.now() < begin + (number + 1) * BLOCK_S:
            hear()
            CLOCK.sleep_until(CLOCK.now() + 0.0005)
    hear()
    return ages[len(ages) // 10 :]


def _computed_s(pid: int) -> float:
    """Return for how long a process has been computing (s)."""
    fields = pathlib.Path(f"/proc/{pid}/stat").read_text(encoding="utf-8").rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / _TICKS
