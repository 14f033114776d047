"""What a shift will do, judged by every process that explains the chatter seen so far.

When the pitch moves the frequency moves with it, so half a wave at the measured frequency misses. Each of some
hundred processes within the error of the belief is asked for its roots at the shifts where chatter was seen; those with
a strong root at the measured line gain weight, the others lose it. A shift is then as good as the share of the weight
that it silences. If none explains what was measured, the belief is wrong and is not used.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pitch import _foresight_kernels as kernels
from pitch._checks import positive
from pitch.belief import ProcessBelief
from pitch.choice import Candidate, PlannerConfig, reachable

Floats = NDArray[np.float64]
Sighting = tuple[float, float]
"""Chatter as it was seen while it was small: at which shift (rad), at which frequency (Hz)."""

LINE_HZ, LINE_SHARE = 3.0, 0.1
"""Error of a measured line: at least so much (Hz), and this share of the spindle frequency."""
RIVAL = 8.0
"""A line that grows by so much (1/s) more slowly than the strongest is seen 1/e as often."""
DOUBT = -8.0
"""Logarithm of the likelihood per sighting below which the belief does not explain what was seen."""
KEPT = 16
"""Processes that shifts are judged by."""
AHEAD = 1.25
"""Modal mass in the stretch ahead over that of now."""
BORDER, SLOPE = -3.0, 4.0
"""Growth (1/s) that counts as half silenced, and over how much (1/s) the judgement turns."""
FIRST, LAST, STEP = 0.3, 1.75, 0.08
"""Phase over pi, beside whole turns, of the first and the last candidate, and from one to the next."""
FINER = (-0.5, -0.25, 0.25, 0.5)
"""What is tried beside the best candidate, in steps."""
ENOUGH = 0.9
"""Share of the weight that must be silenced for the next order to stay untried."""
HOPE = 0.15
"""Share below which the best shift is not worth a move."""
SPEEDS = (0.02, -0.02, 0.04, -0.04, 0.07, -0.07, 0.12, -0.12, 0.2, -0.2)
"""Changes of spindle speed that may be advised."""
ADVISERS = 8


@dataclass(frozen=True, slots=True, kw_only=True)
class Outlook:
    """The best shift within reach.

    Attributes
    ----------
    candidate : Candidate
        Shift, order and phase of the measured line there.
    silenced : float
        Share of the likely processes that it silences.
    """

    candidate: Candidate
    silenced: float


class Foresight:
    """Judges shifts by the processes within the error of a belief.

    Parameters
    ----------
    belief : ProcessBelief
        Bar and cut.
    config : PlannerConfig
        Limits of shift and slides, highest order.
    """

    def __init__(self, belief: ProcessBelief, config: PlannerConfig) -> None:
        self._all, self._config = belief.hypotheses(), config

    def prepare(self) -> None:
        """Compile the kernels."""
        strongest_roots(self._all[:1], np.zeros(1), 20.0)

    def weights(self, seen: Sequence[Sighting], spindle_hz: float) -> Floats | None:
        """Return the weight of every process, shape (n,), or None if none explains what was seen.

        Parameters
        ----------
        seen : sequence of Sighting
            Where chatter stood, and at which line.
        spindle_hz : float
            Spindle speed (Hz).
        """
        total = np.zeros(len(self._all))
        spread = max(LINE_HZ, LINE_SHARE * positive("spindle_hz", spindle_hz))
        for shift, line_hz in seen:
            at = np.full(len(self._all), shift)
            growth, _, near, near_hz = strongest_roots(self._all, at, spindle_hz, line_hz).T
            off = (near_hz / (2.0 * math.pi) - line_hz) / spread
            total -= np.minimum(0.5 * off**2, 50.0) + (growth - near) / RIVAL + np.maximum(-growth, 0.0) / SLOPE
        if not seen or total.max() < DOUBT * len(seen):
            return None
        weight = np.exp(np.maximum(total - total.max(), -50.0))
        return np.asarray(weight / weight.sum(), dtype=np.float64)

    def best(
        self, weight: Floats, line_hz: float, spindle_hz: float, diameter: float, failed: Sequence[float], worth: float
    ) -> Outlook | None:
        """Return the shift that silences most of the weight; None if there is none within reach.

        Parameters
        ----------
        weight : ndarray
            From `weights`, shape (n,).
        line_hz : float
            Measured line, which orders refer to (Hz).
        spindle_hz : float
            Spindle speed (Hz).
        diameter : float
            At the cutting point (m).
        failed : sequence of float
            Shifts at which it chattered (rad).
        worth : float
            How far a candidate must be from each of them (rad).
        """
        likely = np.argsort(-weight, kind="stable")[:KEPT]
        found: Outlook | None = None
        for order in self._orders():
            first = 2.0 * math.pi * order
            phases = first + math.pi * np.arange(FIRST, LAST, STEP)
            shifts = self._within_reach(0.5 * phases * spindle_hz / line_hz, diameter, failed, worth)
            if not shifts.size:
                continue
            score = self._score(likely, weight, shifts, spindle_hz)
            top, width = float(shifts[score.argmax()]), 0.5 * math.pi * STEP * spindle_hz / line_hz
            beside = self._within_reach(top + width * np.array(FINER), diameter, failed, worth)
            shifts = np.append(shifts, beside)
            score = np.append(score, self._score(likely, weight, beside, spindle_hz))
            silenced = float(score.max())
            if found is None or silenced > found.silenced + 0.05:
                shift = float(shifts[score.argmax()])
                candidate = Candidate(shift, order, 2.0 * shift * line_hz / spindle_hz)
                found = Outlook(candidate=candidate, silenced=silenced)
            if found.silenced >= ENOUGH:
                break
        return found

    def speed(self, weight: Floats, line_hz: float, spindle_hz: float, diameter: float) -> float | None:
        """Return the nearest spindle speed (Hz) at which some shift silences most of the weight, or None."""
        likely = np.argsort(-weight, kind="stable")[:ADVISERS]
        for change in SPEEDS:
            speed = spindle_hz * (1.0 + change)
            phases = math.pi * np.arange(0.6, 1.4, 0.1)
            shifts = self._within_reach(0.5 * phases * speed / line_hz, diameter, (), 0.0)
            if shifts.size and self._score(likely, weight, shifts, speed).max() >= ENOUGH:
                return speed
        return None

    def _orders(self) -> list[int]:
        wanted = self._config.order
        return sorted(range(self._config.max_order + 1), key=lambda m: (abs(m - wanted), m))

    def _within_reach(self, shifts: Floats, diameter: float, failed: Sequence[float], worth: float) -> Floats:
        """Return those that turret 1 can reach, mirrored where only that fits, and that have not failed."""
        kept = [
            way for h in shifts.tolist() if h > 0.0
            for way in [w for w in (h, -h) if reachable(self._config, w, diameter)][:1]
        ]  # fmt: skip
        return np.array([h for h in kept if all(abs(h - old) >= worth for old in failed)])

    def _score(self, likely: NDArray[np.int64], weight: Floats, shifts: Floats, spindle_hz: float) -> Floats:
        """Return the share of the weight that each shift silences, now and in the stretch ahead."""
        now = self._all[likely]
        ahead = now * np.array([AHEAD, 1.0, AHEAD, 1.0, 1.0])
        ahead[:, 1] = now[:, 1] * math.sqrt(AHEAD)
        both = np.concatenate([now, ahead])
        share = np.concatenate([weight[likely], weight[likely]])
        rows = np.repeat(both, len(shifts), axis=0)
        growth = strongest_roots(rows, np.tile(shifts, len(both)), spindle_hz)[:, 0].reshape(len(both), len(shifts))
        silenced = 1.0 / (1.0 + np.exp(np.clip((growth - BORDER) / SLOPE, -40.0, 40.0)))
        return np.asarray(share @ silenced / share.sum(), dtype=np.float64)


def growth_at(process: ProcessBelief, shifts: Floats, spindle_hz: float) -> tuple[Floats, Floats]:
    """Return growth (1/s) and frequency (Hz) of the strongest root of the bar at every shift.

    Parameters
    ----------
    process : ProcessBelief
        Bar and cut, taken as they are.
    shifts : ndarray
        Of turret 1 (rad), shape (n,).
    spindle_hz : float
        Spindle speed (Hz).

    Returns
    -------
    growth, frequency_hz : ndarray
        Shape (n,) each.
    """
    rows = np.repeat(process.nominal()[None, :], len(shifts), axis=0)
    found = strongest_roots(rows, np.asarray(shifts, dtype=np.float64), spindle_hz)
    return found[:, 0], found[:, 1] / (2.0 * math.pi)


def strongest_roots(rows: Floats, shifts: Floats, spindle_hz: float, line_hz: float = 0.0) -> Floats:
    """Return growth and angular frequency of the strongest root and of that nearest to a line, shape (n, 4).

    Parameters
    ----------
    rows : ndarray
        m, C, k, mu, K of every process, shape (n, 5).
    shifts : ndarray
        Of turret 1 (rad), shape (n,).
    spindle_hz : float
        Spindle speed (Hz).
    line_hz : float
        Line that is looked for (Hz), 0 for none.
    """
    omega, out = 2.0 * math.pi * positive("spindle_hz", spindle_hz), np.empty((len(rows), 4))
    half_turn = np.full(len(rows), math.pi / omega)
    env, at = kernels.scratch()
    kernels.strongest(np.ascontiguousarray(rows), half_turn, shifts / omega, 2.0 * math.pi * line_hz, env, at, out)
    return out
