"""Which line it is, from block to block: found, told from forced vibration, seen to stand still, refined."""

from copy import deepcopy
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chatter.estimate import Kind, MonitorConfig
from chatter.spectrum import Line, pencil, refine

Floats = NDArray[np.float64]

STRETCH = 1.6
"""Stretch of the first frequency estimate over the window of detection: lines 40 Hz apart are told apart in 80 ms."""
AGREEMENT = 0.125
"""Part of the inverse of the stretch by which two estimates may differ and still be of the same line."""
UNCERTAINTY = 0.25
"""Part of the inverse of the stretch by which one estimate may be wrong."""
COHERENT = 0.8
"""Share of the signal that lines must explain: of noise in two channels, four of them explain less in 99 % of cases."""
LOYALTY = 0.8
"""A line is followed until another one is stronger by more than this ratio."""
REACH = 1.5
"""Part of the inverse of the window by which a line may wander and still be followed in a wide band."""


@dataclass(slots=True, kw_only=True)
class _Track:
    """Everything that the tracker remembers."""

    lines: tuple[Line, ...] = ()
    line: Line | None = None
    kind: Kind | None = None
    agreeing: int = 0
    steady: int = 0
    refined: Line | None = None
    since_refined: int = 0
    followed_hz: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Found:
    """The lines near a frequency, and the one chosen among them."""

    lines: tuple[Line, ...]
    line: Line
    kind: Kind


