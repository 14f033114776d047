"""When to move turret 1, how far, and when to give up: one decision per block.

With a belief about the process the planner foresees how the frequency moves with the shift and aims at once where most
of the processes that explain the chatter are silent; each move that fails tells them apart. Without one, or when none
explains what is heard, a shift is an answer to one frequency: chatter that outlives a move is answered with the shift
for its new frequency or, if that is the same, with the next phase. Each try needs a dwell, and their number is bounded,
so the planner can not hunt. It never goes back by itself: without the shift the chatter would return. What worked is
tried first when the same chatter comes again.
"""

import math
from dataclasses import dataclass, replace
from typing import Any, Literal, NamedTuple

from pitch._checks import finite
from pitch.belief import ProcessBelief
from pitch.choice import Candidate, PlannerConfig, candidates, fitting, reachable
from pitch.foresight import HOPE, LINE_HZ, Foresight
from pitch.geometry import slide_set_points
from pitch.situation import FORCED, REGENERATIVE, Cause, Decision, Situation

SEEN_S = 20.0
"""How long a sighting of chatter tells something (s): the bar changes as it is cut."""
LOUD = 6.0
"""From so many times the limit on tools lose contact and no belief in small vibrations holds: the line is followed."""
SIGHTINGS, LESSONS = 4, 8
_AT_AN_END = (Cause.NO_PITCH, Cause.EXHAUSTED, Cause.NOT_FOLLOWED)
SAME_LINE, SAME_SPEED = 0.01, 0.005
"""Relative differences of frequency and speed within which chatter counts as the same."""


class Lesson(NamedTuple):
    """A move that ended chatter: at which speed (Hz), against which line (Hz), from where and to where (rad)."""

    spindle_hz: float
    line_hz: float
    start: float
    shift: float


@dataclass(slots=True, kw_only=True)
class PlannerState:
    """Whole state of a `Planner`; times are sample indices, None is "never"."""

    target: float
    adopted: bool = False
    order: int = 0
    phase: float | None = None
    sample: int | None = None
    moved_at: int | None = None
    unsettled_at: int | None = None
    chatter_from: int | None = None
    calm_from: int | None = None
    moves: int = 0
    tried: tuple[float, ...] = ()
    given_up: tuple[Cause, str] | None = None
    refused_hz: float = 0.0
    advised_hz: float | None = None
    seen: tuple[tuple[int, float, float], ...] = ()
    pending: Lesson | None = None
    lessons: tuple[Lesson, ...] = ()


