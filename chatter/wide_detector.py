"""Whether it chatters in a wide band: one line that dominates all others for long enough."""

from copy import deepcopy
from dataclasses import dataclass
from math import ceil, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chatter.dominance import Dominant, standing_limit, strongest
from chatter.estimate import LimitSource, MonitorConfig
from chatter.limits import LearnedLevel
from chatter.line_kinds import Scene
from chatter.line_tracker import Found, LineTracker

Floats = NDArray[np.float64]

PERSISTENCE = 3
"""Windows for which a line must dominate a wide band: longer than a knock or an entry lasts in one window."""
VARIES = 2.0
"""Least power over its quiet level of a line that dominates all of the band: a tone of the machine does not vary."""


@dataclass(slots=True, kw_only=True)
class _Memory:
    """Everything that the detector remembers."""

    air: LearnedLevel
    cut: LearnedLevel
    in_cut: bool | None = None
    settled: int = 0
    """Blocks since windows were last disturbed: start, entry, exit, excursion, move."""
    since_entry: int = 0
    alarm: bool = False
    score: int = 0
    filled: int = 0
    """Band-passed samples since windows were emptied."""


class WideDetector:
    """Limits, hysteresis and kind in a wide band; one `step` for each block of the grid.

    Parameters
    ----------
    config : MonitorConfig
        Parameters, with a `dominance`.
    frequencies_hz : ndarray, shape (bins,)
        Bins of the spectrum that `step` is given (Hz).
    freedom : float
        Degrees of freedom of the mean square of one window of Gaussian noise.
    sample_rate_hz : float
        Sampling rate (Hz).
    channels : int
        Number of channels.
    """

    def __init__(
        self, config: MonitorConfig, frequencies_hz: Floats, freedom: float, sample_rate_hz: float, channels: int
    ) -> None:
        self._config = config
        self._dominance = config.dominance or 0.0
        self._frequencies_hz = frequencies_hz
        self._freedom = freedom
        self._square_probability = min(config.window / config.false_alarm_interval, 0.1)
        self._window_blocks = ceil(config.window / config.block - 1e-9)
        self._tracker = LineTracker(config, sample_rate_hz)
        block = max(round(config.block * sample_rate_hz), 1)
        self._depth = block * ceil(config.refine_window * sample_rate_hz / block)
        self._ring = np.zeros((2 * self._depth, channels))
        self.reset()

    def reset(self) -> None:
        """Forget everything, learned limits too."""
        most = self._config.memory_time / self._config.window
        bins = len(self._frequencies_hz)
        self._memory = _Memory(air=LearnedLevel(bins, most), cut=LearnedLevel(bins, most))
        self._tracker.forget()

    def restart(self) -> None:
        """Forget the momentary state after windows were emptied; learned limits stay."""
        self._memory = _Memory(air=self._memory.air, cut=self._memory.cut)
        self._tracker.forget()

    def snapshot(self) -> Any:
        """Return a copy of the whole state."""
        return deepcopy(self._memory), self._tracker.snapshot(), self._ring.copy()

    def restore(self, state: Any) -> None:
        """Continue from a copy of the state.

        Parameters
        ----------
        state : object
            What `snapshot` returned.
        """
        self._memory = deepcopy(state[0])
        self._tracker.restore(state[1])
        self._ring = state[2].copy()

    def assume(self, power: Floats, square: float, windows: float) -> None:
        """Take levels for those of the air.

        Parameters
        ----------
        power : ndarray, shape (bins,)
            Squared line amplitude in every bin.
        square : float
            Mean square of the band.
        windows : float
            Independent windows behind them.
        """
        self._memory.air.forget()
        self._memory.air.learn(power, square, windows)

    def step(self, band: Floats, power: Floats, square: float, scene: Scene) -> dict[str, Any]:
        """Judge one block and return the fields of its `ChatterEstimate` that follow from it.

        Parameters
        ----------
        band : ndarray, shape (block, channels)
            Band-passed samples.
        power : ndarray, shape (bins,)
            Squared line amplitude in every bin.
        square : float
            Mean square of the band over the window, summed over the channels.
        scene : Scene
            What is known beside the samples.
        """
        in_cut, spindle_hz = scene.in_cut, scene.spindle_hz
        history = self._remember(band)
        memory = self._memory
        self._follow_context(in_cut, scene.moving)
        line_limit, square_limit, source = self._limits(power, in_cut)
        peak, share, line_over = self._strongest(power, square, line_limit, source, spindle_hz)
        square_over = square > self._level * square_limit
        over = int(line_over) + int(square_over)
        fields: dict[str, Any] = {
            "indicator": sqrt(square),
            "limit": sqrt(square_limit),
            "line": sqrt(float(power[peak])),
            "line_limit": sqrt(float(line_limit[peak])),
            "limit_source": source,
            "raised": over == 2,
            "share": share,
        }
        if in_cut is False:
            memory.alarm, memory.score = False, 0
            self._tracker.forget()
        else:
            look = line_over and (over == 2 or memory.alarm)
            self._tracker.follow(self._find(peak, history, spindle_hz) if look else None, history)
            self._switch(over == 2 and self._tracker.kind == "regenerative")
            fields.update(self._tracker.describe())
        fields["state"] = self._state(over, in_cut)
        if over and in_cut is not False:
            memory.settled = 0
        self._learn(power, square, in_cut)
        return fields

    def _remember(self, band: Floats) -> Floats:
        """Write a block into the ring and return everything since the windows were emptied, at most its depth."""
        memory = self._memory
        end = memory.filled % self._depth + len(band)
        self._ring[end - len(band) : end] = band
        self._ring[end - len(band) + self._depth : end + self._depth] = band
        memory.filled += len(band)
        return self._ring[end + self._depth - min(memory.filled, self._depth) : end + self._depth]

    @property
    def _level(self) -> float:
        """Part of a limit on power that counts: less while it chatters."""
        return self._config.hysteresis**2 if self._memory.alarm else 1.0

    def _strongest(
        self, power: Floats, square: float, limit: Floats, source: LimitSource, spindle_hz: float | None
    ) -> tuple[int, float, bool]:
        """Return the bin of the line to judge, its share of the lines, and whether it is over its limit."""
        kept_hz = self._tracker.followed_hz if self._memory.alarm else np.inf
        uncertainty = self._config.speed_uncertainty
        standing = standing_limit(power)
        best = strongest(power, standing, square, self._frequencies_hz, spindle_hz, uncertainty, kept_hz)
        if best is None:
            return int(power.argmax()), 0.0, False
        return best.peak, best.share, self._dominates(best, power, limit, source)

    def _dominates(self, best: Dominant, power: Floats, limit: Floats, source: LimitSource) -> bool:
        """Return whether a line dominates all lines and began in what was seen, or else dominates all of the band."""
        least = self._level * self._dominance
        quiet = self._memory.air
        if source != "spectrum":
            if best.share >= least and power[best.peak] > self._level * limit[best.peak]:
                return True
            if quiet.square > 0.0 and power[best.peak] < VARIES * quiet.power[best.peak]:
                return False  # it stands where it stood while the rest of the band was quieter
        return best.whole >= least

    def _follow_context(self, in_cut: bool | None, moving: bool) -> None:
        memory = self._memory
        changed = in_cut is not memory.in_cut
        memory.in_cut = in_cut
        memory.settled = 0 if changed or moving else memory.settled + 1
        memory.since_entry = 1 if changed else memory.since_entry + 1

    def _limits(self, power: Floats, in_cut: bool | None) -> tuple[Floats, float, LimitSource]:
        """Return the squared limits of every bin and of the band, and where they come from."""
        config, memory = self._config, self._memory
        line = np.full(len(self._frequencies_hz), np.finfo(np.float64).tiny)
        square = float(np.finfo(np.float64).tiny)
        source: LimitSource = "none"
        learned: list[tuple[LearnedLevel, float, LimitSource]] = [
            (memory.air, config.air_time, "reference" if in_cut is None else "air")
        ]
        if in_cut:
            learned.append((memory.cut, config.cutting_time, "cutting"))
        for level, time, name in learned:
            if level.ready(config.window, time):
                line = np.maximum(line, level.power * level.line_factor(config.line_probability))
                factor = level.square_factor(self._freedom, self._square_probability, False)
                square = max(square, level.square * factor)
                source = name
        if in_cut and source != "cutting" and config.expected_limit is not None:
            line = np.maximum(line, config.expected_limit**2)
            square = max(square, 0.5 * config.expected_limit**2)
            source = "configured"
        return (standing_limit(power), square, "spectrum") if source == "none" else (line, square, source)

    def _learn(self, power: Floats, square: float, in_cut: bool | None) -> None:
        """Take the block in as background, unless nobody knows what it is or the window holds a disturbance."""
        memory = self._memory
        if memory.settled <= self._window_blocks or in_cut is None:
            return
        level = memory.cut if in_cut else memory.air
        level.learn(power, square, self._config.block / self._config.window)

    def _find(self, peak: int, history: Floats, spindle_hz: float | None) -> Found | None:
        age = self._memory.since_entry * self._config.block
        frequency = float(self._frequencies_hz[peak])
        return self._tracker.find(frequency, history, spindle_hz, age=age, alarm=self._memory.alarm)

    def _switch(self, counts: bool) -> None:
        """Ask for one line for three windows, up for each block with it and down for each without."""
        memory = self._memory
        most = PERSISTENCE * self._window_blocks
        counts = counts and (memory.alarm or not self._tracker.decays)
        if counts and not self._tracker.is_followed(memory.alarm):
            memory.score, counts = (memory.score, False) if memory.alarm else (0, True)
        memory.score = min(memory.score + 1, most) if counts else max(memory.score - 1, 0)
        memory.alarm = memory.score > 0 if memory.alarm else memory.score >= most

    def _state(self, over: int, in_cut: bool | None) -> str:
        if in_cut is False:
            return "idle"
        if self._memory.alarm:
            return "chatter"
        return "suspect" if over else "quiet"
