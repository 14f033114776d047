"""What the monitor is told and what it answers: parameters and the estimate of one block."""

from dataclasses import dataclass
from math import isfinite
from typing import Literal

State = Literal["learning", "idle", "quiet", "suspect", "chatter", "gap", "invalid"]
LimitSource = Literal["none", "air", "configured", "cutting", "reference", "spectrum"]
Kind = Literal["regenerative", "forced"]


@dataclass(frozen=True, slots=True, kw_only=True)
class MonitorConfig:
    """Parameters of a `ChatterMonitor`.

    Parameters
    ----------
    band_hz : (float, float)
        Band in which chatter is looked for (Hz).
    block : float
        Length of a block of the grid (s); one estimate for each.
    window : float
        Length of the window of detection (s).
    refine_window : float
        Longest window over which the frequency is refined (s).
    air_time : float
        Time in air from which limits are learned before they are trusted (s).
    cutting_time : float
        Time of quiet cutting from which limits are learned before they are trusted (s).
    memory_time : float
        Time constant with which learned levels follow slow changes (s).
    false_alarm_interval : float
        Mean time between two excursions of one indicator over its limit in stationary Gaussian noise (s).
    hysteresis : float
        Fraction of a limit (amplitude) below which an alarm ends.
    confirm : int
        Consecutive agreeing frequency estimates before an alarm is given.
    expected_limit : float or None
        Line amplitude, root sum of squares over the channels, at which vibration matters (unit of the signal);
        the least limit in the cut until quiet cutting has been learned. A belief: +-30 % does no harm.
    tools : int
        Cutting edges that pass per revolution.
    speed_uncertainty : float
        Relative uncertainty of the spindle speed.
    dominance : float or None
        For a wide band: least part of the energy of all lines that the strongest must hold, and hold for three
        windows, to be called chatter, whatever the limits say. None: the band is the neighbourhood of one mode.
    """

    band_hz: tuple[float, float]
    block: float = 0.01
    window: float = 0.05
    refine_window: float = 1.0
    air_time: float = 0.5
    cutting_time: float = 1.0
    memory_time: float = 10.0
    false_alarm_interval: float = 3.6e5
    hysteresis: float = 0.7
    confirm: int = 2
    expected_limit: float | None = None
    tools: int = 1
    speed_uncertainty: float = 0.002
    dominance: float | None = None

    def __post_init__(self) -> None:
        low, high = self.band_hz
        if not (isfinite(low) and isfinite(high) and 0.0 < low < high):
            raise ValueError(f"band_hz must be (low, high) with 0 < low < high, got {self.band_hz}")
        for name in ("block", "window", "refine_window", "air_time", "cutting_time", "memory_time",
                     "false_alarm_interval"):  # fmt: skip
            value = getattr(self, name)
            if not (isfinite(value) and value > 0.0):
                raise ValueError(f"{name} must be positive, got {value}")
        if not 0.0 < self.hysteresis <= 1.0:
            raise ValueError(f"hysteresis must be in (0, 1], got {self.hysteresis}")
        if self.confirm < 1:
            raise ValueError(f"confirm must be at least 1, got {self.confirm}")
        if self.expected_limit is not None and not (isfinite(self.expected_limit) and self.expected_limit > 0.0):
            raise ValueError(f"expected_limit must be positive or None, got {self.expected_limit}")
        if self.tools < 1:
            raise ValueError(f"tools must be at least 1, got {self.tools}")
        if not 0.0 <= self.speed_uncertainty < 0.5:
            raise ValueError(f"speed_uncertainty must be in [0, 0.5), got {self.speed_uncertainty}")
        if self.dominance is not None and not 0.0 < self.dominance < 1.0:
            raise ValueError(f"dominance must be in (0, 1) or None, got {self.dominance}")
        if self.window < 2.0 * self.block or self.refine_window < 2.0 * self.window:
            raise ValueError(
                f"window must be from 2 block to refine_window / 2, got {self.window}"
                f" (block {self.block}, refine_window {self.refine_window})"
            )
        if (high - low) * self.window < 4.0:
            raise ValueError(f"band_hz must be at least 4 / window wide ({4.0 / self.window} Hz), got {self.band_hz}")


@dataclass(frozen=True, slots=True, kw_only=True)
class ChatterEstimate:
    """What the monitor knows after one block of the grid.

    Parameters
    ----------
    first_sample : int
        Index of the first sample of the block.
    samples : int
        Samples in the block.
    state : str
        ``learning`` no limit yet; ``idle`` out of the cut; ``quiet``; ``suspect`` one indicator alone, or both and
        not confirmed; ``chatter``; ``gap`` samples were lost just before, windows start anew; ``invalid`` the block
        holds a value that is not finite, windows start anew.
    indicator, limit : float
        Root mean square of the signal in the band over the window, over all channels, and its limit (0: none yet).
    line, line_limit : float
        Amplitude of the strongest line in the spectrum of the window, and its limit at that frequency (0: none yet).
    limit_source : str
        Where the limits in force come from: ``air``, ``configured`` or ``cutting``; ``reference`` signal known or
        assumed to hold no chatter; ``spectrum`` the lines that stand out of the present spectrum.
    raised : bool
        Both indicators are over their limits.
    share : float
        Part of the energy of all lines that the strongest holds, 0...1; 0 in a narrow band.
    frequency_hz : float or None
        Refined frequency of the strongest line (Hz), when that line is above its limit.
    amplitude : float
        Amplitude of that line at the end of the block, as refined; 0 without a frequency.
    growth : float
        Its growth rate (1/s); 0 without a frequency.
    kind : str or None
        ``forced`` when the line is a harmonic of the spindle, ``regenerative`` otherwise; None without a frequency.
    confidence : float
        Share of the signal near the line that steady, growing or decaying lines explain, 0...1; 0 without a frequency.
    span : float
        Length of signal that the frequency was taken from (s); 0 without a frequency.
    gap : int
        Samples lost since the block before.
    late : int
        Samples that came a second time or too late, ignored.
    moving : bool
        A turret was moving during the block.
    """

    first_sample: int
    samples: int
    state: State
    indicator: float = 0.0
    limit: float = 0.0
    line: float = 0.0
    line_limit: float = 0.0
    limit_source: LimitSource = "none"
    raised: bool = False
    share: float = 0.0
    frequency_hz: float | None = None
    amplitude: float = 0.0
    growth: float = 0.0
    kind: Kind | None = None
    confidence: float = 0.0
    span: float = 0.0
    gap: int = 0
    late: int = 0
    moving: bool = False
