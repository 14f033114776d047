"""Limits learned from what was seen while nothing chattered, for a stated rate of false alarms."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.special import betaincinv


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
    power: NDArray[np.float64] = field(init=False)
    square: float = 0.0
    fourth: float = 0.0

    def __post_init__(self) -> None:
        self.power = np.zeros(self.bins)

    def learn(self, power: NDArray[np.float64], square: float, windows: float) -> None:
        """Take a spectrum and a mean square in.

        Parameters
        ----------
        power : ndarray, shape (bins,)
            Squared amplitude of every bin.
        square : float
            Mean square of the band.
        windows : float
            Independent windows that this is worth.
        """
        self.windows = min(self.windows + windows, self.most)
        share = windows / max(self.windows, windows)
        self.power += share * (power - self.power)
        self.square += share * (square - self.square)
        self.fourth += share * (square * square - self.fourth)

    def forget(self) -> None:
        """Start anew."""
        self.windows = self.square = self.fourth = 0.0
        self.power[:] = 0.0

    def line_factor(self, probability: float) -> float:
        """Return the ratio of a bin to its mean that noise exceeds with a given probability.

        Parameters
        ----------
        probability : float
            Probability of the excess.
        """
        return ratio_limit(2.0, 2.0 * self.windows, probability)

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
