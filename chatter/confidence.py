"""How sure a verdict is: one number from what it rests on.

- ``learning``, ``gap``, ``invalid``: 0, there is no verdict.
- ``idle``: 1, as far as the state of the cut is known.
- ``quiet``: that of the limits, less what the indicator already takes of its limit: limits learned in quiet cutting
  0.95, configured 0.8, from the noise of the cut, the air or a reference 0.7; times 1 - 0.5 times the mean square over
  its limit.
- ``suspect``: half of the share of the signal that lines explain, for it is not confirmed.
- ``chatter``: the share of the signal that lines explain; times 0.7 when the line cannot be told from the harmonics of
  the tools, because the spindle speed is not known or too slow for the stretch; times 0.5 when the signal contradicts
  the stated speed.

A single line is as sure as the share of the signal that lines explain, times n / (n + 1) where it was found in n blocks
in a row, with the same doubts about its kind.
"""

from dataclasses import dataclass

from chatter.estimate import LimitSource, State

LIMITS: dict[LimitSource, float] = {"cutting": 0.95, "configured": 0.8}
OTHER_LIMITS = 0.7
UNCONFIRMED = 0.5
UNTOLD = 0.7
DOUBTFUL = 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class Grounds:
    """What a verdict rests on.

    Parameters
    ----------
    state : str
        The verdict.
    source : str
        Where the limits in force come from.
    ratio : float
        Mean square of the band over its limit.
    explained : float
        Share of the signal that lines explain, 0...1.
    told_apart : bool
        The line can be told from the harmonics of the tools.
    doubtful : bool
        The signal contradicts the stated spindle speed.
    """

    state: State
    source: LimitSource
    ratio: float = 0.0
    explained: float = 0.0
    told_apart: bool = True
    doubtful: bool = False


def confidence(grounds: Grounds) -> float:
    """Return how sure a verdict is, 0...1.

    Parameters
    ----------
    grounds : Grounds
        What it rests on.
    """
    if grounds.state == "idle":
        return 1.0
    if grounds.state == "quiet":
        return LIMITS.get(grounds.source, OTHER_LIMITS) * (1.0 - 0.5 * min(grounds.ratio, 1.0))
    if grounds.state == "suspect":
        return UNCONFIRMED * grounds.explained
    if grounds.state == "chatter":
        return grounds.explained * _doubt(grounds.told_apart, grounds.doubtful)
    return 0.0


def line_confidence(explained: float, seen: int, *, told_apart: bool, doubtful: bool) -> float:
    """Return how sure a line and its kind are, 0...1.

    Parameters
    ----------
    explained : float
        Share of the signal that lines explain, 0...1.
    seen : int
        Blocks in a row in which it was found.
    told_apart : bool
        It can be told from the harmonics of the tools.
    doubtful : bool
        The signal contradicts the stated spindle speed.
    """
    return explained * seen / (seen + 1.0) * _doubt(told_apart, doubtful)


def _doubt(told_apart: bool, doubtful: bool) -> float:
    return DOUBTFUL if doubtful else 1.0 if told_apart else UNTOLD