class Planner:
    """Decides once per block where turret 1 should stand.

    Parameters
    ----------
    config : PlannerConfig
        Aims and limits.
    initial_shift : float
        Target (rad) until the first block tells where turret 1 really stands.
    belief : ProcessBelief or None
        What is believed of bar and cut, None if nothing is.
    """

    def __init__(self, config: PlannerConfig, initial_shift: float = 0.0, belief: ProcessBelief | None = None) -> None:
        self._config = config
        self._foresight = None if belief is None else Foresight(belief, config)
        self._state = PlannerState(target=self._clipped(finite("initial_shift", initial_shift)), order=config.order)

    def decide(self, seen: Situation) -> Decision:
        """Decide on one block.

        Parameters
        ----------
        seen : Situation
            The block.

        Returns
        -------
        Decision
            An absolute target, often "hold".
        """
        if self._state.sample is not None and seen.sample <= self._state.sample:
            return self._answer(seen, "hold", Cause.LATE, f"block {seen.sample} is late or repeated")
        self._remember(seen)
        obstacle = _unusable(seen) or self._nothing_to_do(seen) or self._not_yet(seen)
        if obstacle is not None:
            return self._answer(seen, "hold", *obstacle)
        return self._act(seen)

    def prepare(self) -> None:
        """Compile what foresight needs."""
        if self._foresight is not None:
            self._foresight.prepare()

    def reset(self) -> None:
        """Forget tries and giving up, as after a new set-up; the target stays, and so does what has worked."""
        state = self._state
        state.moves, state.tried, state.given_up, state.seen, state.advised_hz = 0, (), None, (), None
        state.pending = None

    def snapshot(self) -> PlannerState:
        """Copy of the whole state."""
        return replace(self._state)

    def restore(self, state: PlannerState) -> None:
        """Go back to a state taken from a planner with the same configuration."""
        self._state = replace(state)

    def _remember(self, seen: Situation) -> None:
        state, previous = self._state, self._state.sample
        state.sample = seen.sample
        if previous is not None and seen.sample - previous > self._samples(self._config.persist_time):
            state.chatter_from = state.calm_from = None
        if _usable(seen.shift) and not (state.adopted and seen.armed):
            known = seen.requested if seen.armed and _usable(seen.requested) else seen.shift
            state.target, state.adopted = self._clipped(_number(known)), True
        if seen.moving:
            state.unsettled_at = seen.sample
        if not seen.valid:
            state.chatter_from = state.calm_from = None
        elif seen.chatter and seen.in_cut and seen.kind != FORCED:
            state.chatter_from, state.calm_from = _first(state.chatter_from, seen.sample), None
        else:
            state.chatter_from, state.calm_from = None, _first(state.calm_from, seen.sample)
            if self._since(state.calm_from) >= self._samples(self._config.calm_time):
                if state.pending is not None and seen.in_cut:
                    state.lessons = (*state.lessons, state.pending)[-LESSONS:]
                self.reset()

    def _nothing_to_do(self, seen: Situation) -> tuple[Cause, str] | None:
        if not seen.chatter:
            return Cause.QUIET, "no chatter"
        if seen.kind == FORCED:
            return Cause.FORCED, "forced vibration: it keeps step with the spindle, another pitch does not change it"
        if seen.kind != REGENERATIVE:
            return Cause.KIND_UNKNOWN, "vibration of unknown kind"
        if seen.frequency_hz is None:
            return Cause.NO_FREQUENCY, "chatter, but no frequency yet"
        if not seen.armed:
            return Cause.NOT_ARMED, f"chatter at {seen.frequency_hz:.0f} Hz, but turret 1 is not armed"
        if self._state.given_up is not None and self._state.given_up[0] in (Cause.EXHAUSTED, Cause.NOT_FOLLOWED):
            return self._state.given_up
        return None

    def _not_yet(self, seen: Situation) -> tuple[Cause, str] | None:
        state, config = self._state, self._config
        if seen.moving:
            return Cause.MOVING, "turret 1 is moving"
        if self._since(state.moved_at) < self._samples(config.dwell):
            return Cause.WAITING, "waiting for the last move to take effect"
        if self._since(state.unsettled_at) < self._samples(config.settle_time):
            return Cause.WAITING, "turret 1 has just stopped"
        if self._astray(seen) and self._since(state.moved_at) < self._samples(config.arrive_time):
            return Cause.WAITING, "turret 1 has not arrived"
        if state.moves and self._since(state.chatter_from) < self._samples(config.persist_time):
            return Cause.WAITING, "chatter again, not for long enough to act"
        return None

    def _act(self, seen: Situation) -> Decision:
        state, config = self._state, self._config
        shift, frequency = _number(seen.shift), _number(seen.frequency_hz)
        if self._astray(seen):
            where = f"sent to {_deg(state.target)} deg, it stands at {_deg(shift)} deg"
            return self._give_up(seen, Cause.NOT_FOLLOWED, f"turret 1 does not follow: {where}")
        if state.moves >= config.max_moves:
            still = f"chatter still at {frequency:.0f} Hz"
            return self._give_up(seen, Cause.EXHAUSTED, f"cannot stabilise after {state.moves} moves: {still}")
        worth = config.reaim_threshold * _number(seen.spindle_hz) / (2 * frequency)
        failed = (*state.tried, shift)
        return self._recall(seen, failed) or self._foresee(seen, failed, worth) or self._rule(seen, failed, worth)

    def _recall(self, seen: Situation, failed: tuple[float, ...]) -> Decision | None:
        """Go where the same chatter ended before; what has failed since is forgotten."""
        state, speed, line, here = self._state, *(_number(x) for x in (seen.spindle_hz, seen.frequency_hz, seen.shift))
        near = self._config.arrival_tolerance
        state.lessons = tuple(one for one in state.lessons if abs(one.shift - here) > near)
        for one in reversed(state.lessons):
            same = abs(one.spindle_hz / speed - 1.0) < SAME_SPEED and abs(one.line_hz / line - 1.0) < SAME_LINE
            fits = abs(one.start - here) < near and reachable(self._config, one.shift, _number(seen.diameter))
            if state.moves == 0 and same and fits:
                phase = 2.0 * one.shift * line / speed
                return self._move(seen, Candidate(one.shift, int(abs(phase) // (2.0 * math.pi)), phase), failed)
        return None

    def _foresee(self, seen: Situation, failed: tuple[float, ...], worth: float) -> Decision | None:
        """Go where most processes that explain the chatter are silent; None if there is none that does."""
        state, foresight = self._state, self._foresight
        if foresight is None or (_usable(seen.loudness) and _number(seen.loudness) > LOUD):
            return None
        speed, line, diameter = (_number(x) for x in (seen.spindle_hz, seen.frequency_hz, seen.diameter))
        refused = state.given_up
        if refused is not None and refused[0] == Cause.NO_PITCH and abs(line - state.refused_hz) < LINE_HZ:
            return self._give_up(seen, *refused)
        recent = [one for one in state.seen if seen.sample - one[0] <= self._samples(SEEN_S)][1 - SIGHTINGS :]
        state.seen = (*recent, (seen.sample, _number(seen.shift), line))
        weight = foresight.weights([one[1:] for one in state.seen], speed)
        if weight is None:
            return None
        best = foresight.best(weight, line, speed, diameter, failed, worth)
        if best is not None and best.silenced >= HOPE:
            return self._move(seen, best.candidate, failed)
        state.refused_hz, state.advised_hz = line, foresight.speed(weight, line, speed, diameter)
        advice = "" if state.advised_hz is None else f": try {60 * state.advised_hz:.0f} 1/min"
        text = f"no stable pitch for {line:.0f} Hz at {60 * speed:.0f} 1/min within {self._room(diameter)}{advice}"
        return self._give_up(seen, Cause.NO_PITCH, text)

    def _room(self, diameter: float) -> str:
        if reachable(self._config, self._config.max_shift, diameter):
            return f"{_deg(self._config.max_shift)} deg"
        return f"{_travel_mm(self._config):.2f} mm of travel"

    def _rule(self, seen: Situation, failed: tuple[float, ...], worth: float) -> Decision:
        """Answer the measured frequency alone."""
        wanted = candidates(self._config, _number(seen.frequency_hz), _number(seen.spindle_hz))
        within_reach = fitting(self._config, wanted, _number(seen.diameter))
        if not within_reach:
            return self._give_up(seen, Cause.NO_PITCH, _too_far(self._config, wanted[0], seen))
        fresh = [one for one in within_reach if all(abs(one.shift - old) >= worth for old in failed)]
        if not fresh:
            text = f"cannot stabilise: chatter at {seen.frequency_hz:.0f} Hz in spite of every pitch within the limits"
            return self._give_up(seen, Cause.NO_PITCH, text)
        return self._move(seen, fresh[0], failed)

    def _move(self, seen: Situation, chosen: Candidate, failed: tuple[float, ...]) -> Decision:
        state = self._state
        state.target, state.order, state.phase = chosen.shift, chosen.order, chosen.phase
        state.moved_at, state.moves, state.tried, state.given_up = seen.sample, state.moves + 1, failed, None
        first = failed[0]
        line = _number(seen.frequency_hz) if state.pending is None else state.pending.line_hz
        state.pending = Lesson(_number(seen.spindle_hz), line, first, chosen.shift)
        text = f"chatter at {seen.frequency_hz:.0f} Hz: turret 1 to {_deg(chosen.shift)} deg"
        return self._answer(seen, "move", Cause.CHATTER, f"{text}, phase {chosen.phase / math.pi:.2f} pi")

    def _give_up(self, seen: Situation, cause: Cause, reason: str) -> Decision:
        action = "hold" if self._state.given_up is not None and self._state.given_up[0] == cause else "give_up"
        self._state.given_up = (cause, reason)
        return self._answer(seen, action, cause, reason)

    def _answer(
        self, seen: Situation, action: Literal["hold", "move", "give_up"], cause: Cause, reason: str
    ) -> Decision:
        state = self._state
        return Decision(
            target_shift=state.target,
            order=state.order,
            action=action,
            cause=cause,
            reason=reason,
            phase=state.phase,
            moves=state.moves,
            given_up=state.given_up is not None,
            frequency_hz=seen.frequency_hz if _usable(seen.frequency_hz) else None,
            spindle_hz=seen.spindle_hz if _usable(seen.spindle_hz) else None,
            advised_spindle_hz=state.advised_hz,
            feed_hold=state.given_up is not None and seen.chatter and cause in _AT_AN_END,
        )

    def _astray(self, seen: Situation) -> bool:
        away = abs(_number(seen.shift) - self._state.target)
        return self._state.moved_at is not None and away > self._config.arrival_tolerance

    def _clipped(self, shift: float) -> float:
        if abs(shift) < self._config.arrival_tolerance:
            return 0.0
        return min(max(shift, self._config.min_shift), self._config.max_shift)

    def _samples(self, seconds: float) -> int:
        return math.ceil(seconds * self._config.sample_rate_hz - 1e-6)

    def _since(self, sample: int | None) -> float:
        return math.inf if sample is None or self._state.sample is None else self._state.sample - sample


def _unusable(seen: Situation) -> tuple[Cause, str] | None:
    if not seen.valid:
        return Cause.BAD_DATA, "the block can not be trusted"
    if seen.spindle_hz is None:
        return Cause.NO_SPINDLE_SPEED, "no spindle speed"
    for name, value, lowest in (
        ("spindle_hz", seen.spindle_hz, 0.0),
        ("diameter", seen.diameter, 0.0),
        ("shift", seen.shift, -math.inf),
        ("frequency_hz", 1.0 if seen.frequency_hz is None else seen.frequency_hz, 0.0),
    ):
        if not _usable(value) or _number(value) <= lowest:
            return Cause.BAD_DATA, f"{name} is not usable: {value}"
    return None if seen.in_cut else (Cause.OUT_OF_CUT, "the tools are not in the cut")


def _too_far(config: PlannerConfig, wanted: Candidate, seen: Situation) -> str:
    needs = f"{seen.frequency_hz:.0f} Hz at {60 * _number(seen.spindle_hz):.0f} 1/min needs {_deg(wanted.shift)} deg"
    if not config.min_shift <= wanted.shift <= config.max_shift:
        return f"no stable pitch within {_deg(config.max_shift)} deg: {needs}"
    x1, y1 = slide_set_points(wanted.shift, _number(seen.diameter), config.axis_angle)
    room = f"no stable pitch within {_travel_mm(config):.2f} mm of travel"
    return f"{room}: {needs}, X1 {1e3 * x1:.2f} mm, Y1 {1e3 * y1:.2f} mm"


def _travel_mm(config: PlannerConfig) -> float:
    return 1e3 * max(abs(end) for end in (*config.x1_travel, *config.y1_travel))


def _usable(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _number(value: Any) -> float:
    return float(value)


def _first(sample: int | None, now: int) -> int:
    return now if sample is None else sample


def _deg(angle: float) -> str:
    return f"{math.degrees(angle):.2f}"
