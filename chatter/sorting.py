"""Lines sorted into forced and free: the strongest first, by the comb or the sidebands that explain it better."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from chatter.comb import (
    FOLDS,
    LEAST,
    PRECISION,
    Base,
    Flags,
    Floats,
    comb_evidence,
    folded,
    on_comb,
    refined,
    stated,
    tolerance,
)
from chatter.lines import Lines
from chatter.question import SIDES, Question
from chatter.resonance import stands_alone

SPEED_ERROR = 0.002
"""Relative error of a stated speed that the lines do not correct."""
KNOWN, MARGIN = 6.0, 5.0
"""Evidence that a comb has from having been found in other stretches, and by which one that leaves the strongest line
out must surpass those that hold it."""
HIGHEST_ORDER, STRONGEST, MOST = 40, 10, 60
"""Orders tried for a line, lines that candidates are made of, and lines that are counted."""
MOST_TEETH, FASTEST = 12, 1.5
"""Teeth that pass per revolution, and frequency of their passing over that of the chatter, at most."""
ROOTLESS = 8.0
"""Evidence that a comb loses whose low harmonics are missing; with a stated speed it has none."""
LUCK = 0.05
"""Probability that chatter hits a harmonic of tooth passing by chance, below which one that hits it is taken for it."""
ROUNDS, COMBS = 12, 5
"""Lines looked at for themselves, and combs set aside for each, at most."""
PARTS, PART_ERROR, ALMOST = np.arange(2.0, 9.0), 0.003, 0.05
"""Parts of a stated spindle speed (halves to eighths) that count as doubled periods of the cut, how exactly, and
how close to a multiple another machine is not believed to run."""
MATERIAL = 0.02
"""Least part of the lines' power from which a line is looked at for itself."""
RICH, RICH_LINES = 0.3, 4
"""Power of the harmonics over the fundamental from which a line with nothing but harmonics counts as an impact train,
and how many there must be; a self-excited vibration is nearly sinusoidal (clipped hard, it has 0.2)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Sorted:
    """Lines sorted into forced and free.

    Parameters
    ----------
    forced : ndarray, shape (n,)
        Whether a line repeats with the spindle or another machine.
    bases : tuple of Base
        What that was told by.
    """

    forced: Flags
    bases: tuple[Base, ...]


def sort_lines(
    lines: Lines,
    band_hz: tuple[float, float],
    *,
    spindle_hz: float | None = None,
    tools: int | None = None,
    known_hz: Sequence[float] = (),
) -> Sorted:
    """Sort the lines of a stretch into forced and free, the strongest first.

    Parameters
    ----------
    lines : Lines
        Lines.
    band_hz : (float, float)
        Band in which lines are looked at for themselves (Hz).
    spindle_hz : float or None
        Stated speed (Hz).
    tools : int or None
        Cutting edges that pass per revolution.
    known_hz : sequence of float
        Fundamentals known from other stretches (Hz).
    """
    sorting = _Sorting(lines, band_hz, np.asarray(known_hz, dtype=np.float64))
    if spindle_hz is not None:
        sorting.take_stated(spindle_hz, tools)
    for _ in range(ROUNDS):
        line = sorting.strongest()
        if line is None:
            break
        sorting.decide(line)
    return Sorted(forced=sorting.kind == 1, bases=tuple(sorting.bases))


class _Sorting:
    """Lines on their way into forced (1) and free (2); 0 is undecided."""

    def __init__(self, lines: Lines, band_hz: tuple[float, float], known_hz: Floats) -> None:
        self.lines, self.known_hz = lines, known_hz
        self.slack_hz = tolerance(lines.frequency_hz, lines.spacing_hz)
        self.kind = np.zeros(len(lines.frequency_hz), dtype=np.int8)
        self.bases: list[Base] = []
        self.inside = (lines.frequency_hz >= band_hz[0]) & (lines.frequency_hz <= band_hz[1])
        self.total = float(lines.power[self.inside].sum())
        self.stated_hz: float | None = None
        self.tools: int | None = None
        self.on_stated = np.zeros(len(lines.frequency_hz), dtype=bool)
        self.stated_slack_hz = self.slack_hz

    def take_stated(self, spindle_hz: float, tools: int | None) -> None:
        """Take faint lines on the comb of a stated speed for forced; the strong ones are still looked at."""
        lines = self.lines
        base = stated(lines, spindle_hz, tools)
        slack = self.slack_hz
        if base.evidence < LEAST:
            slack = self.stated_slack_hz = PRECISION * lines.spacing_hz + SPEED_ERROR * lines.frequency_hz
        for spacing in (base.fundamental_hz, base.fundamental_hz * (tools or 1)):
            self.on_stated |= on_comb(lines.frequency_hz, spacing, slack) & (slack < spacing / 6.0)
        strong = self.inside & (lines.power >= MATERIAL * self.total)
        self.kind[self.on_stated & ~strong] = 1
        self.bases.append(base)
        self.stated_hz, self.tools = base.fundamental_hz, tools

    def strongest(self) -> int | None:
        """Return the strongest line that is not decided, None when the rest is faint."""
        open_power = np.where((self.kind == 0) & self.inside, self.lines.power, 0.0)
        if not open_power.size or open_power.max() <= MATERIAL * self.total:
            return None
        return int(np.argmax(open_power))

    def decide(self, line: int) -> None:
        """Decide of one line, and of those that go with it."""
        lines = self.lines
        own = on_comb(lines.frequency_hz, float(lines.frequency_hz[line]), 1.5 * self.slack_hz) & (self.kind == 0)
        own[line] = False
        question, combs = self._asked(line, own)
        for _ in range(COMBS - 1):  # combs that it does not belong to are no reason for one that it does
            if not self._set_aside(question, combs, own):
                break
            question, combs = self._asked(line, own)
        distances = self._passing() if self.stated_hz else np.append(combs, [b.fundamental_hz for b in self.bases])
        distances = distances[distances <= FASTEST * question.line_hz]
        for_sides = question.sidebands(distances)
        side = int(np.argmax(for_sides)) if for_sides.size else 0
        beside = float(for_sides[side]) if for_sides.size else -1.0
        base, found = self._best_comb(question, combs, line)
        if found > 0.0 and found >= beside and not self._is_lifted(line, base):
            self._force(base, found, line)
        elif self.stated_hz is None and self._is_train(own, line) and not self._has_sides(line, distances, for_sides):
            self._force(question.line_hz, self._train_evidence(question.line_hz), line)
            self.kind[self._folded(question.line_hz)] = 1
        elif self._is_alias(line):
            self.kind[line] = 1
        else:
            self.kind[own] = 2
            self.kind[line] = 2
            if beside >= LEAST:
                self._free(question.line_hz, float(distances[side]), beside)

    def _asked(self, line: int, own: Flags) -> tuple[Question, Floats]:
        """Return the question that a line poses, and the combs that may answer it (Hz)."""
        used = self._usable(line, own)
        question = Question(self.lines.frequency_hz[used], self.slack_hz[used], int(np.searchsorted(used, line)))
        return question, self._candidates(question, used)

    def _usable(self, line: int, own: Flags) -> NDArray[np.intp]:
        """Return the most prominent lines that nothing explains yet, without the line's own harmonics."""
        usable = (self.kind == 0) & ~own
        if self.on_stated[line]:
            usable |= self.on_stated & ~own
        ranked = np.argsort(-np.where(usable, self.lines.prominence, 0.0))[:MOST]
        return np.union1d(ranked[usable[ranked]], [line])

    def _set_aside(self, question: Question, combs: Floats, own: Flags) -> bool:
        """Take the best comb for forced if the line is not on it, and return whether there was one."""
        if not combs.size:
            return False
        found = comb_evidence(combs, question.frequency_hz, question.slack_hz)
        found[self._related(combs)] = -1.0
        found[~question.is_rooted(combs)] -= ROOTLESS if self.stated_hz is None else np.inf
        on, best = question.is_on(combs), int(np.argmax(found))
        if on[best] or found[best] < self._least(combs[best]) or found[on].max(initial=-1.0) > found[best] - MARGIN:
            return False
        forced = on_comb(self.lines.frequency_hz, float(combs[best]), self.slack_hz) & (self.kind == 0) & ~own
        self.kind[forced] = 1
        self.bases.append(Base(fundamental_hz=float(combs[best]), evidence=float(found[best]), source="comb"))
        return bool(forced.any())

    def _best_comb(self, question: Question, combs: Floats, line: int) -> tuple[float, float]:
        """Return the comb that explains a line best, and the evidence for it."""
        best, most = question.line_hz, -1.0
        if combs.size:
            found = question.comb(combs)
            found[self._related(combs)] = -1.0
            rootless = ~question.is_rooted(combs)
            found[rootless] -= ROOTLESS if self.stated_hz is None else np.inf
            k = int(np.argmax(found))
            if found[k] >= self._least(combs[k]):
                best, most = float(combs[k]), float(found[k])
        if self.stated_hz is not None and self.on_stated[line]:
            luck = float(np.log(max(self.stated_hz / (6.0 * question.line_slack_hz), 1.0)))
            total = LEAST + luck + max(float(question.comb(self._passing()).max()), 0.0)
            if total >= most:
                return self.stated_hz, total
        return best, most

    def _passing(self) -> Floats:
        """Return the frequencies at which teeth may pass at the stated speed (Hz)."""
        teeth = np.arange(1, MOST_TEETH + 1) if self.tools is None else np.array([1, self.tools])
        return np.asarray((self.stated_hz or np.nan) * teeth, dtype=np.float64)

    def _least(self, fundamental_hz: float) -> float:
        """Return the evidence that a comb needs: less, when other stretches have it."""
        known = bool((np.abs(self.known_hz / fundamental_hz - 1.0) < 0.01).any())
        return LEAST - KNOWN if known else LEAST

    def _related(self, combs: Floats) -> Flags:
        """Return which combs share periods with the stated speed or one found, without being multiples of it.

        No other machine does: such a comb is made of sidebands by chance, or the cut has doubled its own period.
        """
        related = np.zeros(len(combs), dtype=bool)
        for base in self.bases:
            if base.source == "sidebands":
                continue
            ratio = combs / base.fundamental_hz
            off = np.abs(ratio - np.round(ratio))
            times = ratio[:, None] * PARTS
            parts = (np.abs(times - np.round(times)) < PART_ERROR * times).any(axis=1)
            below = np.abs(1.0 / ratio - np.round(1.0 / ratio)) < PART_ERROR / ratio
            related |= (off > PART_ERROR) & (parts | np.where(ratio < 1.0, below, off < ALMOST))
        return related

    def _is_lifted(self, line: int, fundamental_hz: float) -> bool:
        """Return whether a line stands out of its comb by more than a mode lifts; a lone harmonic of teeth may."""
        if fundamental_hz != self.stated_hz:
            return stands_alone(self.lines, line, fundamental_hz, None)
        passing = fundamental_hz * (self.tools or 1)
        slack = self.stated_slack_hz[line : line + 1]
        if 2.0 * slack[0] < LUCK * passing and on_comb(self.lines.frequency_hz[line : line + 1], passing, slack)[0]:
            return False
        return stands_alone(self.lines, line, fundamental_hz, self.tools)

    def _candidates(self, question: Question, used: NDArray[np.intp]) -> Floats:
        frequency = question.frequency_hz
        strong = frequency[np.argsort(-self.lines.power[used])[:STRONGEST]]
        orders = np.arange(1.0, HIGHEST_ORDER + 1.0)
        tried = np.concatenate([
            (strong[:, None] / orders).ravel(), np.abs(strong[:, None] - strong).ravel(), frequency[:STRONGEST],
            question.line_hz / orders, self.known_hz,
        ])  # fmt: skip
        tried = tried[(tried >= 5.0 * self.lines.spacing_hz) & (tried <= frequency.max())]
        return np.unique(np.round(refined(tried, frequency, question.slack_hz), 4))

    def _has_sides(self, line: int, distance_hz: Floats, found: Floats) -> bool:
        """Return whether a line has sidebands at a distance that is no multiple of it folded down."""
        if not found.size or found.max() < LEAST:
            return False
        lines, distance = self.lines, distance_hz[np.argmax(found)]
        line_hz = float(lines.frequency_hz[line])
        return not folded(np.array([distance]), line_hz, lines.sample_rate_hz, lines.spacing_hz)[0]

    def _is_train(self, own: Flags, line: int) -> bool:
        power = self.lines.power
        own = own | self._folded(float(self.lines.frequency_hz[line]))
        own[line] = False
        return int(own.sum()) >= RICH_LINES and float(power[own].sum()) >= RICH * float(power[line])

    def _train_evidence(self, fundamental_hz: float) -> float:
        return float(comb_evidence(np.array([fundamental_hz]), self.lines.frequency_hz, self.slack_hz)[0])

    def _is_alias(self, line: int) -> bool:
        """Return whether a line is a harmonic of tooth passing at the stated speed, folded down, and not by chance."""
        if self.stated_hz is None or self.bases[0].evidence < LEAST:
            return False
        lines, passing = self.lines, self.stated_hz * (self.tools or 1)
        places = FOLDS * lines.sample_rate_hz / passing
        slack = float(tolerance(np.array([lines.sample_rate_hz]), lines.spacing_hz)[0])
        if 4.0 * slack * places > LUCK * lines.sample_rate_hz or not self.on_stated.any():
            return False
        return bool(self._folded(passing)[line] and lines.power[line] <= lines.power[self.on_stated].max())

    def _folded(self, fundamental_hz: float) -> Flags:
        lines = self.lines
        return folded(lines.frequency_hz, fundamental_hz, lines.sample_rate_hz, lines.spacing_hz)

    def _force(self, fundamental_hz: float, found: float, line: int) -> None:
        self.kind[line] = 1
        if fundamental_hz == self.stated_hz:
            return  # its other lines are faint, or are looked at for themselves
        self.kind[on_comb(self.lines.frequency_hz, fundamental_hz, self.slack_hz) & (self.kind == 0)] = 1
        self.bases.append(Base(fundamental_hz=fundamental_hz, evidence=found, source="comb"))

    def _free(self, line_hz: float, distance_hz: float, found: float) -> None:
        """Take the sidebands of a free line for free, and the comb that they repeat at the distance of for forced."""
        frequency = self.lines.frequency_hz
        self.kind[on_comb(frequency, distance_hz, self.slack_hz) & ~on_comb(frequency, line_hz, self.slack_hz)] = 1
        for family in range(-SIDES, SIDES + 1):
            rest = (frequency - family * line_hz) / distance_hz
            near = np.abs(rest - np.round(rest)) * distance_hz <= self.slack_hz
            self.kind[near & (self.kind == 0)] = 2
        self.bases.append(Base(fundamental_hz=distance_hz, evidence=found, source="sidebands"))
