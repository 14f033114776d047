"""The whole spectrum once a second: tones of the air, and whether the harmonics fit the stated spindle speed."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from chatter.line_kinds import Scene, Tone
from chatter.peaks import floor_of, peaks

Floats = NDArray[np.float64]

SEGMENT = 1.0
"""Length of a look (s): lines to 0.2 Hz."""
LOWEST_HZ = 5.0
HIGHEST_SHARE = 0.45
"""Part of the sampling rate up to which lines are looked for."""
STANDS = 40.0
"""Power of a line over the noise around it (16 dB): one bin in 1e9 of noise."""
MOST_TONES = 16
FEWEST = 5
"""Lines that must belong to a comb for it to count: one falls onto it by chance in some of ten cases."""
FITS = 0.8
"""Part of the lines that a comb must explain; one that explains less than `MISSES` is contradicted."""
MISSES = 0.5
PRECISION_HZ = 0.3
"""Error of an interpolated frequency."""
STEADY = 0.002
"""Relative scatter of a spindle speed that counts as one speed."""
DIVISORS = 12
"""Orders at which the strongest lines can stand in their comb."""


@dataclass(slots=True)
class Surroundings:
    """Collects a second of samples in one state of the machine and looks at its lines.

    Parameters
    ----------
    sample_rate_hz : float
        Sampling rate (Hz).
    uncertainty : float
        Relative uncertainty of the spindle speed.
    """

    sample_rate_hz: float
    uncertainty: float
    tones: tuple[Tone, ...] = ()
    comb_hz: float | None = None
    blocks: list[Floats] = field(default_factory=list[Floats])
    held: int = 0
    told: tuple[bool | None, float] = (None, 0.0)

    def restart(self) -> None:
        """Forget the samples of the present second."""
        self.blocks, self.held = [], 0

    def look(self, block: Floats, scene: Scene) -> None:
        """Take a block in.

        Parameters
        ----------
        block : ndarray, shape (n, channels)
            Samples as they came.
        scene : Scene
            What is known beside them.
        """
        told, before = (scene.in_cut, scene.spindle_hz or 0.0), self.told
        faster = abs(told[1] - before[1]) > max(self.uncertainty, STEADY) * before[1]
        if told[0] is not before[0] or faster or scene.moving:
            self.restart()
            self.comb_hz = None if faster else self.comb_hz
            self.told = told
        self.blocks.append(block)
        self.held += len(block)
        if self.held < SEGMENT * self.sample_rate_hz:
            return
        lines = self._lines(np.concatenate(self.blocks))
        self.restart()
        if scene.in_cut is False:
            self.tones = lines[:MOST_TONES]
        elif scene.spindle_hz:
            new = [line.frequency_hz for line in lines if not self._is_tone(line.frequency_hz)]
            self.comb_hz = contradiction(new, scene.spindle_hz, self.uncertainty)

    def _is_tone(self, frequency_hz: float) -> bool:
        return any(abs(frequency_hz - tone.frequency_hz) <= 2.0 * PRECISION_HZ for tone in self.tones)

    def _lines(self, segment: Floats) -> tuple[Tone, ...]:
        """Return the lines of a segment, the strongest first."""
        count = len(segment)
        window = np.sin(np.pi * np.arange(count) / count) ** 2
        spectrum = np.fft.rfft((segment - segment.mean(axis=0)) * window[:, None], axis=0)
        power = (np.abs(spectrum) ** 2).sum(axis=1) * (4.0 / count) ** 2
        spacing = self.sample_rate_hz / count
        low, high = int(LOWEST_HZ / spacing), int(HIGHEST_SHARE * self.sample_rate_hz / spacing)
        band = power[low:high]
        found, away = peaks(band, np.maximum(floor_of(band) * STANDS, np.finfo(np.float64).tiny))
        order = np.argsort(-band[found])
        return tuple(
            Tone(frequency_hz=float((low + found[k] + away[k]) * spacing), amplitude=float(np.sqrt(band[found[k]])))
            for k in order
        )


def contradiction(lines_hz: list[float], spindle_hz: float, uncertainty: float) -> float | None:
    """Return the fundamental of a comb (Hz) that the lines belong to and the stated speed does not explain, or None.

    Parameters
    ----------
    lines_hz : list of float
        Lines, the strongest first (Hz).
    spindle_hz : float
        Stated spindle speed (Hz).
    uncertainty : float
        Its relative uncertainty.
    """
    lines = np.array(lines_hz[: 4 * FEWEST])
    if len(lines) < FEWEST or _explained(lines, spindle_hz, uncertainty) >= MISSES:
        return None
    candidates = np.unique(np.concatenate([lines[:FEWEST] / order for order in range(1, DIVISORS + 1)]))
    for base in candidates[candidates >= LOWEST_HZ][::-1]:
        multiple = np.round(lines / base)
        near = np.abs(lines - multiple * base) <= PRECISION_HZ * np.maximum(multiple, 1.0)
        if near.sum() < FEWEST:
            continue
        fitted = float((lines[near] * multiple[near]).sum() / (multiple[near] ** 2).sum())
        if _explained(lines, fitted, 0.0) >= FITS:
            return fitted
    return None


def _explained(lines: Floats, base: float, uncertainty: float) -> float:
    """Return which part of the lines are multiples of a frequency; 1 where its comb is too dense to tell."""
    width = PRECISION_HZ + uncertainty * lines
    told = width < base / 6.0
    if told.sum() < FEWEST:
        return 1.0 if uncertainty else 0.0
    return float((np.abs(lines - base * np.round(lines / base)) <= width)[told].mean())
