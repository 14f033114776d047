"""Limits learned from what was seen while nothing chattered, for a stated rate of false alarms."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.special import betaincinv

from chatter.estimate import LimitSource, MonitorConfig

Floats = NDArray[np.float64]

TINY = float(np.finfo(np.float64).tiny)
LINE_MEMORY = 0.2
"""Time (s) that counts as one independent sight of a line in the cut: near its limit of stability, at a decay of 5 1/s,
the power of a line that the noise drives is correlated for so long."""
QUARTILE = 0.25
"""Part of the bins that hold no line in any cut: their level is that of its noise."""
OVER_FLOOR = 7.0
"""Amplitude over the noise of the cut that the strongest line of a stable cut stays below: at a decay of 5 1/s it
reaches 4.2 times the noise in 12 s, and 7.5 times where the cut is no longer stable."""
UNTOLD = 1.7
"""Factor on that when nobody says at which amplitude vibration matters."""
FLOOR_RISE, FLOOR_FALL = 0.2, 0.03
"""Time constants of the noise of the present cut (s): the blow of the entry is soon forgotten, a line that grows is
slow to count for noise."""


def ratio_limit(freedom: float, learned_freedom: float, probability: float) -> float:
    """Return what the ratio of a mean square to a learned one exceeds with a given probability: a quantile of F.

    Parameters
    ----------
    freedom : float
        Degrees of freedom of the momentary value (2 for a bin of a spectrum, whose power is exponential).
    learned_freedom : float
        Degrees of freedom of the learned mean.
    probability : float
        Probability of the excess in stationary Gaussian noise.
    """
    if freedom == 2.0:  # closed form, and exact for the small probabilities that matter
        half = 0.5 * learned_freedom
        return float(half * np.expm1(-np.log(probability) / half))
    share = float(betaincinv(0.5 * learned_freedom, 0.5 * freedom, probability))
    return learned_freedom * (1.0 - share) / (freedom * share)


def noise_between(power: Floats) -> float:
    """Return the mean power of a bin that holds noise alone, from the quartile of all: exponential, -ln(3/4) means.

    Parameters
    ----------
    power : ndarray, shape (bins,)
        Squared amplitude of every bin.
    """
    place = int(QUARTILE * len(power))
    return float(np.partition(power, place)[place]) / -float(np.log1p(-QUARTILE))


@dataclass(slots=True)
class LearnedLevel:
    """Mean power of every bin and mean square of the band, with the number of independent windows behind them.

    Parameters
    ----------
    bins : int
        Bins of the spectrum.
    most : float
        Independent windows that the memory holds at most.
    """

    bins: int
    most: float
    windows: float = 0.0
    power: Floats = field(init=False)
    square: float = 0.0
    fourth: float = 0.0
    blocks: int = 0

    def __post_init__(self) -> None:
        self.power = np.zeros(self.bins)

    def learn(self, power: Floats, square: float, windows: float, trusted: float = np.inf) -> None:
        """Take a spectrum and a mean square in.

        Parameters
        ----------
        power : ndarray, shape (bins,)
            Squared amplitude of every bin.
        square : float
            Mean square of the band.
        windows : float
            Independent windows that this is worth.
        trusted : float
            Windows from which on the level only follows slow changes: what grows is not to be taken for usual.
        """
        self.blocks += 1
        share = windows / max(self.windows + windows, windows)
        if self.windows >= trusted:
            share = min(share, windows / self.most)
            scatter = (1.0 - share) ** 2 / self.windows + share**2 / windows
            self.windows = min(1.0 / scatter, self.most)
        else:
            self.windows = min(self.windows + windows, self.most)
            share = windows / max(self.windows, windows)
        self.power += share * (power - self.power)
        self.square += share * (square - self.square)
        self.fourth += share * (square * square - self.fourth)

    def forget(self) -> None:
        """Start anew."""
        self.windows = self.square = self.fourth = 0.0
        self.blocks = 0
        self.power[:] = 0.0

    def ready(self, window: float, time: float) -> bool:
        """Return whether enough was learned.

        Parameters
        ----------
        window : float
            Length of a window (s).
        time : float
            Time that must have been learned from (s).
        """
        return self.windows * window >= time * (1.0 - 1e-9)

    def line_factor(self, probability: float, each: float = 1.0) -> float:
        """Return the ratio of a bin to its mean that noise exceeds with a given probability.

        Parameters
        ----------
        probability : float
            Probability of the excess.
        each : float
            Windows that count as one independent sight of a line.
        """
        return ratio_limit(2.0, 2.0 * self.windows / each, probability)

    def square_factor(self, freedom: float, probability: float, scatters: bool = True) -> float:
        """Return the ratio of the mean square to its mean that noise exceeds with a given probability.

        Parameters
        ----------
        freedom : float
            Degrees of freedom of one window of white noise; what was seen to scatter more counts for less
            (Satterthwaite: twice the squared mean over the variance).
        probability : float
            Probability of the excess.
        scatters : bool
            Whether to count what was seen to scatter more.
        """
        scatter = self.fourth - self.square * self.square
        if scatters and scatter > 0.0:
            freedom = min(freedom, max(2.0 * self.square * self.square / scatter, 2.0))
        return ratio_limit(freedom, freedom * self.windows, probability)


@dataclass(frozen=True, slots=True, kw_only=True)
class Limit:
    """Squared limits in force.

    Parameters
    ----------
    line : ndarray, shape (bins,)
        Of the squared amplitude in every bin.
    square : float
        Of the mean square of the band.
    source : str
        Where they come from.
    """

    line: Floats
    square: float
    source: LimitSource


class Limits:
    """Limits of a narrow band: learned in air, from the noise of the present cut, and in quiet cutting.

    Until quiet cutting has been learned, the limit in the cut is the expected one, or what the strongest line of a
    stable cut stays below over the noise that this cut shows, whichever is higher. What was learned replaces the
    noise as soon as it says more; the expected limit stays the least, because below it vibration does not matter.

    Parameters
    ----------
    config : MonitorConfig
        Parameters.
    bins : int
        Bins of the spectrum.
    freedom : float
        Degrees of freedom of the mean square of one window of Gaussian noise.
    """

    def __init__(self, config: MonitorConfig, bins: int, freedom: float) -> None:
        self._config, self._freedom = config, freedom
        self._square_probability = min(config.window / config.false_alarm_interval, 0.1)
        self._each = max(LINE_MEMORY / config.window, 1.0)
        most = config.memory_time / config.window
        self.air, self.cut = LearnedLevel(bins, most), LearnedLevel(bins, most)
        self._floor = 0.0
        self._window_blocks = max(round(config.window / config.block), 1)
        self._factors: dict[str, tuple[int, float]] = {}
        self._in_air: tuple[tuple[int, float], Floats, float] = ((-1, 0.0), self.air.power, 0.0)

    def enter(self) -> None:
        """Forget the noise of the present cut, as one begins or ends; what earlier cuts taught stays."""
        self._floor = 0.0

    def unlearn(self) -> None:
        """Forget what cuts have taught: it was no quiet cut, or the next is another one."""
        self.cut.forget()
        self._factors.pop("cut", None)

    def learn(self, power: Floats, square: float, in_cut: bool | None) -> None:
        """Take a block in as background.

        Parameters
        ----------
        power : ndarray, shape (bins,)
            Squared amplitude of every bin.
        square : float
            Mean square of the band.
        in_cut : bool or None
            Whether the tools cut; None when nobody knows.
        """
        config = self._config
        level, time = (self.cut, config.cutting_time) if in_cut else (self.air, config.air_time)
        level.learn(power, square, config.block / config.window, time / config.window)

    def hear(self, power: Floats, lines: bool) -> None:
        """Follow the noise of the present cut between its lines.

        Parameters
        ----------
        power : ndarray, shape (bins,)
            Squared amplitude of every bin.
        lines : bool
            Lines explain the signal; the noise is not more than what they leave.
        """
        level = noise_between(power)
        if lines and level > self._floor > 0.0:
            return
        time = FLOOR_RISE if level > self._floor else FLOOR_FALL
        share = min(self._config.block / time, 1.0) if self._floor > 0.0 else 1.0
        self._floor += share * (level - self._floor)

    def now(self, in_cut: bool | None) -> Limit:
        """Return the limits in force.

        Parameters
        ----------
        in_cut : bool or None
            Whether the tools cut; None when nobody knows.
        """
        config = self._config
        line, square = np.full(self.air.bins, TINY), TINY
        source: LimitSource = "none"
        if self.air.ready(config.window, config.air_time):
            line, square = self._of_air()
            source = "reference" if in_cut is None else "air"
        if in_cut:
            line, square, source = self._in_cut(line, square)
        factor = config.limit_factor
        return Limit(line=factor * line, square=factor * square, source=source)

    def _of_air(self) -> tuple[Floats, float]:
        """Return the limits in air; they stay as they are while the tools cut."""
        state = self.air.blocks, self.air.square
        if self._in_air[0] != state:
            self._in_air = state, *self._of("air", self.air, 1.0)
        return self._in_air[1:]

    def _of(self, name: str, level: LearnedLevel, each: float) -> tuple[Floats, float]:
        """Return the limits that follow from a level; the quantiles, which change slowly, are kept for a window."""
        since, factor = self._factors.get(name, (-1, 0.0))
        now = level.blocks // self._window_blocks
        if now != since:
            factor = level.square_factor(self._freedom, self._square_probability)
            self._factors[name] = now, factor
        line = level.power * level.line_factor(self._config.line_probability, each)
        return np.maximum(line, TINY), max(level.square * factor, TINY)

    def _in_cut(self, line: Floats, square: float) -> tuple[Floats, float, LimitSource]:
        """Return the limits in the cut, given those of the air."""
        config = self._config
        expected = (config.expected_limit or 0.0) ** 2
        noise = self._floor * (OVER_FLOOR if expected else UNTOLD * OVER_FLOOR) ** 2
        told = max(expected, noise)
        source: LimitSource = "none" if told == 0.0 else "floor" if noise > expected else "configured"
        known = self.cut.ready(config.window, config.cutting_time)
        if known:
            learned, learned_square = self._of("cut", self.cut, self._each)
            certain = -np.log(config.line_probability) * self.cut.power
            learned = np.minimum(learned, np.maximum(told, certain))  # few sights of a line make a poor limit
            source = "cutting"
            least = np.maximum(learned, expected)
            return np.maximum(line, least), max(square, learned_square, 0.5 * expected), source
        return np.maximum(line, told), max(square, 0.5 * told), source
