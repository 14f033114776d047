"""Which messages a picture believes: nonsense is counted by its reason, and changes nothing else."""

from __future__ import annotations

import math
from collections import Counter

from services.clock import Clock

SILENCE_S = 1.0
"""A run, or a topic, that said nothing for so long may be followed by anything."""
AHEAD_S, AHEAD_PACE = 1.0, 100.0
"""How far (s) a message may be ahead of the last one, and how much further for each second between them."""
PAST_S = 15.0
LARGEST = 1e9
"""No force, frequency, length or angle on a lathe has more digits."""
REASONS = (
    "unreadable", "another run", "from the past", "from the future", "implausible", "not finite", "too long",
    "wrong topic",
)  # fmt: skip


def plausible(value: float | None) -> float | None:
    """Return a number that can be drawn, None for all others."""
    return value if value is not None and math.isfinite(value) and abs(value) <= LARGEST else None


class Sieve:
    """Decides which run is shown, and whether a message of it comes in its time.

    Attributes
    ----------
    run
        The run that is shown; empty before the first.
    refused
        How many messages were not believed, by reason.
    last
        The last of them in words.
    """

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self.run = ""
        self.vacant = True
        self.refused: Counter[str] = Counter()
        self.last = ""
        self.heard: dict[str, float] = {}
        self._heads: dict[str, int] = {}

    def refuse(self, reason: str, text: str) -> None:
        """Count a message, or a part of one, that is not believed."""
        self.refused[reason] += 1
        self.last = f"{reason}: {text}"[:300]

    def age(self, topic: str) -> float | None:
        """Return how long ago a topic was last believed (s), None if it never was."""
        heard = self.heard.get(topic)
        return None if heard is None else self._clock.now() - heard

    def opens(self, topic: str, run: str) -> bool | None:
        """Return whether a message begins a new run; None if it is of another one than what goes on."""
        if not run:
            self.refuse("implausible", f"{topic} of no run")
            return None
        if run == self.run:
            return False
        now = self._clock.now()
        goes_on = any(now - heard < SILENCE_S for heard in self.heard.values())
        if self.run and goes_on and not self.vacant:
            self.refuse("another run", f"{topic} of run {run:.40}, while {self.run:.40} goes on")
            return None
        self.run, self.vacant = run, False
        self.heard.clear()
        self._heads.clear()
        return True

    def passes(self, topic: str, sample: int, rate_hz: float, *, again: bool) -> bool:
        """Return whether a message comes in its time, and remember it if so.

        Parameters
        ----------
        topic
            Where it came.
        sample
            What time it speaks of.
        rate_hz
            Samples per second.
        again
            Whether a late one is of use.
        """
        now = self._clock.now()
        head, heard = self._heads.get(topic), self.heard.get(topic)
        if not 0 <= sample < 1 << 53:
            self.refuse("implausible", f"{topic} names sample {sample}")
            return False
        if head is not None and heard is not None and now - heard < SILENCE_S:
            ahead_s = (sample - head) / rate_hz
            if ahead_s > AHEAD_S + AHEAD_PACE * (now - heard):
                self.refuse("from the future", f"{topic} is {ahead_s:.0f} s ahead")
                return False
            if ahead_s < -PAST_S or (ahead_s <= 0 and not again):
                self.refuse("from the past", f"{topic} is {-ahead_s:.2f} s old or was there before")
                return False
            sample = max(sample, head)
        self._heads[topic], self.heard[topic] = sample, now
        return True
