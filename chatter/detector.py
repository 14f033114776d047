"""Whether it chatters in the neighbourhood of one mode: learned limits, lines that grow or stand, their kinds."""

from copy import deepcopy
from dataclasses import dataclass
from math import ceil, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chatter.alarm import Alarm, Evidence
from chatter.confidence import Grounds, confidence
from chatter.estimate import MonitorConfig, State
from chatter.limits import Limit, Limits
from chatter.line_kinds import Scene
from chatter.line_set import COHERENT, LineSet

Floats = NDArray[np.float64]

LOOK = 0.5
"""Amplitude over a limit from which lines are looked at: the growth must be known when the limit is reached."""
UNCLEAR = 2.0
"""Time for which a line that stands out near its limit is not taken for usual: it may still grow (s)."""
YOUNG, EASED = 0.6, 2.0
"""Time since an entry (s) within which what growth must reach is by so much higher in power (3 dB), where cuts before
were quiet: the blow of the entry rings on, and with noise it looks like growth at the decay rate of the bar."""
SPEED_CHANGE = 0.01
"""Relative change of the spindle speed after which what was learned in the cut no longer holds."""


@dataclass(slots=True, kw_only=True)
class _Memory:
    """Everything that the detector remembers beside limits, lines and alarm."""

    in_cut: bool | None = None
    spindle_hz: float | None = None
    settled: int = 0
    """Blocks since windows were last disturbed: start, entry, exit, excursion, move, change of speed."""
    age: int = 0
    """Blocks since start, entry or exit."""
    newest: float = 0.0
    """Mean square of the block before."""
    stood: int = 0
    """Blocks in a row in which a line stood out without an alarm."""


