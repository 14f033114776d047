"""What makes a line: regeneration, the turning spindle, the machine in air, or the encoder of a moving axis."""

from collections import deque
from dataclasses import dataclass
from typing import Any

import numpy as np

from chatter.estimate import Kind, MonitorConfig
from chatter.spectrum import Line

UNCERTAINTY = 0.25
"""Part of the inverse of its stretch by which the frequency of a line may be wrong."""
ENTRY_TURNS = 3.0
"""Turns after the entry in which a harmonic of the tools may rise: the depth of cut builds up."""
ORDERS = 60
"""Harmonics of the tools that are strong enough to be seen where they fold."""
ENCODER_ORDERS = 4
"""Harmonics of an encoder's interpolation error: offset, gain and phase errors make two, the wave form more."""
TONE_RISE = 2.0
"""Amplitude over that in air up to which a line is still the tone that was there before the cut."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Tone:
    """A line that was there in air.

    Parameters
    ----------
    frequency_hz : float
        Frequency (Hz).
    amplitude : float
        Amplitude, root sum of squares over the channels.
    """

    frequency_hz: float
    amplitude: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Scene:
    """What is known about a block beside its samples.

    Parameters
    ----------
    in_cut : bool or None
        Whether the tools cut; None when nobody knows.
    spindle_hz : float or None
        Spindle speed, when known (Hz).
    moving : bool
        Whether a turret moves.
    encoder_hz : tuple of float
        Signal periods per second of every encoder of a moving axis (Hz).
    tones : tuple of Tone
        Lines that were there in air.
    doubtful : bool
        The signal contradicts the spindle speed.
    """

    in_cut: bool | None = None
    spindle_hz: float | None = None
    moving: bool = False
    encoder_hz: tuple[float, ...] = ()
    tones: tuple[Tone, ...] = ()
    doubtful: bool = False


class LineKinds:
    """Tells the kind of each line; remembers how spindle and encoders went during its stretch.

    Parameters
    ----------
    config : MonitorConfig
        Parameters.
    sample_rate_hz : float
        Sampling rate (Hz).
    blocks : int
        Blocks in a stretch.
    """

    def __init__(self, config: MonitorConfig, sample_rate_hz: float, blocks: int) -> None:
        self._config, self._sample_rate_hz = config, sample_rate_hz
        self._encoders: deque[tuple[float, ...]] = deque(maxlen=blocks)
        self._speeds: deque[float] = deque(maxlen=max(round(config.refine_window / config.block), 1))
        self._scene = Scene()
        self._age = 0.0

    def forget(self) -> None:
        """Forget where the errors of the encoders were, and how the spindle turned."""
        self._encoders.clear()
        self._speeds.clear()

    def snapshot(self) -> Any:
        """Return a copy of the whole state."""
        return list(self._encoders), list(self._speeds), self._scene, self._age

    def restore(self, state: Any) -> None:
        """Continue from a copy of the state.

        Parameters
        ----------
        state : object
            What `snapshot` returned.
        """
        encoders, speeds, self._scene, self._age = state
        self.forget()
        self._encoders.extend(encoders)
        self._speeds.extend(speeds)

    def enter(self, scene: Scene, age: float) -> None:
        """Take in what is known about a block.

        Parameters
        ----------
        scene : Scene
            What is known.
        age : float
            Time since the tools entered or the speed changed (s).
        """
        self._scene, self._age = scene, age
        self._encoders.append(scene.encoder_hz)
        self._speeds.append(scene.spindle_hz or 0.0)

    def tell(self, line: Line, best: Line | None = None) -> Kind:
        """Return the kind of a line.

        Parameters
        ----------
        line : Line
            The line as it is now.
        best : Line or None
            The same over a longer stretch.
        """
        best = best or line
        frequency, tolerance = best.frequency_hz, UNCERTAINTY / best.span
        if self._from_encoder(line.frequency_hz, UNCERTAINTY / line.span):
            return "encoder"
        if line.growth * line.span > 1.0:  # nothing but regeneration grows e-fold within the stretch ...
            return "forced" if self._enters() and self._is_forced(best, True) else "regenerative"
        if self._is_background(frequency, line.amplitude, tolerance):
            return "background"
        forced = self._is_forced(best, True) or self._is_forced(best, False)
        return "forced" if forced or self._is_folded(frequency, tolerance) else "regenerative"

    @property
    def doubtful(self) -> bool:
        """Whether the signal contradicts the stated spindle speed."""
        return self._scene.doubtful

    def _enters(self) -> bool:
        """Return whether the depth of cut still builds up: ... but for the harmonics of tools that enter."""
        speed = self._scene.spindle_hz
        return speed is not None and speed > 0.0 and self._age * speed < ENTRY_TURNS

    def resolves(self, span: float) -> bool:
        """Return whether a line of this stretch can be told from the harmonics of the tools.

        Parameters
        ----------
        span : float
            Length of the stretch (s).
        """
        speed, high = self._scene.spindle_hz, self._config.band_hz[1]
        if not speed or self._scene.doubtful:
            return False
        return self._config.speed_uncertainty * high + UNCERTAINTY / span < speed * self._config.tools / 6.0

    def _is_forced(self, line: Line, tools: bool) -> bool:
        """Return whether a line follows the tools, or else the spindle, through its stretch, if that can be told."""
        blocks = max(round(line.span / self._config.block), 1)
        speeds = [speed for speed in list(self._speeds)[-blocks:] if speed > 0.0]
        if not self._scene.spindle_hz or self._scene.doubtful or not speeds:
            return False
        slowest, fastest = min(speeds), max(speeds)
        spacing = sum(speeds) / len(speeds) * (self._config.tools if tools else 1)
        swept = 0.5 * (fastest - slowest) / fastest
        tolerance = UNCERTAINTY / line.span + (self._config.speed_uncertainty + swept) * line.frequency_hz
        return tolerance < spacing / 6.0 and _away(line.frequency_hz, spacing) <= tolerance

    def _is_folded(self, frequency_hz: float, tolerance: float) -> bool:
        """Return whether a frequency is where a harmonic of the tools above half of the sampling rate folds to."""
        speed, rate = self._scene.spindle_hz, self._sample_rate_hz
        if not speed or self._scene.doubtful:
            return False
        spacing = speed * self._config.tools
        order = np.arange(int(0.5 * rate / spacing) + 1, ORDERS + 1)
        width = tolerance + self._config.speed_uncertainty * order * spacing
        return bool(((np.abs(_folded(order * spacing, rate) - frequency_hz) <= width) & (width < spacing / 6.0)).any())

    def _is_background(self, frequency_hz: float, amplitude: float, tolerance: float) -> bool:
        """Return whether a line is a tone of the air, one of its harmonics, or mains hum."""
        hum = self._config.hum_hz
        if hum is not None and _away(frequency_hz, hum) <= tolerance < hum / 6.0:
            return True
        return any(
            amplitude <= TONE_RISE * tone.amplitude
            and frequency_hz > tone.frequency_hz - tolerance
            and _away(frequency_hz, tone.frequency_hz) <= tolerance < tone.frequency_hz / 6.0
            for tone in self._scene.tones
        )

    def _from_encoder(self, frequency_hz: float, tolerance: float) -> bool:
        """Return whether an encoder's error stood at a frequency throughout the stretch; one that sweeps is no line."""
        if len(self._encoders) < (self._encoders.maxlen or 1) or len({len(seen) for seen in self._encoders}) != 1:
            return False
        table = np.array(self._encoders)
        if not table.size:
            return False
        middle, spread = table.mean(axis=0), np.ptp(table, axis=0)
        order = np.arange(1, ENCODER_ORDERS + 1)[:, None]
        near = np.abs(order * middle - frequency_hz) <= tolerance
        return bool((near & (order * spread <= 2.0 * tolerance) & (middle > tolerance)).any())


def _away(frequency_hz: float, spacing: float) -> float:
    return abs(frequency_hz - spacing * round(frequency_hz / spacing))


def _folded(frequency_hz: Any, sample_rate_hz: float) -> Any:
    """Return where frequencies above half of the sampling rate are seen."""
    return np.abs(frequency_hz - sample_rate_hz * np.round(frequency_hz / sample_rate_hz))
