"""What goes wrong, when and for how long: drawn from a seed, so that any bad day can be had again."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from services.messages import BLOCK_S

SERVO, REPORT, COMMAND = "servo", "report", "command"
LINKS = (SERVO, REPORT, COMMAND)
SHARES = (0.01, 0.1, 0.5)

ON_LINKS = ("lost", "duplicated", "reordered", "delayed")
ON_MONITOR = (
    "estimator stopped", "estimator slow", "estimator frozen", "estimator NaN", "force sign flipped", "units x1000",
    "stuck encoder", "quantisation x10", "frequency hop",
)  # fmt: skip
ON_CONTROLLER = ("controller lost", "two commanders", "forged commands", "replayed commands", "clock jump",
                 "wrong order")  # fmt: skip
ON_BUS = ("router restart", "CPU starvation")
ON_MACHINE = (
    "spindle override", "tool leaves the cut", "feed hold", "tool change", "not homed", "stuck scale", "bad path",
)  # fmt: skip
BY_OPERATOR = ("operator stop", "power cycle", "arm again")
FAULTS = (*ON_LINKS, *ON_MONITOR, *ON_CONTROLLER, *ON_BUS, *ON_MACHINE, *BY_OPERATOR, "full disk")
"""Every kind of fault."""
END_S = 3.6
"""Length of a day: the last fault begins early enough for T3 (2 s) to run out."""
_FIRST_S, _LAST_S, _LONGEST_S = 0.2, 1.3, 2.5


@dataclass(frozen=True, slots=True, kw_only=True)
class Fault:
    """One thing that goes wrong.

    Attributes
    ----------
    kind
        One of `FAULTS`.
    first, last
        Blocks in which it lasts, the last one excluded.
    share
        Of the messages that it hits, for faults of a link.
    link
        Which link, for those.
    delay
        By how many blocks what is late is late.
    """

    kind: str
    first: int
    last: int
    share: float = 1.0
    link: str = COMMAND
    delay: int = 0

    def acts(self, block: int) -> bool:
        """Whether it lasts in a block."""
        return self.first <= block < self.last

    def describe(self) -> str:
        """Return it in words."""
        where = f" on the {self.link} link, {100 * self.share:g} %" if self.kind in ON_LINKS else ""
        late = f", {10 * self.delay} ms" if self.delay else ""
        return f"{self.kind}{where}{late} from {self.first * BLOCK_S:.2f} to {self.last * BLOCK_S:.2f} s"


@dataclass(frozen=True, slots=True, kw_only=True)
class Schedule:
    """One bad day.

    Attributes
    ----------
    seed
        What it was drawn from.
    faults
        The first is the one that it is counted under.
    returns
        Whether the job wants the shift returned when the controller is lost, instead of held.
    arm_block
        When the operator arms.
    """

    seed: int
    faults: tuple[Fault, ...]
    returns: bool
    arm_block: int


def draw(seed: int) -> Schedule:
    """Draw one day: one to three faults that may overlap. Days of consecutive seeds go through all kinds of fault.

    Parameters
    ----------
    seed
        Of the day.
    """
    rng = np.random.default_rng([seed, 7])
    first = FAULTS[seed % len(FAULTS)]
    others = rng.choice(FAULTS, size=int(rng.integers(0, 3)))
    faults = tuple(_fault(str(kind), rng) for kind in (first, *others))
    return Schedule(seed=seed, faults=faults, returns=bool(rng.random() < 0.5), arm_block=int(rng.integers(0, 20)))


def _fault(kind: str, rng: np.random.Generator) -> Fault:
    first = round(float(rng.uniform(_FIRST_S, _LAST_S)) / BLOCK_S)
    lasts = float(np.exp(rng.uniform(np.log(2 * BLOCK_S), np.log(_LONGEST_S))))
    return Fault(
        kind=kind, first=first, last=first + max(1, round(lasts / BLOCK_S)), share=float(rng.choice(SHARES)),
        link=str(rng.choice(LINKS)),
        delay=int(rng.integers(1, 40)) if kind in ("delayed", "estimator slow", "CPU starvation") else 0,
    )  # fmt: skip
