"""The lines of a narrow band from block to block: found together, followed one by one, refined while they stand."""

from copy import deepcopy
from dataclasses import dataclass, field, replace
from math import exp
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chatter.baseband import Baseband
from chatter.confidence import line_confidence
from chatter.estimate import ChatterLine, Kind, MonitorConfig
from chatter.line_kinds import UNCERTAINTY, LineKinds, Scene
from chatter.refinement import settled
from chatter.spectrum import Line, fit

Floats = NDArray[np.float64]

STRETCH = 1.6
"""Stretch of a first frequency estimate over the window of detection: lines 40 Hz apart are told apart in 80 ms."""
COHERENT = 0.8
"""Share of the signal that lines must explain: of noise in two channels, four of them explain less in 99 % of cases."""
AHEAD, STEEPEST = 0.03, 50.0
"""The main line is the one that will be the strongest after so long (s), growing no faster than this (1/s)."""
LOYALTY = 0.8
"""In an alarm a line stays the main one until another one will be stronger by more than this ratio."""
FAINT = 0.15
"""Amplitude over the strongest below which a line may be what noise left."""
STRONG = 0.4
"""Amplitude over the strongest from which a line stands beside it."""
STILL_GROWS = 0.3
"""Growth over its stretch with which a regenerative line stays one."""
REFINED = 2
"""Lines, the strongest first, whose frequency is taken from a longer stretch."""
SEEN = 2
"""Blocks in a row in which a line must be found to be reported beside the main one."""


@dataclass(slots=True, kw_only=True)
class Track:
    """One line through the blocks.

    Parameters
    ----------
    line : Line
        As found in the last block.
    kind : str
        Its kind.
    seen : int
        Blocks in a row in which it was found.
    refined : Line or None
        The same over a longer stretch.
    since : int
        Blocks since it was refined.
    """

    line: Line
    kind: Kind
    seen: int = 1
    refined: Line | None = None
    since: int = 0

    @property
    def best(self) -> Line:
        """The line over the longest stretch known."""
        return self.refined or self.line


@dataclass(slots=True, kw_only=True)
class _Memory:
    tracks: list[Track] = field(default_factory=list[Track])
    main: Track | None = None
    explained: float = 0.0
    growth: float = 0.0
    share: float = 0.0


def _soon(track: Track) -> float:
    """Return the amplitude that a line will have."""
    return track.line.amplitude * exp(min(max(track.line.growth, -STEEPEST), STEEPEST) * AHEAD)


