"""Whether it chatters: two indicators against learned limits, confirmed by a line that stands still."""

from copy import deepcopy
from dataclasses import dataclass
from math import ceil, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chatter.dominance import Dominant, standing_limit, strongest
from chatter.estimate import LimitSource, MonitorConfig
from chatter.limits import LearnedLevel
from chatter.line_tracker import STRETCH, Found, LineTracker

Floats = NDArray[np.float64]

PERSISTENCE = 3
"""Windows for which a line must dominate a wide band: longer than a knock or an entry lasts in one window."""
SETTLING = 0.5
"""Windows after the entry that must have left the stretch of the frequency: the blow of the entry rings in them."""
VARIES = 2.0
"""Least power over its quiet level of a line that dominates all of the band: a tone of the machine does not vary."""
PATIENCE = 2
"""Windows after which an alarm is given although no line has stood still: two may beat for long."""


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
    raised: int = 0
    lowered: int = 0
    score: int = 0


class Detector:
    """Limits, hysteresis, confirmation and kind; one `step` for each block of the grid.

    Parameters
    ----------
    config : MonitorConfig
        Parameters.
    frequencies_hz : ndarray, shape (bins,)
        Bins of the spectrum that `step` is given (Hz).
    freedom : float
        Degrees of freedom of the mean square of one window of Gaussian noise.
    sample_rate_hz : float
        Sampling rate (Hz).
    """

    def __init__(self, config: MonitorConfig, frequencies_hz: Floats, freedom: float, sample_rate_hz: float) -> None:
        self._config = config
        self._frequencies_hz = frequencies_hz
        self._freedom = freedom
        low, high = config.band_hz
        self._line_probability = min(1.0 / ((high - low) * config.false_alarm_interval), 0.1)
        self._square_probability = min(config.window / config.false_alarm_interval, 0.1)
        self._window_blocks = ceil(config.window / config.block - 1e-9)
        self._tracker = LineTracker(config, sample_rate_hz)
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
        return deepcopy(self._memory), self._tracker.snapshot()

    def restore(self, state: Any) -> None:
        """Continue from a copy of the state.

        Parameters
        ----------
        state : object
            What `snapshot` returned.
        """
        self._memory = deepcopy(state[0])
        self._tracker.restore(state[1])

    def step(
        self,
        power: Floats,
        square: float,
        history: Floats,
        *,
        in_cut: bool | None,
        spindle_hz: float | None,
        moving: bool,
    ) -> dict[str, Any]:
        """Judge one block and return the fields of its `ChatterEstimate` that follow from it.

        Parameters
        ----------
        power : ndarray, shape (bins,)
            Squared line amplitude in every bin.
        square : float
            Mean square of the band over the window, summed over the channels.
        history : ndarray, shape (n, channels)
            Band-passed samples since the windows were last emptied, the newest last.
        in_cut : bool or None
            Whether the tools cut; None when nobody knows.
        spindle_hz : float or None
            Spindle speed, when known (Hz).
        moving : bool
            Whether a turret moves.
        """
        memory = self._memory
        self._follow_context(in_cut, moving)
        line_limit, square_limit, source = self._limits(power, in_cut)
        if source == "none":
            self._learn(power, square, in_cut)
            return {"state": "learning", "indicator": sqrt(square), "line": sqrt(float(power.max()))}
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
            memory.alarm, memory.raised, memory.score = False, 0, 0
            self._tracker.forget()
        else:
            look = line_over and (over == 2 or memory.alarm)
            self._tracker.follow(self._find(peak, history, spindle_hz) if look else None, history)
            self._switch(over == 2)
            fields.update(self._tracker.describe())
        fields["state"] = self._state(over, in_cut)
        if over and in_cut is not False:
            memory.settled = 0
        self._learn(power, square, in_cut)
        return fields

    @property
    def _level(self) -> float:
        """Part of a limit on power that counts: less while it chatters."""
        return self._config.hysteresis**2 if self._memory.alarm else 1.0

    def _strongest(
        self, power: Floats, square: float, limit: Floats, source: LimitSource, spindle_hz: float | None
    ) -> tuple[int, float, bool]:
        """Return the bin of the line to judge, its share of the lines, and whether it is over its limit."""
        if self._config.dominance is None:
            peak = int((power / limit).argmax())
            return peak, 0.0, bool(power[peak] > self._level * limit[peak])
        best = self._dominant(power, square, spindle_hz)
        if best is None:
            return int(power.argmax()), 0.0, False
        return best.peak, best.share, self._dominates(best, power, limit, source)

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

    def _dominant(self, power: Floats, square: float, spindle_hz: float | None) -> Dominant | None:
        """Return the strongest line of a wide band that is not forced."""
        kept_hz = self._tracker.followed_hz if self._memory.alarm else np.inf
        uncertainty = self._config.speed_uncertainty
        standing = standing_limit(power)
        return strongest(power, standing, square, self._frequencies_hz, spindle_hz, uncertainty, kept_hz)

    def _dominates(self, best: Dominant, power: Floats, limit: Floats, source: LimitSource) -> bool:
        """Return whether a line dominates all lines and began in what was seen, or else dominates all of the band."""
        least = self._level * (self._config.dominance or 0.0)
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
            if self._ready(level, time):
                line = np.maximum(line, level.power * level.line_factor(self._line_probability))
                scatters = config.dominance is None
                factor = level.square_factor(self._freedom, self._square_probability, scatters)
                square = max(square, level.square * factor)
                source = name
        if in_cut and source != "cutting" and config.expected_limit is not None:
            line = np.maximum(line, config.expected_limit**2)
            square = max(square, 0.5 * config.expected_limit**2)
            source = "configured"
        if source == "none" and config.dominance is not None:
            return standing_limit(power), square, "spectrum"
        return line, square, source

    def _ready(self, level: LearnedLevel, time: float) -> bool:
        return level.windows * self._config.window >= time * (1.0 - 1e-9)

    def _learn(self, power: Floats, square: float, in_cut: bool | None) -> None:
        """Take the block in as background, unless the window holds a disturbance."""
        config, memory = self._config, self._memory
        unknown = in_cut is None and config.dominance is not None
        if memory.settled <= self._window_blocks or unknown:
            return
        level = memory.cut if in_cut else memory.air
        level.learn(power, square, config.block / config.window)

    def _find(self, peak: int, history: Floats, spindle_hz: float | None) -> Found | None:
        age = self._memory.since_entry * self._config.block
        frequency = float(self._frequencies_hz[peak])
        return self._tracker.find(frequency, history, spindle_hz, age=age, alarm=self._memory.alarm)

    def _switch(self, both: bool) -> None:
        """Raise or end the alarm."""
        config, memory = self._config, self._memory
        memory.raised = memory.raised + 1 if both and self._tracker.coherent else 0
        memory.lowered = 0 if both else memory.lowered + 1
        counts = both and self._tracker.kind == "regenerative"
        if config.dominance is not None:
            self._switch_wide(counts)
        elif memory.alarm:
            memory.alarm = memory.lowered < self._window_blocks
        elif counts:
            patient = memory.raised > PATIENCE * self._window_blocks
            inside = memory.since_entry * config.block >= (STRETCH + SETTLING) * config.window
            memory.alarm = inside and (self._tracker.agreeing >= config.confirm or patient)
            if memory.alarm and not self._ready(memory.cut, config.cutting_time):
                memory.cut.forget()  # the growth just before the alarm is in it

    def _switch_wide(self, counts: bool) -> None:
        """Ask in a wide band for one line for three windows, up for each block with it and down for each without."""
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
