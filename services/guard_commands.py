"""Which messages the guard listens to: form, origin, order, time and how often, but nothing about the machine."""

import math
from collections import deque

from services.guard_limits import GuardLimits
from services.messages import FORMAT_VERSION, OperatorRequest, TurretCommand

MOST_NONCES = 10_000
LONGEST_NONCE = 64
MOST_SAMPLES = 2**53
"""Bound of sequences and sample indices: 30 000 years at 9 kHz."""
USED = "nonce used before"


class Doorkeeper:
    """Remembers what was said before, by whom it may be said, and how often the target changed.

    Parameters
    ----------
    limits : GuardLimits
        Those on commands.
    run : str
        Identifier of the run.
    controller, operator : str
        The only sources of commands and of requests.
    """

    def __init__(self, limits: GuardLimits, run: str, controller: str, operator: str) -> None:
        self._run, self._controller, self._operator = run, controller, operator
        self._age, self._lead = limits.samples(limits.command_age), limits.samples(limits.command_lead)
        self._minute, self._dwell = limits.samples(60.0), limits.samples(limits.dwell)
        self._most_moves = limits.moves_per_minute
        self._moves: deque[int] = deque(maxlen=limits.moves_per_minute)
        self._nonces: set[str] = set()
        self.begin_session("")

    def begin_session(self, token: str) -> None:
        """Expect commands of a session, from any sequence on; the moves of the last minute still count."""
        self.session, self._sequence, self._due = token, -1, 0

    def unheard(self, op: OperatorRequest) -> str:
        """Why a request does not count, empty if it does; only a repetition can keep `stop` from being heard."""
        if op.nonce in self._nonces:
            return USED
        why = self._foreign(op, self._operator)
        if not why and not 0 < len(op.nonce) <= LONGEST_NONCE:
            why = f"nonce must have 1 to {LONGEST_NONCE} characters"
        if not why and len(self._nonces) < MOST_NONCES:
            self._nonces.add(op.nonce)
        elif not why and op.request != "disarm":
            why = "too many requests in this run"
        return "" if op.request == "stop" else why

    def untrue(self, cmd: TurretCommand, now: int) -> str:
        """Why a command is not from the one controller, new and in time, empty if it is."""
        issued, due, expires = cmd.issued_sample, cmd.apply_at_sample, cmd.expires_at_sample
        if not all(0 <= number < MOST_SAMPLES for number in (cmd.sequence, issued, due, expires)):
            return "malformed"
        if why := self._foreign(cmd, self._controller):
            return why
        if cmd.session != self.session:
            return "session"
        if cmd.sequence <= self._sequence:
            return "duplicate" if cmd.sequence == self._sequence else "out of order"
        if not issued <= due <= expires:
            return "malformed"
        if issued > now or due > now + self._lead:
            return "early"
        if now > expires or now - issued > self._age:
            return "old"
        if due < self._due:
            return "out of order"
        return "" if -math.inf < cmd.shift_deg < math.inf else "not finite"

    def heard(self, cmd: TurretCommand) -> None:
        """Remember a valid command: the next one must be newer."""
        self._sequence, self._due = cmd.sequence, cmd.apply_at_sample

    def hurried(self, now: int) -> str:
        """Why the target may not change now, empty if it may."""
        while self._moves and now - self._moves[0] >= self._minute:
            self._moves.popleft()
        if len(self._moves) >= self._most_moves:
            return "moves"
        return "dwell" if self._moves and now - self._moves[-1] < self._dwell else ""

    def moved(self, now: int) -> None:
        """Count a change of the target."""
        self._moves.append(now)

    def _foreign(self, message: OperatorRequest | TurretCommand, source: str) -> str:
        """Why a message does not belong here, empty if it does."""
        if message.version != FORMAT_VERSION:
            return "version"
        if message.run != self._run:
            return "run"
        return "" if message.source == source else "source"
