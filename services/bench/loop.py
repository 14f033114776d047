"""How much faster than real time: the closed loop in one process, and the cut on a map of the surface."""

from __future__ import annotations

from statistics import median

from services.bench.rounds import Row, Say, interleaved, row, silent
from services.clock import CpuClock
from services.closed_loop import Loop, open_loop
from services.config import Case, load_case
from services.messages import BLOCK_S
from services.nodes.machine import make_plant
from services.reproduce.plant import prepared_case

CLOCK = CpuClock()
UNIT = "times real time on one core (peer: real time)"


def measure(*, seconds: float = 6.0, rounds: int = 5, name: str = "thesis-652", say: Say = silent) -> list[Row]:
    """Return the rows of the table.

    Parameters
    ----------
    seconds
        Of the case (s); it begins with two in air.
    rounds
        How often each is timed.
    name
        Of the case.
    say
        Told what is being measured.
    """
    lumped, mapped = load_case(name), prepared_case("surface", name)
    say(f"closed loop of {name}")
    loop = median(_loop(lumped, round(seconds / BLOCK_S)) for _ in range(rounds + 1))
    say("surface map, open loop")
    cut_s = 0.25 * seconds
    taken, _ = interleaved({"map": lambda: _cut(mapped, cut_s)}, rounds, CLOCK)
    return [
        row(f"closed loop of {name}, {seconds:g} s, one process", loop, 1.0, UNIT),
        row(f"surface map of {name}, two directions, open loop, {cut_s:g} s", cut_s / taken["map"], 1.0, UNIT),
    ]


def _loop(case: Case, blocks: int) -> float:
    """Return simulated over computing time of the loop, from a start that is not timed."""
    loop = Loop(case, case.settings.seed, CLOCK)
    for number in range(blocks):
        loop.step(number)
    return blocks * BLOCK_S / loop.tape.wall_s


def _cut(case: Case, seconds: float) -> None:
    plant = make_plant(case, case.settings.seed, air_time=0.0)
    open_loop(case, plant, round(seconds * case.settings.sample_rate_hz))