class LineSet:
    """Finds and follows the lines of a narrow band.

    Parameters
    ----------
    config : MonitorConfig
        Parameters.
    sample_rate_hz : float
        Sampling rate (Hz).
    channels : int
        Number of channels.
    """

    def __init__(self, config: MonitorConfig, sample_rate_hz: float, channels: int) -> None:
        self._config = config
        low, high = config.band_hz
        self._slow = Baseband(
            0.5 * (low + high),
            max(0.6 * (high - low), 8.0 / config.window),
            sample_rate_hz,
            max(round(config.block * sample_rate_hz), 1),
            channels,
            config.refine_window,
        )
        self._window_blocks = round(config.window / config.block)
        self._kinds = LineKinds(config, sample_rate_hz, round(STRETCH * config.window / config.block))
        self._memory = _Memory()

    @property
    def main(self) -> Track | None:
        """The strongest regenerative line, or else the strongest; None when nothing stands out."""
        return self._memory.main

    @property
    def regenerative(self) -> bool:
        """Whether the main line is regenerative."""
        return self._memory.main is not None and self._memory.main.kind == "regenerative"

    @property
    def explained(self) -> float:
        """Share of the signal that lines explain, 0...1."""
        return self._memory.explained

    @property
    def growth(self) -> float:
        """Growth rate of all regenerative lines, weighted by energy (1/s)."""
        return self._memory.growth

    @property
    def share(self) -> float:
        """Share of the energy of all lines that the regenerative ones hold, 0...1."""
        return self._memory.share

    @property
    def seen(self) -> int:
        """Blocks in a row in which one of the strong regenerative lines was found at the same frequency."""
        own = [track for track in self._memory.tracks if track.kind == "regenerative"]
        return max((track.seen for track in own if track.line.amplitude >= STRONG * own[0].line.amplitude), default=0)

    def forget(self) -> None:
        """Forget the lines."""
        self._memory = _Memory()

    def restart(self) -> None:
        """Forget the lines and the circumstances."""
        self.forget()
        self._kinds.forget()
        self._slow.reset()

    def snapshot(self) -> Any:
        """Return a copy of the whole state."""
        return deepcopy(self._memory), self._kinds.snapshot(), self._slow.snapshot()

    def restore(self, state: Any) -> None:
        """Continue from a copy of the state.

        Parameters
        ----------
        state : object
            What `snapshot` returned.
        """
        self._memory = deepcopy(state[0])
        self._kinds.restore(state[1])
        self._slow.restore(state[2])

    def enter(self, scene: Scene, age: float) -> None:
        """Take in what is known about a block, whether its lines are looked at or not.

        Parameters
        ----------
        scene : Scene
            What is known.
        age : float
            Time since the tools entered, the speed changed or the stream began (s).
        """
        self._kinds.enter(scene, age)

    def hear(self, band: Floats) -> None:
        """Take a block in, whether its lines are looked at or not.

        Parameters
        ----------
        band : ndarray, shape (block, channels)
            Band-passed samples.
        """
        self._slow.update(band)

    def follow(self, *, age: float, alarm: bool) -> None:
        """Find the lines at the end of the band-passed signal and connect them with those of the block before.

        Parameters
        ----------
        age : float
            Time since the tools entered or the stream began (s); what was before is left out.
        alarm : bool
            Whether it chatters already.
        """
        memory = self._memory
        lines = self._found(min(max(age, self._config.window), STRETCH * self._config.window))
        if not lines:
            self._memory = _Memory()
            return
        least = FAINT * lines[0].amplitude
        tracks = [self._track(line, alarm) for line in lines if line.amplitude >= least]
        own = [track.line for track in tracks if track.kind == "regenerative"]
        energy = sum(line.amplitude**2 for line in own)
        memory.tracks, memory.explained = tracks, lines[0].explained
        memory.share = energy / sum(line.amplitude**2 for line in lines)
        memory.growth = sum(line.growth * line.amplitude**2 for line in own) / energy if energy else 0.0
        memory.main = self._choose(tracks, memory.main if alarm else None)
        for track in tracks[:REFINED]:
            self._refine(track)

    def _found(self, span: float) -> list[Line]:
        """Return the lines of the last stretch."""
        slow = self._slow
        return [
            replace(line, frequency_hz=slow.centre_hz + line.frequency_hz, span=span)
            for line in fit(slow.last(span), slow.rate, slow.step)
            if abs(line.frequency_hz) <= slow.half_band_hz
        ]

    def _track(self, line: Line, alarm: bool) -> Track:
        """Return the track that a line continues, or a new one."""
        reach = UNCERTAINTY / line.span
        near = [t for t in self._memory.tracks if abs(t.line.frequency_hz - line.frequency_hz) < reach]
        before = min(near, key=lambda t: abs(t.line.frequency_hz - line.frequency_hz), default=None)
        if before is None:
            return Track(line=line, kind=self._kinds.tell(line))
        grows = line.growth * line.span > STILL_GROWS
        if before.kind == "regenerative" and (alarm or grows):
            kind: Kind = "regenerative"  # chatter may drift over a harmonic without becoming one
        else:
            kind = self._kinds.tell(line, before.best)
        return Track(line=line, kind=kind, seen=before.seen + 1, refined=before.refined, since=before.since + 1)

    @staticmethod
    def _choose(tracks: list[Track], before: Track | None) -> Track:
        """Return the regenerative line that will be the strongest, or that of the block before if it nearly is."""
        free = [track for track in tracks if track.kind == "regenerative"] or tracks
        best = max(free, key=_soon)
        if before is None:
            return best
        for track in free:
            line = track.line
            same = abs(line.frequency_hz - before.line.frequency_hz) < UNCERTAINTY / line.span
            if same and _soon(track) >= LOYALTY * _soon(best):
                return track
        return best

    def _refine(self, track: Track) -> None:
        """Take the frequency from the longest stretch in which the line is steady, once a window."""
        if track.refined is not None and track.since < self._window_blocks:
            return
        track.since, track.refined = 0, None
        shortest, longest = STRETCH * self._config.window, (track.seen - 1) * self._config.block
        if longest < 2.0 * shortest:
            return
        line, slow = track.line, self._slow
        found = settled(slow.last(longest), line.frequency_hz - slow.centre_hz, shortest, slow.rate)
        if found is not None and abs(slow.centre_hz + found[0] - line.frequency_hz) <= UNCERTAINTY / line.span:
            track.refined = replace(line, frequency_hz=slow.centre_hz + found[0], span=found[1])

    def lines(self) -> tuple[ChatterLine, ...]:
        """Return the lines to report, the strongest first."""
        return tuple(
            ChatterLine(
                frequency_hz=track.best.frequency_hz,
                amplitude=track.line.amplitude,
                growth=track.line.growth,
                kind=track.kind,
                confidence=line_confidence(
                    self._memory.explained, track.seen, told_apart=self._kinds.resolves(track.best.span),
                    doubtful=self._kinds.doubtful,
                ),
            )
            for track in self._memory.tracks
            if track.seen >= SEEN or track is self._memory.main
        )  # fmt: skip

    def tells_kinds(self) -> bool:
        """Return whether the main line can be told from the harmonics of the tools."""
        main = self._memory.main
        return main is not None and self._kinds.resolves(main.best.span)
