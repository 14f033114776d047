"""Which lines of a spectrum repeat with the spindle, and which stand for themselves.

Forced vibration is periodic: all its lines are multiples of one fundamental. Chatter has a frequency of its own, its
harmonics, and sidebands at the distance of tooth passing; those are multiples of tooth passing plus or minus multiples
of the chatter. Which of the two explains the lines better is a question of counting: how many of the places that it
foresees hold a line, against how many would by chance.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from chatter.lines import Lines

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

PRECISION, WANDER = 0.35, 3e-4
"""How far a harmonic may lie from its place: bins, for the interpolation, and a part of its frequency, for the speed."""
LEAST_SPREAD = 0.1
"""Misfit of lines over their slack (rms) below which they cannot fit any better."""
LEAST = 9.0
"""Evidence for a comb (log likelihood ratio): 1 in 8000 by chance."""
SPEED_RANGE, SPEED_SPREAD = 0.015, 0.004
"""Most that the lines may correct a stated speed by, and what stated speeds err by (rms)."""
CEILINGS_HZ = (300.0, 600.0, 1200.0, 2500.0, np.inf)
"""A comb is judged up to each of these: where its harmonics have died out, empty places say nothing."""
LEAST_DAMPING = 0.005
"""No structure that is cut with is damped less; its resonance can lift one harmonic over its neighbours only so far."""
UNEVEN = 2.0
"""Ratio of amplitudes that neighbours in a force may have."""
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


@dataclass(frozen=True, slots=True, kw_only=True)
class Base:
    """A fundamental that lines were found to be multiples of, or sidebands at a distance of.

    Parameters
    ----------
    fundamental_hz : float
        Fundamental (Hz).
    evidence : float
        Log likelihood ratio against chance.
    source : str
        ``stated`` speed, ``comb`` of forced lines, or ``sidebands`` of a free line.
    """

    fundamental_hz: float
    evidence: float
    source: Literal["stated", "comb", "sidebands"]


def tolerance(frequency_hz: Floats, spacing_hz: float) -> Floats:
    """Return how far harmonics may lie from their places (Hz), shape (n,).

    Parameters
    ----------
    frequency_hz : ndarray, shape (n,)
        Frequencies (Hz).
    spacing_hz : float
        Distance of the bins (Hz).
    """
    return np.asarray(PRECISION * spacing_hz + WANDER * frequency_hz, dtype=np.float64)


def evidence(fits: Flags, misfit: Floats, places: Floats, chance: float) -> Floats:
    """Return the log likelihood ratio of so many of so many places filled, and filled so exactly, shape (m,).

    One line is spent on the fundamental. Lines that hit a place by chance lie anywhere within their slack; those that
    belong there lie closer, as close as all of them together show.

    Parameters
    ----------
    fits : ndarray, shape (m, n)
        Which lines lie in a place.
    misfit : ndarray, shape (m, n)
        How far from its middle, over the slack.
    places : ndarray, shape (m,)
        Places that could hold a line.
    chance : float
        Probability that a place holds a line by chance.
    """
    count = fits.sum(axis=1)
    matched = np.minimum(count, places)
    p = min(max(chance, 1e-6), 0.9)
    q = np.clip(matched / np.maximum(places, 1.0), 1e-9, 1.0 - 1e-9)
    ratio = matched * np.log(q / p) + (places - matched) * np.log((1.0 - q) / (1.0 - p)) + np.log(p)
    spread = np.where(fits, misfit**2, 0.0).sum(axis=1) / np.maximum(count - 1, 1)
    spread = np.maximum(spread, LEAST_SPREAD**2)
    exact = (matched - 1.0) * (np.log(2.0) - 0.5 * np.log(2.0 * np.pi * np.e * spread)) - 1.0
    return np.where((q > p) & (matched >= 2.0), ratio + np.maximum(exact, 0.0), -1.0)


def refined(fundamental_hz: Floats, frequency_hz: Floats, slack_hz: Floats) -> Floats:
    """Return fundamentals fitted to the lines near their multiples, low orders first, shape (m,).

    Parameters
    ----------
    fundamental_hz : ndarray, shape (m,)
        Where to start (Hz).
    frequency_hz : ndarray, shape (n,)
        Lines (Hz).
    slack_hz : ndarray, shape (n,)
        How far they may lie from a multiple (Hz).
    """
    weight = 1.0 / slack_hz**2
    for most in (6.0, 20.0, 60.0, np.inf):
        order = np.round(frequency_hz / fundamental_hz[:, None])
        near = np.abs(frequency_hz - order * fundamental_hz[:, None]) <= slack_hz
        order = np.where(near & (order <= most), order, 0.0)
        square = order**2 @ weight
        fitted = (order @ (weight * frequency_hz)) / np.where(square > 0.0, square, 1.0)
        fundamental_hz = np.where(square > 0.0, fitted, fundamental_hz)
    return fundamental_hz


def on_comb(frequency_hz: Floats, fundamental_hz: float, slack_hz: Floats) -> Flags:
    """Return which lines are multiples of a fundamental, shape (n,).

    Parameters
    ----------
    frequency_hz : ndarray, shape (n,)
        Lines (Hz).
    fundamental_hz : float
        Fundamental (Hz).
    slack_hz : ndarray, shape (n,)
        How far they may lie from a multiple (Hz).
    """
    order = np.round(frequency_hz / fundamental_hz)
    return (np.abs(frequency_hz - order * fundamental_hz) <= slack_hz) & (order > 0)


class Question:
    """One line among others: does it belong to a comb of theirs, or do they stand beside it as sidebands?"""

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
            best[dense] = np.maximum(best[dense], self._near(fundamental_hz[dense], order[dense], fits[dense], misfit[dense]))
        luck = np.log(np.maximum(fundamental_hz / (2.0 * self.line_slack_hz), 1.0))  # that it hits the comb by chance
        return np.where(self.is_on(fundamental_hz) & (own >= 2) & (best > 0.0), best + luck, -1.0)

    def _near(self, fundamental_hz: Floats, order: Floats, fits: Flags, misfit: Floats) -> Floats:
        """Return the evidence for dense combs of which a mode lifts a few lines: low ones, and those near the line."""
        best = np.full(len(fundamental_hz), -1.0)
        away = np.abs(order - np.round(self.line_hz / fundamental_hz)[:, None])
        highest, used, chance = self.ranges[-1]
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


def stands_alone(lines: Lines, line: int, fundamental_hz: float, tools: int | None) -> bool:
    """Return whether a line stands out of its neighbours in a comb by more than any mode could lift it.

    The gain of a mode falls from its peak by sqrt(1 + (d / (damping f))^2) over a distance d. In a comb of the spindle
    most of which is tooth passing, a line of run-out is compared with what stands between its own sidebands.

    Parameters
    ----------
    lines : Lines
        Lines.
    line : int
        Index of the line.
    fundamental_hz : float
        Fundamental of the comb (Hz).
    tools : int or None
        Cutting edges that pass per revolution, when the comb is that of the spindle.
    """
    frequency, power = lines.frequency_hz, lines.power
    slack = tolerance(frequency, lines.spacing_hz)
    order, own = np.round(frequency / fundamental_hz), round(float(frequency[line]) / fundamental_hz)
    on = on_comb(frequency, fundamental_hz, 2.0 * slack)
    stride = tools or _stride(order, own, on, power)
    runout = stride > 1 and own % stride != 0
    for step in range(1, 9):
        if runout and step % stride == 0:
            continue
        drop = UNEVEN * np.hypot(1.0, step * fundamental_hz / (LEAST_DAMPING * frequency[line]))
        beside = on & (np.abs(order - own) == step)
        if power[line] <= drop**2 * max(float(power[beside].max(initial=0.0)), float(lines.floor[line])):
            return False
    return True


def _stride(order: Floats, own: int, on: Flags, power: Floats) -> int:
    """Return how many teeth the comb has, when most of it apart from the line's own kin is tooth passing."""
    for teeth in range(8, 1, -1):
        others = on & ((order - own) % teeth != 0)
        if (
            own % teeth
            and others.sum() >= 3
            and power[others & (order % teeth == 0)].sum() >= 0.8 * power[others].sum()
        ):
            return teeth
    return 1


