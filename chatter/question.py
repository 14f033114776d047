"""One line among others: whether it is a harmonic of a comb that they make, or they are its sidebands."""

import numpy as np
from numpy.typing import NDArray

from chatter.comb import CEILINGS_HZ, evidence, on_comb

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

LOW_ORDERS, LOW_LINES = 8, 2
"""Low orders of a comb, and lines that stand there, the line in question and its harmonics not counted."""
DENSE = 0.03
"""Fundamental over a line, below which its mode spans several lines of the comb."""
APART = 0.02
"""Part of the distance of its sidebands by which a line must miss their comb: less, and they are spindle modulation."""
SIDES, SIDE_ORDERS = 3, (1, 2, 5)
"""Harmonics of the chatter that may have sidebands, and how many of them to either side are judged."""
BESIDE = 3.0
"""Evidence that the sidebands must have by themselves, whatever stands on the comb of their distance."""


class Question:
    """Asks of one line among others whether it belongs to a comb of theirs, or they are its sidebands."""

    def __init__(self, frequency_hz: Floats, slack_hz: Floats, line: int) -> None:
        self.frequency_hz, self.slack_hz = frequency_hz, slack_hz
        self.line_hz, self.line_slack_hz = float(frequency_hz[line]), float(slack_hz[line])
        self.counted = ~on_comb(frequency_hz, self.line_hz, 1.5 * slack_hz)  # its own harmonics tell nothing
        self.ranges: list[tuple[float, Flags, float]] = []
        for ceiling in CEILINGS_HZ:
            below = frequency_hz <= ceiling
            used = self.counted & below
            if self.line_hz <= ceiling and used.any():
                highest = float(frequency_hz[below].max())
                chance = 2.0 * float(slack_hz[used].mean()) * int(used.sum()) / highest
                self.ranges.append((highest, used, chance))

    def is_on(self, fundamental_hz: Floats) -> Flags:
        """Return which combs the line is a multiple of."""
        order = np.round(self.line_hz / fundamental_hz)
        return (np.abs(self.line_hz - order * fundamental_hz) <= self.line_slack_hz) & (order >= 1)

    def is_rooted(self, fundamental_hz: Floats) -> Flags:
        """Return which combs have low harmonics, as every force has, other than those of the line."""
        column = fundamental_hz[:, None]
        order = np.round(self.frequency_hz / column)
        fits = (np.abs(self.frequency_hz - order * column) <= self.slack_hz) & (order > 0) & (order <= LOW_ORDERS)
        fits &= self.counted
        return fits.sum(axis=1) >= LOW_LINES

    def comb(self, fundamental_hz: Floats) -> Floats:
        """Return the evidence for combs that the line is a higher multiple of, its own harmonics not counted."""
        column = fundamental_hz[:, None]
        order = np.round(self.frequency_hz / column)
        misfit = np.abs(self.frequency_hz - order * column) / self.slack_hz
        fits = (misfit <= 1.0) & (order > 0)
        own = np.round(self.line_hz / fundamental_hz)
        best = np.full(len(fundamental_hz), -1.0)
        for highest, used, chance in self.ranges:
            places = np.floor(highest / fundamental_hz + 0.1)
            places -= np.floor(places / np.maximum(own, 1.0))
            best = np.maximum(best, evidence(fits & used, misfit, places, chance))
        dense = np.flatnonzero(self.is_on(fundamental_hz) & (fundamental_hz < DENSE * self.line_hz))
        if dense.size and self.ranges:
            near = self._near(fundamental_hz[dense], order[dense], fits[dense], misfit[dense])
            best[dense] = np.maximum(best[dense], near)
        luck = np.log(np.maximum(fundamental_hz / (2.0 * self.line_slack_hz), 1.0))  # that it hits the comb by chance
        return np.where(self.is_on(fundamental_hz) & (own >= 2) & (best > 0.0), best + luck, -1.0)

    def _near(self, fundamental_hz: Floats, order: Floats, fits: Flags, misfit: Floats) -> Floats:
        """Return the evidence for dense combs of which a mode lifts a few lines: low ones, and those near the line."""
        best = np.full(len(fundamental_hz), -1.0)
        away = np.abs(order - np.round(self.line_hz / fundamental_hz)[:, None])
        _, used, chance = self.ranges[-1]
        for low in (c for c in CEILINGS_HZ if c < self.line_hz):
            below = self.frequency_hz <= low
            few = np.floor(low / fundamental_hz)
            rooted = evidence(fits & used & below, misfit, few, chance) > BESIDE
            for orders in SIDE_ORDERS:
                places = few + 2.0 * orders
                found = evidence(fits & used & (below | (away <= orders)), misfit, places, chance)
                apart = low < self.line_hz - orders * fundamental_hz
                best = np.maximum(best, np.where(apart & rooted, found, -1.0))
        return best

    def sidebands(self, distance_hz: Floats) -> Floats:
        """Return the evidence for a comb of tooth passing with the line off it, and sidebands at its distance."""
        away = np.abs(self.line_hz / distance_hz - np.round(self.line_hz / distance_hz))
        off = (away * distance_hz > 2.0 * self.line_slack_hz) & (away > APART)
        first = np.abs(np.abs(self.frequency_hz - self.line_hz) - distance_hz[:, None]) <= self.slack_hz
        asked = np.flatnonzero(off & first.any(axis=1))
        best = np.full(len(distance_hz), -1.0)
        best[asked] = self._families(distance_hz[asked])
        return best

    def _families(self, distance_hz: Floats) -> Floats:
        """Return the evidence for sidebands of the line and its harmonics, and the comb of their distance."""
        column = distance_hz[:, None]
        misfit = np.abs(self.frequency_hz - np.round(self.frequency_hz / column) * column) / self.slack_hz
        zero = misfit <= 1.0
        reach = np.full(misfit.shape, np.inf)  # order of the sideband that a line is
        best = np.full(len(distance_hz), -1.0)
        for harmonic in range(1, SIDES + 1):
            rest = (self.frequency_hz - harmonic * self.line_hz) / column
            order = np.round(rest)
            miss = np.abs(rest - order) * column / (self.slack_hz + (harmonic - 1) * self.line_slack_hz)
            closer = (miss <= 1.0) & ~zero & (np.abs(order) < reach) & (order != 0)
            reach = np.where(closer, np.abs(order), reach)
            misfit = np.where(closer, miss, misfit)
            for highest, used, chance in {id(r): r for r in (self.ranges[:1] + self.ranges[-1:])}.values():
                if harmonic * self.line_hz > highest:
                    continue
                once = np.floor(highest / distance_hz + 0.1)
                for orders in SIDE_ORDERS:
                    places = np.minimum(2 * orders, once) * harmonic
                    beside = (reach <= orders) & used
                    alone = evidence(beside, misfit, places, chance)
                    both = evidence((zero & used) | beside, misfit, once + places, chance)
                    best = np.maximum(best, np.where(alone > BESIDE, both, -1.0))
        return best
