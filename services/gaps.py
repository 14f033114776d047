"""Which messages are missing, told by their numbers."""

from __future__ import annotations

from services.messages import ChatterReport, Event, ForceBlock, MachineState, Message, SampleBlock, Truth
from services.wire import topic_of

NUMBERED = (SampleBlock, MachineState, Truth, ForceBlock, ChatterReport, Event)
"""Types that each sender numbers without a hole; commands are only sent while somebody listens."""
MOST_AWAITED = 100_000
"""Numbers of one sender that are remembered as missing, should they come late; beyond that they are counted."""


class Gaps:
    """Counts the numbers that are missing in what each sender says, and takes late ones back.

    What a sender said before the first message seen is not missing, nor is what it says after it began anew.
    """

    def __init__(self) -> None:
        self._last: dict[tuple[str, str, str], int] = {}
        self._awaited: dict[tuple[str, str, str], set[int]] = {}
        self._counted: dict[str, int] = {}

    def see(self, message: Message) -> int:
        """Note a message, and return how many are missing right before it."""
        if not isinstance(message, NUMBERED):
            return 0
        number = message.sequence
        key = topic_of(type(message)), message.source, message.run
        last = self._last.get(key)
        awaited = self._awaited.setdefault(key, set())
        if last is not None and number <= last:
            if number not in awaited:  # it began anew, or says it twice
                self._last[key] = number
            awaited.discard(number)
            return 0
        self._last[key] = number
        skipped = 0 if last is None else number - last - 1
        room = min(skipped, MOST_AWAITED - len(awaited))
        awaited.update(range(number - room, number))
        if skipped > room:
            self._counted[key[0]] = self._counted.get(key[0], 0) + skipped - room
        return skipped

    def missing(self) -> dict[str, int]:
        """Return how many messages are missing, for each topic that lacks some."""
        found = dict(self._counted)
        for (topic, _, _), numbers in self._awaited.items():
            if numbers:
                found[topic] = found.get(topic, 0) + len(numbers)
        return found
