"""One process under one planner: the plant itself, the real planner, and chatter as a detector would report it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from pitch import Planner, ShiftTrajectory, Situation
from services.bench.population.draw import TRIAL_S, Process
from services.messages import BLOCK_S, Floats
from services.nodes.machine import make_plant
from turning_sim import Simulator, slides_of_shift

HEARD_S, JUDGED_S = 0.1, 0.05
"""Stretch from which frequency and amplitude are told."""
FREQUENCY_ERROR_HZ = 2.4
"""Standard error of the frequency: a third of the detections lie within 1 Hz, as `bench detector` finds."""
HYSTERESIS = 0.7
QUIET_S = 1.0
"""How long it must stay below the threshold, turret 1 at rest, to count as suppressed."""
MOST_MOVES = 2
_PADDING = 8


@dataclass(frozen=True, slots=True, kw_only=True)
class Trial:
    """How it went.

    Attributes
    ----------
    suppressed
        Whether it fell silent with at most two moves.
    moves
        Until then, or until it was over.
    first_shift, last_shift
        Commanded (rad), nan without a move.
    quiet_after_s
        Time from the first command to the last moment above the threshold; nan if it is not suppressed.
    ended
        quiet, moves, gave up, time.
    """

    suppressed: bool
    moves: int
    first_shift: float
    last_shift: float
    quiet_after_s: float
    ended: str


class Ear:
    """Hears chatter from the true vibration with the error of a detector."""

    def __init__(self, process: Process) -> None:
        case = process.case
        self._rate, self._band = case.settings.sample_rate_hz, case.monitor.band_hz
        self.threshold = case.settings.threshold * 0.5 * case.cutting.feed_per_rev
        self._heard = np.zeros(round(HEARD_S * self._rate))
        self._rng = np.random.default_rng([process.seed, 5])
        self._window = np.hanning(self._heard.size)
        self._on = False

    def hear(self, vibration: Floats) -> tuple[float, float | None]:
        """Return the amplitude (m) and, while there is chatter, its frequency (Hz)."""
        self._heard = np.concatenate([self._heard[vibration.size :], vibration])
        recent = self._heard[-round(JUDGED_S * self._rate) :]
        amplitude = math.sqrt(2.0) * float(np.std(recent))
        self._on = amplitude > self.threshold * (HYSTERESIS if self._on else 1.0)
        return amplitude, self._line() if self._on else None

    def _line(self) -> float:
        size = _PADDING * self._heard.size
        power = np.abs(np.fft.rfft((self._heard - self._heard.mean()) * self._window, size))
        hertz = np.fft.rfftfreq(size, 1.0 / self._rate)
        power[(hertz < self._band[0]) | (hertz > self._band[1])] = 0.0
        return float(hertz[int(power.argmax())]) + FREQUENCY_ERROR_HZ * float(self._rng.standard_normal())


def try_process(process: Process, *, foresight: bool, grown_s: float = 0.0) -> Trial:
    """Let the planner work on a process until it is silent, or until it is plain that it will not be.

    Parameters
    ----------
    process
        Of the population.
    foresight
        Whether the planner has its belief; without, it puts half a wave at the measured frequency, in one order.
    grown_s
        How long the chatter may grow before the planner is armed (s).
    """
    return _Run(process, foresight, grown_s).result()


class _Run:
    """The state of one trial."""

    def __init__(self, process: Process, foresight: bool, grown_s: float) -> None:
        case = process.case
        self._process, self._case, self._ear = process, case, Ear(process)
        self._rate, self._size = case.settings.sample_rate_hz, round(BLOCK_S * case.settings.sample_rate_hz)
        self._plant: Simulator = make_plant(case, process.seed, air_time=0.0)
        rule = replace(case.planner, fallback_phases=(), max_order=0)
        self._planner = Planner(case.planner, belief=case.foresight) if foresight else Planner(rule)
        self._armed = round(grown_s / BLOCK_S)
        self._path = ShiftTrajectory(case.path, self._rate)
        self._due: list[tuple[int, float]] = []
        self._targets: list[float] = []
        self._first = self._loud = 0

    def result(self) -> Trial:
        """Advance until it is over."""
        ended = "time"
        for number in range(round(TRIAL_S / BLOCK_S)):
            ended = self._step(number)
            if ended:
                break
        quiet = ended == "quiet"
        return Trial(
            suppressed=quiet and len(self._targets) <= MOST_MOVES, moves=len(self._targets),
            first_shift=self._targets[0] if self._targets else math.nan,
            last_shift=self._targets[-1] if self._targets else math.nan,
            quiet_after_s=(self._loud - self._first) * BLOCK_S if quiet and self._targets else math.nan,
            ended=ended or "time",
        )  # fmt: skip

    def _step(self, number: int) -> str:
        while self._due and self._due[0][0] <= number:
            self._path.retarget(self._due.pop(0)[1])
        x1, y1 = slides_of_shift(self._path.advance(self._size), self._plant.diameter, self._case.drives.axis_angle)
        block = self._plant.advance(x1, y1)
        amplitude, line_hz = self._ear.hear(block.vibration)
        if amplitude > self._ear.threshold:
            self._loud = number
        decision = self._planner.decide(
            Situation(
                sample=(number + 1) * self._size - 1, chatter=line_hz is not None, frequency_hz=line_hz,
                kind="regenerative" if line_hz is not None else None, spindle_hz=self._case.cutting.spindle_hz,
                diameter=self._plant.diameter, shift=float(block.shift[-1]), in_cut=True, moving=self._path.moving,
                armed=number >= self._armed, loudness=amplitude / self._ear.threshold,
            )
        )  # fmt: skip
        if decision.action == "move":
            self._first = self._first or number
            self._targets.append(decision.target_shift)
            self._due.append((number + self._case.settings.apply_after_blocks, decision.target_shift))
            if len(self._targets) > MOST_MOVES:
                return "moves"
        if decision.action == "give_up":
            return "gave up"
        still = self._targets and not self._due and not self._path.moving
        return "quiet" if still and (number - self._loud) * BLOCK_S >= QUIET_S else ""