class LineTracker:
    """Follows the line that stands over its limit.

    Parameters
    ----------
    config : MonitorConfig
        Parameters.
    sample_rate_hz : float
        Sampling rate (Hz).
    """

    def __init__(self, config: MonitorConfig, sample_rate_hz: float) -> None:
        self._config = config
        self._sample_rate_hz = sample_rate_hz
        low, high = config.band_hz
        self._wide = config.dominance is not None
        self._half_band_hz = 8.0 / config.window if self._wide else max(0.6 * (high - low), 8.0 / config.window)
        self._window_blocks = round(config.window / config.block)
        self._track = _Track()

    @property
    def kind(self) -> Kind | None:
        """Kind of the line followed; None when there is none."""
        return self._track.kind if self._track.line is not None else None

    @property
    def followed_hz(self) -> float:
        """Frequency of the line followed in a wide band (Hz)."""
        return self._track.followed_hz

    @property
    def decays(self) -> bool:
        """Whether the line falls e-fold within its stretch: a ring after a knock keeps nothing up."""
        line = self._track.line
        return line is not None and line.growth * line.span <= -1.0

    @property
    def coherent(self) -> bool:
        """Whether lines explain the signal, rather than noise."""
        return self._track.line is not None and self._track.line.explained >= COHERENT

    @property
    def agreeing(self) -> int:
        """Consecutive blocks in which the line was the same as in the block before."""
        return self._track.agreeing

    def forget(self) -> None:
        """Forget the line."""
        self._track = _Track()

    def snapshot(self) -> Any:
        """Return a copy of the whole state."""
        return deepcopy(self._track)

    def restore(self, state: Any) -> None:
        """Continue from a copy of the state.

        Parameters
        ----------
        state : object
            What `snapshot` returned.
        """
        self._track = deepcopy(state)

    def find(
        self, peak_hz: float, history: Floats, spindle_hz: float | None, *, age: float, alarm: bool
    ) -> Found | None:
        """Return the strongest line that is no harmonic of the spindle, or else the strongest at all.

        Parameters
        ----------
        peak_hz : float
            Where the spectrum of the window stands out (Hz).
        history : ndarray, shape (n, channels)
            Band-passed samples, the newest last.
        spindle_hz : float or None
            Spindle speed (Hz).
        age : float
            Time since the tools entered or the stream began (s); what was before is left out.
        alarm : bool
            Whether it chatters already.
        """
        span = min(max(age, self._config.window), STRETCH * self._config.window)
        samples = min(round(span * self._sample_rate_hz), len(history))
        centre = peak_hz if self._wide else 0.5 * sum(self._config.band_hz)
        lines = pencil(history[len(history) - samples :], centre, self._half_band_hz, self._sample_rate_hz)
        if not lines:
            return None
        strong = tuple(line for line in lines if line.amplitude >= 0.5 * lines[0].amplitude)
        free = [line for line in strong if self._kind(line, spindle_hz, alarm) == "regenerative"]
        if not free:
            return Found(lines=strong, line=strong[0], kind="forced")
        before = self._track.line
        for line in free:
            loyal = before is not None and abs(line.frequency_hz - before.frequency_hz) < UNCERTAINTY / line.span
            if loyal and line.amplitude >= LOYALTY * free[0].amplitude:
                return Found(lines=strong, line=line, kind="regenerative")
        return Found(lines=strong, line=free[0], kind="regenerative")

    def _kind(self, line: Line, spindle_hz: float | None, alarm: bool) -> Kind:
        """Tell a harmonic of the spindle or of the tools from anything else, when the resolution allows it."""
        if not spindle_hz or line.growth * line.span > 1.0:
            return "regenerative"  # a forced line does not grow e-fold within the stretch
        if alarm and (
            not self._wide or abs(line.frequency_hz - self._track.followed_hz) <= REACH / self._config.window
        ):
            return "regenerative"  # chatter may drift over a harmonic without becoming one
        tolerance = self._config.speed_uncertainty * line.frequency_hz + UNCERTAINTY / line.span
        for spacing in (spindle_hz, spindle_hz * self._config.tools):
            if tolerance < spacing / 6.0:
                away = abs(line.frequency_hz - spacing * round(line.frequency_hz / spacing))
                return "forced" if away <= tolerance else "regenerative"
        return "regenerative"

    def follow(self, found: Found | None, history: Floats) -> None:
        """Keep what was found and count for how long it has been the same.

        Parameters
        ----------
        found : Found or None
            What `find` returned; None when no line stands over its limit.
        history : ndarray, shape (n, channels)
            Band-passed samples, the newest last.
        """
        track = self._track
        if found is None:
            self._track = _Track(followed_hz=track.followed_hz)
            return
        line = found.line
        away = min((abs(line.frequency_hz - other.frequency_hz) for other in track.lines), default=np.inf)
        near = bool(away < AGREEMENT / line.span)
        stands = near and line.growth * line.span > -1.0 and line.explained >= COHERENT
        track.agreeing = track.agreeing + 1 if stands else 0
        same = track.line is not None and abs(line.frequency_hz - track.line.frequency_hz) < UNCERTAINTY / line.span
        track.steady = track.steady + 1 if same else 0
        track.lines, track.line, track.kind = found.lines, line, found.kind
        self._refine(line, history)

    def _refine(self, line: Line, history: Floats) -> None:
        """Take the frequency from the longest stretch in which the line is steady, once a window."""
        track = self._track
        track.since_refined += 1
        if track.refined is not None and track.steady and track.since_refined < self._window_blocks:
            return
        track.since_refined, track.refined = 0, None
        span = track.steady * self._config.block
        shortest = round(STRETCH * self._config.window * self._sample_rate_hz)
        longest = min(round(span * self._sample_rate_hz), len(history))
        if longest < 2 * shortest:
            return
        result = refine(history[len(history) - longest :], line.frequency_hz, shortest, self._sample_rate_hz)
        if result is not None and abs(result[0] - line.frequency_hz) <= UNCERTAINTY / line.span:
            track.refined = replace(line, frequency_hz=result[0], span=result[2])

    def is_followed(self, alarm: bool) -> bool:
        """Return whether the line is the one followed so far, or its harmonic; without an alarm follow it from now on.

        Parameters
        ----------
        alarm : bool
            Whether it chatters already.
        """
        track = self._track
        frequency = track.line.frequency_hz if track.line is not None else 0.0
        for factor in (1.0, 0.5, 2.0, 1.0 / 3.0, 3.0):
            if abs(factor * frequency - track.followed_hz) <= REACH * max(factor, 1.0) / self._config.window:
                track.followed_hz = frequency if factor == 1.0 else track.followed_hz
                return True
        if not alarm:
            track.followed_hz = frequency
        return False

    def describe(self) -> dict[str, Any]:
        """Return the fields of the estimate that follow from the line."""
        track = self._track
        if track.line is None:
            return {}
        best = track.refined or track.line
        return {
            "frequency_hz": best.frequency_hz,
            "span": best.span,
            "amplitude": track.line.amplitude,
            "growth": track.line.growth,
            "confidence": track.line.explained,
            "kind": track.kind,
        }