def stated(lines: Lines, spindle_hz: float) -> Base:
    """Return the comb of a stated speed, corrected by the lines where they tell.

    Parameters
    ----------
    lines : Lines
        Lines.
    spindle_hz : float
        Stated speed (Hz).
    """
    slack = tolerance(lines.frequency_hz, lines.spacing_hz)
    tried = spindle_hz * (1.0 + SPEED_RANGE * np.linspace(-1.0, 1.0, 151))
    tried = refined(tried, lines.frequency_hz, slack)
    tried = tried[np.abs(tried / spindle_hz - 1.0) <= 1.2 * SPEED_RANGE]
    best, most = spindle_hz, -1.0
    if len(lines.frequency_hz) and tried.size:
        found = comb_evidence(tried, lines.frequency_hz, slack)
        far = 0.5 * ((tried / spindle_hz - 1.0) / SPEED_SPREAD) ** 2
        k = int(np.argmax(found - far))
        best, most = float(tried[k]), float(found[k])
    return Base(fundamental_hz=best if most >= LEAST else spindle_hz, evidence=most, source="stated")


def comb_evidence(fundamental_hz: Floats, frequency_hz: Floats, slack_hz: Floats) -> Floats:
    """Return the evidence for combs among all lines, shape (m,).

    Parameters
    ----------
    fundamental_hz : ndarray, shape (m,)
        Fundamentals (Hz).
    frequency_hz : ndarray, shape (n,)
        Lines (Hz), n > 0.
    slack_hz : ndarray, shape (n,)
        How far they may lie from a multiple (Hz).
    """
    column = fundamental_hz[:, None]
    order = np.round(frequency_hz / column)
    misfit = np.abs(frequency_hz - order * column) / slack_hz
    fits = (misfit <= 1.0) & (order > 0)
    best = np.full(len(fundamental_hz), -1.0)
    for ceiling in CEILINGS_HZ:
        used = frequency_hz <= ceiling
        if used.sum() < 3:
            continue
        highest = float(frequency_hz[used].max())
        places = np.floor(highest / fundamental_hz + 0.1)
        chance = 2.0 * float(slack_hz[used].mean()) * int(used.sum()) / highest
        best = np.maximum(best, evidence(fits & used, misfit, places, chance))
    return best