class Detector:
    """One `step` for each block of the grid.

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
    channels : int
        Number of channels.
    """

    def __init__(
        self, config: MonitorConfig, frequencies_hz: Floats, freedom: float, sample_rate_hz: float, channels: int
    ) -> None:
        self._config, self._frequencies_hz, self._freedom = config, frequencies_hz, freedom
        self._window_blocks = ceil(config.window / config.block - 1e-9)
        self._lines = LineSet(config, sample_rate_hz, channels)
        self._alarm = Alarm(config)
        self.reset()

    def reset(self) -> None:
        """Forget everything, learned limits too."""
        self._limits = Limits(self._config, len(self._frequencies_hz), self._freedom)
        self._memory = _Memory()
        self._alarm.end()
        self._lines.restart()

    def restart(self) -> None:
        """Forget the momentary state after windows were emptied; learned limits stay."""
        self._memory = _Memory(spindle_hz=self._memory.spindle_hz)
        self._limits.enter()
        self._alarm.restart()
        self._lines.restart()

    def snapshot(self) -> Any:
        """Return a copy of the whole state."""
        return deepcopy(self._limits), deepcopy(self._memory), self._alarm.snapshot(), self._lines.snapshot()

    def restore(self, state: Any) -> None:
        """Continue from a copy of the state.

        Parameters
        ----------
        state : object
            What `snapshot` returned.
        """
        self._limits, self._memory = deepcopy(state[0]), deepcopy(state[1])
        self._alarm.restore(state[2])
        self._lines.restore(state[3])

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
        self._enter(scene)
        self._lines.hear(band)
        newest = float(np.einsum("ij,ij->", band, band)) / len(band)
        fresh, self._memory.newest = newest + self._memory.newest, newest  # squared amplitude over two blocks
        if scene.in_cut and self._memory.age > self._window_blocks:
            self._limits.hear(power, self._lines.explained >= COHERENT)
        limit = self._limits.now(scene.in_cut)
        if limit.source == "none":
            self._learn(power, square, scene.in_cut)
            return {"state": "learning", "indicator": sqrt(square), "line": sqrt(float(power.max()))}
        peak = int((power / limit.line).argmax())
        level = self._config.hysteresis**2 if self._alarm.on else 1.0
        over = int(power[peak] > level * limit.line[peak]) + int(square > level * limit.square)
        if scene.in_cut is False:
            self._alarm.end()
            self._lines.forget()
        else:
            self._judge(power, square, fresh, limit, over)
            self._memory.settled = 0 if over else self._memory.settled
        self._learn(power, square, scene.in_cut)
        return {
            "indicator": sqrt(square),
            "limit": sqrt(limit.square),
            "line": sqrt(float(power[peak])),
            "line_limit": sqrt(float(limit.line[peak])),
            "limit_source": limit.source,
            "raised": over == 2,
            **self._said(scene, over, limit, square / limit.square),
        }

    def _enter(self, scene: Scene) -> None:
        """Take in what is known about the block."""
        memory = self._memory
        changed = scene.in_cut is not memory.in_cut
        if scene.spindle_hz:
            before = memory.spindle_hz or scene.spindle_hz
            faster = abs(scene.spindle_hz - before) > SPEED_CHANGE * before
            if faster:
                self._limits.unlearn()
            memory.spindle_hz = scene.spindle_hz if faster else before
            memory.settled = 0 if faster else memory.settled
        if changed:
            self._limits.enter()
        memory.in_cut = scene.in_cut
        memory.settled = 0 if changed or scene.moving else memory.settled + 1
        memory.age = 1 if changed else memory.age + 1
        self._lines.enter(scene, memory.age * self._config.block)

    def _judge(self, power: Floats, square: float, fresh: float, limit: Limit, over: int) -> None:
        """Look at the lines where it is worth it, and raise or end the alarm."""
        lines, alarm, newest = self._lines, self._alarm, self._memory.newest
        least = LOOK**2
        near = fresh > least * limit.line.min() or square > least * limit.square or (power > least * limit.line).any()
        if near or alarm.on:
            lines.follow(age=self._memory.age * self._config.block, alarm=alarm.on)
        else:
            lines.forget()
        main = lines.main
        if main is None:
            alarm.step(Evidence(square=square, both=over == 2, level=fresh, newest=newest, age=self._memory.age))
            return
        young = limit.source == "cutting" and self._memory.age * self._config.block < YOUNG
        place = int(np.abs(self._frequencies_hz - main.line.frequency_hz).argmin())
        raised = alarm.step(
            Evidence(
                fresh=min(fresh * lines.share / float(limit.line[place]), 0.5 * fresh / limit.square),
                square=square,
                both=over == 2,
                regenerative=lines.regenerative,
                explained=lines.explained,
                growth=lines.growth,
                seen=lines.seen,
                level=fresh,
                newest=newest,
                age=self._memory.age,
                least=EASED if young else 1.0,
            )
        )
        if raised and limit.source != "cutting":
            self._limits.unlearn()  # the growth just before the alarm is in it

    def _learn(self, power: Floats, square: float, in_cut: bool | None) -> None:
        """Take the block in as background, unless the window holds a disturbance."""
        memory, lines = self._memory, self._lines
        stands = lines.regenerative and lines.explained >= COHERENT and not self._alarm.on
        memory.stood = memory.stood + 1 if stands else 0
        unclear = 0 < memory.stood * self._config.block < UNCLEAR
        if memory.settled > self._window_blocks and not self._alarm.begins and not unclear:
            self._limits.learn(power, square, in_cut)

    def _said(self, scene: Scene, over: int, limit: Limit, ratio: float) -> dict[str, Any]:
        """Return the verdict, its lines, and how sure it is."""
        state = self._state(scene.in_cut, over)
        lines, main = self._lines, self._lines.main
        grounds = Grounds(
            state=state,
            source=limit.source,
            ratio=ratio,
            explained=lines.explained,
            told_apart=lines.tells_kinds(),
            doubtful=scene.doubtful,
        )
        fields: dict[str, Any] = {"state": state, "confidence": confidence(grounds)}
        if main is not None and state in ("suspect", "chatter"):
            fields |= {
                "frequency_hz": main.best.frequency_hz,
                "span": main.best.span,
                "amplitude": main.line.amplitude,
                "growth": main.line.growth,
                "kind": main.kind,
                "lines": lines.lines(),
            }
        return fields

    def _state(self, in_cut: bool | None, over: int) -> State:
        if in_cut is False:
            return "idle"
        if self._alarm.on:
            return "chatter"
        return "suspect" if over or self._alarm.warns else "quiet"
