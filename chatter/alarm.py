"""When an alarm is raised and when it ends, in a narrow band."""

from collections import deque
from copy import deepcopy
from dataclasses import dataclass, field
from math import ceil, exp
from typing import Any

from chatter.estimate import MonitorConfig
from chatter.line_set import COHERENT

SLOWEST, FASTEST = 5.0, 90.0
"""Growth rates of an onset (1/s): a stable cut falls back at 5 1/s or faster, a blow rises within less than 10 ms."""
BEGUN = 0.5
"""Amplitude over its limit from which the growth of a line counts: twice as much has to grow yet."""
CLEAR = 0.6
"""Share of the signal that lines must explain while they are seen to grow."""
ENTRY = 4
"""Blocks after the entry in which growth is that of the blow."""
USUAL, FEW = 100, 20
"""Blocks whose median amplitude is the usual one, and how many it takes to know it."""
LEAK = 1
RISE = 2.0
"""Amplitude over the usual one that an onset reaches."""
GONE = 0.25
"""Power of a block over that of the block before below which what was felt was a blow, and is over."""
SAME = 2
"""Blocks in a row in which the main line must be found at the same frequency: what rings after a blow wanders."""
LEAP = 4.0
"""Power of a block over that of the block before that growth does not explain (70 1/s): a blow, or lines that beat
where growth was seen before."""
STRIKE, BEFORE = 25.0, 4
"""The same over the largest of so many blocks before the last two, which no lines that grow and beat reach (80 1/s over
20 ms): a blow, however plain its ring."""
EDGE, AGAIN = 10, 2.0
"""Blocks for which the stretch in which growth is measured holds the edge of a blow; and power over that of the blow
which vibration reaches that grows all the same."""
STEEP = 1.5
"""Power over that of two blocks before, beyond what the growth of the lines explains: a blow on top of them."""
PLAIN, PLAUSIBLE = 0.95, 70.0
"""Share of the signal that lines which grow and beat explain, and the ring of a blow does not, and growth (1/s) up to
which that is so."""
LONG = 5
"""Blocks of growth after which it is one, though its lines may be too near to each other to be found again: those of a
slow spindle lie 10 Hz apart."""
STANDING = 0.2
"""Time for which a vibration must stand over both limits to count without having been seen to grow (s)."""
LASTING = 0.5
"""Mean square over the largest in this time: what falls at 5 1/s or faster keeps less than a seventh."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Evidence:
    """What one block says.

    Parameters
    ----------
    fresh : float
        Squared amplitude in the last 20 ms over the limits of both indicators, whichever is nearer to it.
    square : float
        Mean square of the band over the window.
    both : bool
        Both indicators of the window are over their limits.
    regenerative : bool
        The main line is regenerative.
    explained : float
        Share of the signal that lines explain, 0...1.
    growth : float
        Growth rate of the regenerative lines (1/s).
    seen : int
        Blocks in a row in which the main line was found at the same frequency.
    level : float
        Squared amplitude of the band in the last 20 ms.
    newest : float
        Squared amplitude of the band in the block itself.
    age : int
        Blocks since start, entry or exit.
    least : float
        What `fresh` must reach to count as over the limits.
    """

    fresh: float = 0.0
    square: float = 0.0
    both: bool = False
    regenerative: bool = False
    explained: float = 0.0
    growth: float = 0.0
    seen: int = 0
    level: float = 0.0
    newest: float = 0.0
    age: int = 0
    least: float = 1.0


@dataclass(slots=True, kw_only=True)
class _Edge:
    """A sudden rise, and the power to which it led."""

    since: int = EDGE
    power: float = 0.0

    def look(self, rises: bool, level: float) -> None:
        """Take a block in; what rises may lie across two blocks."""
        if rises or self.since < 2:
            self.power = max(level, self.power if self.since < 2 else 0.0)
        self.since = 0 if rises else self.since + 1

    def is_over(self, level: float) -> bool:
        """Return whether growth is no longer that of the rise itself."""
        return self.since >= EDGE or (self.since > 2 and level >= AGAIN * self.power)


@dataclass(slots=True, kw_only=True)
class _Memory:
    on: bool = False
    grown: int = 0
    over: bool = False
    stood: int = 0
    lowered: int = 0
    resumes: bool = False
    squares: deque[float] = field(default_factory=deque[float])
    levels: deque[float] = field(default_factory=deque[float])
    recent: deque[float] = field(default_factory=lambda: deque[float](maxlen=BEFORE + 2))
    leap: _Edge = field(default_factory=_Edge)
    strike: _Edge = field(default_factory=_Edge)


class Alarm:
    """Raised by lines that are seen to grow over their limit, or by a vibration that stands over both limits.

    Parameters
    ----------
    config : MonitorConfig
        Parameters.
    """

    def __init__(self, config: MonitorConfig) -> None:
        self._confirm, self._block = config.confirm, config.block
        self._window_blocks = ceil(config.window / config.block - 1e-9)
        self._standing = max(ceil(STANDING / config.block - 1e-9), self._window_blocks)
        self._memory = _Memory()

    @property
    def on(self) -> bool:
        """Whether it chatters."""
        return self._memory.on

    @property
    def begins(self) -> bool:
        """Whether lines are seen to grow towards their limit."""
        return self._memory.grown > 0

    @property
    def warns(self) -> bool:
        """Whether lines that grow have reached their limit."""
        return self._memory.over

    def restart(self) -> None:
        """Forget everything but that there was an alarm: chatter seen again after a gap needs less time."""
        self._memory = _Memory(resumes=self._memory.on or self._memory.resumes)

    def end(self) -> None:
        """Forget everything, out of the cut."""
        self._memory = _Memory()

    def snapshot(self) -> Any:
        """Return a copy of the whole state."""
        return deepcopy(self._memory)

    def restore(self, state: Any) -> None:
        """Continue from a copy of the state.

        Parameters
        ----------
        state : object
            What `snapshot` returned.
        """
        self._memory = deepcopy(state)

    def step(self, seen: Evidence) -> bool:
        """Take the evidence of a block and return whether the alarm has just been raised.

        Parameters
        ----------
        seen : Evidence
            What the block says.
        """
        memory = self._memory
        self._keep(seen)
        growing = SLOWEST <= seen.growth <= FASTEST and seen.explained >= CLEAR and seen.fresh >= BEGUN**2
        growing &= seen.age > ENTRY
        memory.grown = memory.grown + 1 if growing else max(memory.grown - LEAK, 0)
        memory.over = growing and seen.fresh >= 1.0
        coherent = seen.regenerative and seen.explained >= COHERENT
        memory.stood = memory.stood + 1 if seen.both and coherent else 0
        memory.lowered = 0 if seen.both or growing else memory.lowered + 1
        if memory.on:
            memory.on = memory.lowered < self._window_blocks
            return False
        over = seen.regenerative and seen.fresh >= seen.least and memory.strike.is_over(seen.level)
        told = growing and memory.grown >= self._confirm and seen.seen >= SAME and coherent
        onset = over and (memory.grown >= LONG or (told and self._explained(seen)))
        memory.on = (onset and self._rises(seen)) or self._stands()
        memory.resumes = memory.resumes and not memory.on
        return memory.on

    def _keep(self, seen: Evidence) -> None:
        """Remember what was usual in the last second of this cut, after the blow of the entry."""
        memory = self._memory
        recent = memory.recent
        if seen.age <= 1:
            recent.clear()
        leaps = seen.newest > LEAP * recent[-1] and not memory.grown if recent else True
        memory.leap.look(leaps, seen.level)
        recent.append(seen.newest)
        before, now = list(recent)[:-2], list(recent)[-2:]
        memory.strike.look(len(before) == BEFORE and max(now) > STRIKE * max(before), seen.level)
        memory.squares.append(seen.square)
        if len(memory.squares) > self._standing + 1:
            memory.squares.popleft()
        if seen.age <= self._window_blocks:
            memory.levels.clear()
        memory.levels.append(seen.level)
        if len(memory.levels) > USUAL:
            memory.levels.popleft()

    def _explained(self, seen: Evidence) -> bool:
        """Return whether the growth of the lines explains what is felt; the edge of a blow is no growth."""
        recent = self._memory.recent
        if len(recent) > 2 and seen.newest > STEEP * recent[-3] * exp(4.0 * self._block * seen.growth):
            return False
        plain = seen.explained >= PLAIN and seen.growth <= PLAUSIBLE
        return plain or self._memory.leap.is_over(seen.level)

    def _rises(self, seen: Evidence) -> bool:
        """Return whether the vibration has not just gone, and is well over what was usual, as far as that is known."""
        levels, recent = sorted(self._memory.levels), self._memory.recent
        if len(recent) > 1 and seen.newest < GONE * recent[-2]:
            return False
        return len(levels) < FEW or seen.level >= RISE**2 * levels[len(levels) // 2]

    def _stands(self) -> bool:
        memory = self._memory
        blocks = self._window_blocks if memory.resumes else self._standing
        squares = list(memory.squares)[-1 - blocks :]
        return memory.stood >= blocks and len(squares) > blocks and squares[-1] >= LASTING * max(squares)
