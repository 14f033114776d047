"""What the monitor is told and what it answers: parameters and the estimate of one block."""

from dataclasses import dataclass
from math import isfinite
from typing import Literal

State = Literal["learning", "idle", "quiet", "suspect", "chatter", "gap", "invalid"]
LimitSource = Literal["none", "air", "floor", "configured", "cutting", "reference", "spectrum"]
Kind = Literal["regenerative", "forced", "background", "encoder"]
Note = Literal[
    "speed_unknown", "speed_contradicted", "cut_unknown", "cut_inferred", "clipped", "constant", "repeated",
    "duplicated",
]  # fmt: skip

STEP_DB = 3.0
"""What one step of `sensitivity` takes off every limit (dB)."""
MOST_STEPS = 3.0
MARGIN_DB = 3.0
"""What every limit is above what noise and belief say, at sensitivity 0 (dB): servo drives are not Gaussian."""


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
    sensitivity : float
        Steps of 3 dB by which every limit is lowered (above 0) or raised (below 0), -3...3; 0 is the default setting.
    hysteresis : float
        Fraction of a limit (amplitude) below which an alarm ends.
    confirm : int
        Consecutive blocks in which a line must be seen to grow before an alarm is given.
    expected_limit : float or None
        Line amplitude, root sum of squares over the channels, at which vibration matters (unit of the signal);
        the least limit in the cut. A belief: +-30 % does no harm. None: the noise of the cut alone sets the limit.
    tools : int
        Cutting edges that pass per revolution.
    speed_uncertainty : float
        Relative uncertainty of the spindle speed.
    hum_hz : float or None
        Mains frequency whose multiples are in the signal at all times (Hz).
    """

    band_hz: tuple[float, float]
    block: float = 0.01
    window: float = 0.05
    refine_window: float = 1.0
    air_time: float = 0.5
    cutting_time: float = 1.0
    memory_time: float = 10.0
    false_alarm_interval: float = 3.6e5
    sensitivity: float = 0.0
    hysteresis: float = 0.7
    confirm: int = 3
    expected_limit: float | None = None
    tools: int = 1
    speed_uncertainty: float = 0.002
    hum_hz: float | None = None

    def __post_init__(self) -> None:
        low, high = self.band_hz
        if not (isfinite(low) and isfinite(high) and 0.0 < low < high):
            raise ValueError(f"band_hz must be (low, high) with 0 < low < high, got {self.band_hz}")
        for name in ("block", "window", "refine_window", "air_time", "cutting_time", "memory_time",
                     "false_alarm_interval"):  # fmt: skip
            value = getattr(self, name)
            if not (isfinite(value) and value > 0.0):
                raise ValueError(f"{name} must be positive, got {value}")
        if not abs(self.sensitivity) <= MOST_STEPS:
            raise ValueError(f"sensitivity must be in [-3, 3], got {self.sensitivity}")
        if not 0.0 < self.hysteresis <= 1.0:
            raise ValueError(f"hysteresis must be in (0, 1], got {self.hysteresis}")
        if self.confirm < 1:
            raise ValueError(f"confirm must be at least 1, got {self.confirm}")
        for name in ("expected_limit", "hum_hz"):
            value = getattr(self, name)
            if value is not None and not (isfinite(value) and value > 0.0):
                raise ValueError(f"{name} must be positive or None, got {value}")
        if self.tools < 1:
            raise ValueError(f"tools must be at least 1, got {self.tools}")
        if not 0.0 <= self.speed_uncertainty < 0.5:
            raise ValueError(f"speed_uncertainty must be in [0, 0.5), got {self.speed_uncertainty}")
        if self.window < 2.0 * self.block or self.refine_window < 2.0 * self.window:
            raise ValueError(
                f"window must be from 2 block to refine_window / 2, got {self.window}"
                f" (block {self.block}, refine_window {self.refine_window})"
            )
        if (high - low) * self.window < 4.0:
            raise ValueError(f"band_hz must be at least 4 / window wide ({4.0 / self.window} Hz), got {self.band_hz}")

    @property
    def limit_factor(self) -> float:
        """Factor that margin and sensitivity put on every limit of power."""
        return 10.0 ** (0.1 * (MARGIN_DB - STEP_DB * self.sensitivity))

    @property
    def line_probability(self) -> float:
        """Probability that stationary Gaussian noise takes a bin over its limit without the margin in one window."""
        low, high = self.band_hz
        return min(1.0 / ((high - low) * self.false_alarm_interval), 0.1)

    @property
    def false_alarms_per_hour(self) -> float:
        """Rate at which stationary Gaussian noise takes a line over its learned limit (1/h); an alarm needs more.

        The power of a bin is exponential: a limit lower by a factor is passed with its probability to that power.
        """
        low, high = self.band_hz
        return 3600.0 * (high - low) * self.line_probability**self.limit_factor


@dataclass(frozen=True, slots=True, kw_only=True)
class ChatterLine:
    """One line of the present spectrum.

    Parameters
    ----------
    frequency_hz : float
        Refined frequency (Hz).
    amplitude : float
        Amplitude at the end of the block, root sum of squares over the channels.
    growth : float
        Growth rate (1/s).
    kind : str
        ``regenerative``; ``forced`` a harmonic of spindle or tools, folded at half the sampling rate or not;
        ``background`` there in air already, or mains hum; ``encoder`` an error of the encoder of a moving axis.
    confidence : float
        How sure line and kind are, 0...1; see `chatter.confidence`.
    """

    frequency_hz: float
    amplitude: float
    growth: float
    kind: Kind
    confidence: float


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
        cannot be judged (not finite, or the sensor stands still in the cut), windows start anew.
    indicator, limit : float
        Root mean square of the signal in the band over the window, over all channels, and its limit (0: none yet).
    line, line_limit : float
        Amplitude of the strongest line in the spectrum of the window, and its limit at that frequency (0: none yet).
    limit_source : str
        Where the limits in force come from: ``air``; ``floor`` the noise of the present cut; ``configured``;
        ``cutting``; ``reference`` signal known or assumed to hold no chatter; ``spectrum`` the lines that stand out of
        the present spectrum.
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
        Its kind, as in `ChatterLine`; None without a frequency.
    confidence : float
        How sure the verdict is, 0...1; see `chatter.confidence`.
    span : float
        Length of signal that the frequency was taken from (s); 0 without a frequency.
    lines : tuple of ChatterLine
        The lines near their limits, the strongest first; empty when nothing stands out.
    cutting : bool or None
        Whether the tools cut, as told or as inferred from the signal; None when nobody knows.
    comb_hz : float or None
        Fundamental of the harmonics in the signal (Hz) when they contradict the stated spindle speed.
    notes : tuple of str
        What a reader should know: ``speed_unknown``; ``speed_contradicted`` the signal has a comb that the stated
        speed does not explain; ``cut_unknown``, ``cut_inferred`` from the signal; ``clipped``; ``constant`` the sensor
        stands still; ``repeated`` the block is the one before once more; ``duplicated`` every value comes twice.
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
    lines: tuple[ChatterLine, ...] = ()
    cutting: bool | None = None
    comb_hz: float | None = None
    notes: tuple[Note, ...] = ()
    gap: int = 0
    late: int = 0
    moving: bool = False
