"""Whether it chatters: two indicators against learned limits, confirmed by a line that stands still."""

from copy import deepcopy
from dataclasses import dataclass, replace
from math import ceil, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chatter.dominance import Dominant, harmonic_bins, standing_limit, strongest
from chatter.estimate import Kind, LimitSource, MonitorConfig
from chatter.limits import LearnedLevel
from chatter.spectrum import Line, pencil, refine

Floats = NDArray[np.float64]

STRETCH = 1.6
"""Stretch of the first frequency estimate over the window of detection: two lines 40 Hz apart are told apart."""
PERSISTENCE = 3
"""Windows for which a line must dominate a wide band: longer than a knock or an entry lasts in one window."""
AGREEMENT = 0.25
"""Part of a bin by which two estimates may differ and still be of the same line."""


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
    kind: Kind | None = None
    raised: int = 0
    score: int = 0
    followed_hz: float = 0.0
    lowered: int = 0
    agreeing: int = 0
    line: Line | None = None
    since_refined: int = 0
    refined: Line | None = None


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
        self._sample_rate_hz = sample_rate_hz
        low, high = config.band_hz
        self._line_probability = min(1.0 / ((high - low) * config.false_alarm_interval), 0.1)
        self._square_probability = min(config.window / config.false_alarm_interval, 0.1)
        self._half_band_hz = 8.0 / config.window
        self._window_blocks = ceil(config.window / config.block - 1e-9)
        self.reset()

    def reset(self) -> None:
        """Forget everything, learned limits too."""
        most = self._config.memory_time / self._config.window
        bins = len(self._frequencies_hz)
        self._memory = _Memory(air=LearnedLevel(bins, most), cut=LearnedLevel(bins, most))

    def restart(self) -> None:
        """Forget the momentary state after windows were emptied; learned limits stay."""
        self._memory = _Memory(air=self._memory.air, cut=self._memory.cut)

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
        level = self._config.hysteresis**2 if memory.alarm else 1.0
        square_over = square > level * square_limit
        if self._config.dominance is None:
            peak, share, found = int((power / line_limit).argmax()), 0.0, None
            line_over = bool(power[peak] > level * line_limit[peak])
        else:
            best, found = self._dominant(power, square, history, spindle_hz)
            peak, share = (best.peak, best.share) if best else (int(power.argmax()), 0.0)
            line_over, alone = self._dominates(best, power, line_limit, source, level)
            square_over = square_over or alone
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
            memory.alarm, memory.raised, memory.score, memory.line, memory.refined = False, 0, 0, None, None
        else:
            if found is None and line_over and (over == 2 or memory.alarm):
                found = self._nearest(peak, history, spindle_hz)
            self._follow_line(found if line_over else None, history)
            self._switch(over == 2)
            fields.update(self._describe())
        fields["state"] = self._state(over, in_cut)
        if over and in_cut is not False:
            memory.settled = 0
        self._learn(power, square, in_cut)
        return fields

    def learn_air(self, power: Floats, square: float) -> None:
        """Take a block of air in, whatever the state.

        Parameters
        ----------
        power : ndarray, shape (bins,)
            Squared line amplitude in every bin.
        square : float
            Mean square of the band over the window, summed over the channels.
        """
        self._follow_context(False, False)
        self._learn(power, square, False)

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

    def _dominant(
        self, power: Floats, square: float, history: Floats, spindle_hz: float | None
    ) -> tuple[Dominant | None, tuple[Line, Kind] | None]:
        """Return the strongest line of a wide band that is not forced, or else the forced one, and what is known."""
        standing = standing_limit(power)
        best = strongest(power, standing, square)
        forced = harmonic_bins(self._frequencies_hz, spindle_hz, self._config.speed_uncertainty)
        if best is None or forced is None or not forced[best.peak]:
            return best, None
        found = self._nearest(best.peak, history, spindle_hz)
        if found is not None and found[1] == "forced":
            other = strongest(power, standing, square, forced)
            if other is not None:
                return other, None
        return best, found

    def _dominates(
        self, best: Dominant | None, power: Floats, limit: Floats, source: LimitSource, level: float
    ) -> tuple[bool, bool]:
        """Return whether a line dominates, and whether it does so without the help of a reference."""
        least = level * (self._config.dominance or 0.0)
        if best is None:
            return False, False
        began = source != "spectrum" and bool(power[best.peak] > level * limit[best.peak]) and best.share >= least
        return began or best.whole >= least, best.whole >= least

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

    def _follow_line(self, found: tuple[Line, Kind] | None, history: Floats) -> None:
        """Keep the line that was found and count how often in a row it was the same one."""
        config, memory = self._config, self._memory
        if found is None:
            memory.line, memory.refined, memory.agreeing = None, None, 0
            return
        line, kind = found
        near = memory.line is not None and abs(line.frequency_hz - memory.line.frequency_hz) < AGREEMENT / line.span
        memory.agreeing = memory.agreeing + 1 if near and line.growth * line.span > -1.0 else 0
        memory.line = line
        memory.kind = "regenerative" if memory.alarm and not config.dominance else kind
        self._refine(line, history, near)

    def _switch(self, both: bool) -> None:
        """Raise or end the alarm."""
        config, memory = self._config, self._memory
        most = PERSISTENCE * self._window_blocks
        memory.raised = memory.raised + 1 if both else 0
        memory.lowered = 0 if both else memory.lowered + 1
        counts = both and memory.line is not None and memory.kind == "regenerative"
        if config.dominance and counts:
            counts = self._is_followed()
        memory.score = min(memory.score + 1, most) if counts else max(memory.score - 1, 0)
        if memory.alarm:
            memory.alarm = memory.score > 0 if config.dominance else memory.lowered < self._window_blocks
            return
        if config.dominance:
            memory.alarm = memory.score >= most
        elif counts:
            memory.alarm = memory.agreeing >= config.confirm or memory.raised > 2 * self._window_blocks
        if memory.alarm and not self._ready(memory.cut, config.cutting_time):
            memory.cut.forget()

    def _is_followed(self) -> bool:
        """Return whether the line is the one followed, or its harmonic; another one is followed from now on."""
        memory = self._memory
        frequency = memory.line.frequency_hz if memory.line is not None else 0.0
        for factor in (1.0, 0.5, 2.0, 1.0 / 3.0, 3.0):
            if abs(factor * frequency - memory.followed_hz) <= 1.5 * max(factor, 1.0) / self._config.window:
                memory.followed_hz = factor * frequency if factor == 1.0 else memory.followed_hz
                return True
        if not memory.alarm:
            memory.followed_hz, memory.score = frequency, 0
        return not memory.alarm

    def _nearest(self, peak: int, history: Floats, spindle_hz: float | None) -> tuple[Line, Kind] | None:
        """Return the strongest line near a bin that is no harmonic of the spindle, or else the strongest at all."""
        config, memory = self._config, self._memory
        least = config.window
        span = min(max(memory.since_entry * config.block, least), STRETCH * config.window)
        samples = min(round(span * self._sample_rate_hz), len(history))
        centre = float(self._frequencies_hz[peak])
        lines = pencil(history[len(history) - samples :], centre, self._half_band_hz, self._sample_rate_hz)
        if not lines:
            return None
        for line in lines:
            if line.amplitude < 0.5 * lines[0].amplitude:
                break
            if self._kind(line, spindle_hz) == "regenerative":
                return line, "regenerative"
        return lines[0], "forced"

    def _kind(self, line: Line, spindle_hz: float | None) -> Kind:
        """Tell a harmonic of the spindle or of the tools from anything else, when the resolution allows it."""
        if not spindle_hz or line.growth * line.span > 1.0:
            return "regenerative"  # a forced line does not grow e-fold within the stretch
        reach = 1.5 / self._config.window
        if self._memory.alarm and abs(line.frequency_hz - self._memory.followed_hz) <= reach:
            return "regenerative"  # chatter may drift over a harmonic without becoming one
        tolerance = self._config.speed_uncertainty * line.frequency_hz + AGREEMENT / line.span
        for spacing in (spindle_hz, spindle_hz * self._config.tools):
            if tolerance < spacing / 6.0:
                away = abs(line.frequency_hz - spacing * round(line.frequency_hz / spacing))
                return "forced" if away <= tolerance else "regenerative"
        return "regenerative"

    def _refine(self, line: Line, history: Floats, near: bool) -> None:
        """Take the frequency from the longest stretch in which the line is steady, once a window."""
        memory = self._memory
        memory.since_refined += 1
        if memory.refined is not None and near and memory.since_refined < self._window_blocks:
            return
        memory.since_refined = 0
        shortest = round(2.0 * line.span * self._sample_rate_hz)
        result = refine(history, line.frequency_hz, shortest, self._sample_rate_hz) if near else None
        if result is None or abs(result[0] - line.frequency_hz) > AGREEMENT / line.span:
            memory.refined = None
        else:
            memory.refined = replace(line, frequency_hz=result[0], span=result[2])

    def _describe(self) -> dict[str, Any]:
        memory = self._memory
        if memory.line is None:
            return {}
        best = memory.refined or memory.line
        return {
            "frequency_hz": best.frequency_hz,
            "span": best.span,
            "amplitude": memory.line.amplitude,
            "growth": memory.line.growth,
            "confidence": memory.line.explained,
            "kind": memory.kind,
        }

    def _state(self, over: int, in_cut: bool | None) -> str:
        if in_cut is False:
            return "idle"
        if self._memory.alarm:
            return "chatter"
        return "suspect" if over else "quiet"
