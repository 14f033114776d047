"""What the lines of a recording say of the spindle's speed."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from chatter.comb import LEAST, SPEED_SPREAD, Base, comb_evidence, on_comb, refined, tolerance
from chatter.lines import Lines
from chatter.question import Question
from chatter.separation import Stretch

Floats = NDArray[np.float64]

MULTIPLES = 8
"""Teeth that tooth passing may have."""
AGREES = 0.01
"""Relative difference that a stated speed may have: belts slip and dials are read."""
CLEAR, RIVAL = 20.0, 0.4
"""Evidence that a fundamental must have to contradict a stated speed, and the part of it that the speed may have."""
STRONG, CONVINCING = 0.003, 2.0
"""Power of a line over the strongest (-25 dB) from which it speaks for a speed, and the log likelihood ratio needed."""
FIRST = 8.5
"""Orders among which three must be there: a force has its lowest harmonics, chance has not."""
OFTEN = 0.5
"""Part of the stretches with a clear fundamental that must contradict."""
Standing = Literal["confirmed", "stated", "unknown", "refuted", "contradicted"]
DOUBTS: dict[Standing, str | None] = {
    "confirmed": None,
    "stated": None,
    "unknown": "the speed is unknown",
    "refuted": "the signal does not confirm the stated speed",
    "contradicted": "the signal contradicts the stated speed",
}
TRUST: dict[Standing, float] = {"confirmed": 1.0, "stated": 1.0, "unknown": 0.8, "refuted": 0.6, "contradicted": 0.6}
MAINS_HZ, MAINS_ERROR = (50.0, 60.0), 0.002
"""Mains frequencies and how far they stray."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Speed:
    """How well the speed of the spindle is known.

    Parameters
    ----------
    standing : str
        ``confirmed`` by the lines, ``stated`` only, stated but ``refuted`` since the lines explain themselves without
        it, or ``contradicted`` by them; ``unknown`` when it was not stated.
    notes : tuple of str
        What to tell.
    """

    standing: Standing
    notes: tuple[str, ...]

    @property
    def doubt(self) -> str | None:
        """Why a verdict is less sure, None when it is not."""
        return DOUBTS[self.standing]

    @property
    def trust(self) -> float:
        """How far a verdict can be trusted, 0...1."""
        return TRUST[self.standing]


def confirmed(stretches: Sequence[Stretch]) -> bool:
    """Return whether the lines of most stretches show the comb of the stated speed.

    Parameters
    ----------
    stretches : sequence of Stretch
        Lines sorted by the stated speed.
    """
    found = [b.evidence for s in stretches for b in s.bases if b.source == "stated"]
    return bool(found) and float(np.median(found)) >= LEAST


def contradiction(stretches: Sequence[Stretch], spindle_hz: float, tools: int | None) -> float | None:
    """Return the fundamental (Hz) that contradicts a stated speed, None when the signal allows it.

    Parameters
    ----------
    stretches : sequence of Stretch
        Lines sorted without the stated speed.
    spindle_hz : float
        Stated speed (Hz).
    tools : int or None
        Cutting edges that pass per revolution.
    """
    teeth = np.arange(1, MULTIPLES + 1) if tools is None else np.array([1, tools])
    clear, against = 0, []
    for s in stretches:
        best = max((b for b in s.bases if _is_clear(b, s.lines)), key=lambda b: b.evidence, default=None)
        if best is None:
            continue
        clear += 1
        part = spindle_hz / best.fundamental_hz
        agrees = abs(part - round(part)) <= AGREES * part
        if not agrees and not _supports(s.lines, spindle_hz, teeth, best.evidence):
            against.append(best.fundamental_hz)
    return float(np.median(against)) if clear and len(against) > OFTEN * clear else None


def _is_clear(base: Base, lines: Lines) -> bool:
    """Return whether a fundamental is one of forced vibration beyond doubt, its lowest harmonics among the lines."""
    if base.source != "comb" or base.evidence < CLEAR or _is_mains(base.fundamental_hz):
        return False
    low = lines.frequency_hz < FIRST * base.fundamental_hz
    slack = tolerance(lines.frequency_hz, lines.spacing_hz)
    return int((on_comb(lines.frequency_hz, base.fundamental_hz, slack) & low).sum()) >= 3


def _supports(lines: Lines, spindle_hz: float, teeth: NDArray[np.int_], rival: float) -> bool:
    """Return whether the lines speak for a speed: a comb of it, or more of the strong ones on it than by chance."""
    frequency = lines.frequency_hz
    slack = tolerance(frequency, lines.spacing_hz)
    tried = (spindle_hz * (1.0 + AGREES * np.linspace(-1.0, 1.0, 61)) * teeth[:, None]).ravel()
    tried = tried[tried <= frequency.max()]
    if tried.size and comb_evidence(refined(tried, frequency, slack), frequency, slack).max() >= RIVAL * rival:
        return True
    question = Question(frequency, slack, int(np.argmax(lines.power)))
    if tried.size and question.sidebands(tried).max() >= RIVAL * rival:
        return True
    strong = lines.power >= STRONG * lines.power.max()
    for passing in spindle_hz * teeth:
        near = slack[strong] + SPEED_SPREAD * frequency[strong]
        hits = int(on_comb(frequency[strong], passing, near).sum())
        expected = float(np.minimum(2.0 * near / passing, 1.0).sum())
        if hits >= 2 and hits * np.log(hits / expected) - hits + expected > np.log(len(teeth)) + CONVINCING:
            return True
    return False


def mains(stretches: Sequence[Stretch]) -> float | None:
    """Return the mains frequency whose multiples were set aside, None when there were none.

    Parameters
    ----------
    stretches : sequence of Stretch
        Sorted lines.
    """
    found = [b.fundamental_hz for s in stretches for b in s.bases if b.source == "comb" and _is_mains(b.fundamental_hz)]
    if 2 * len(found) < len(stretches):
        return None
    return min(MAINS_HZ, key=lambda hz: abs(np.median(found) / hz - np.round(np.median(found) / hz)))


def _is_mains(fundamental_hz: float) -> bool:
    return any(abs(fundamental_hz - k * hz) <= MAINS_ERROR * fundamental_hz for hz in MAINS_HZ for k in (1, 2))
