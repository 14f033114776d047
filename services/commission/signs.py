"""Which channels go as they should while turret 1 goes a little along its arc; the others by name and fault."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from services.messages import Floats

SILENT, SAME = 0.05, 0.1
"""Share of the expected travel below which a channel is silent, and within which it as it should be."""
CLEAR, PIECES = 0.5, 10
"""Mean over root mean square of a thrust along its motion from which its sign is clear, taken over so many pieces."""
LEAST_M = 1e-5
"""Travel that an axis must be asked for before anything can be said of it (m)."""
AXES = ("x1", "y1")
POSITIONS = ("motor_position", "stage_position")


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """What is to be said of a channel; `wrong` is empty when it is as it should be, None when nothing can be said."""

    channel: str
    wrong: str | None
    ratio: float | None

    def words(self) -> str:
        """Return it for people."""
        if self.wrong is None:
            return f"{self.channel}: not judged, this axis hardly moves in the test"
        return f"{self.channel}: {self.wrong or 'as it should be'}"


def check_positions(travel: dict[str, float], expected: dict[str, float]) -> list[Finding]:
    """Judge every position channel by its travel.

    Parameters
    ----------
    travel
        Of each channel between the two stands (m), by names such as `x1_motor_position`.
    expected
        Of each axis (m).
    """
    found: list[Finding] = []
    for axis, other in (AXES, AXES[::-1]):
        for kind in POSITIONS:
            channel = f"{axis}_{kind}"
            found.append(_judged(channel, travel[channel], expected[axis], expected[other], other))
    return found


def _judged(channel: str, moved: float, own: float, others: float, other: str) -> Finding:
    if abs(own) < LEAST_M:
        return Finding(channel=channel, wrong=None, ratio=None)
    ratio = moved / own
    if not np.isfinite(ratio):
        return Finding(channel=channel, wrong="is not a number", ratio=None)
    if abs(ratio - 1.0) <= SAME:
        return Finding(channel=channel, wrong="", ratio=ratio)
    if abs(ratio) <= SILENT:
        wrong = "is silent: not connected, or the drive does not follow"
    elif abs(ratio + 1.0) <= SAME:
        wrong = "is reversed"
    elif abs(others) >= LEAST_M and abs(moved / others - 1.0) <= SAME:
        wrong = f"moves like {other}: swapped with it"
    elif abs(others) >= LEAST_M and abs(moved / others + 1.0) <= SAME:
        wrong = f"moves like {other} reversed: swapped with it and reversed"
    else:
        wrong = f"moves {ratio:.3g} times as far as it should: look at lead, counts and unit"
    return Finding(channel=channel, wrong=wrong, ratio=ratio)


def check_thrusts(out: dict[str, Floats], back: dict[str, Floats], expected: dict[str, float]) -> list[Finding]:
    """Judge every thrust by its sign on the way out and on the way back: it works against friction.

    Parameters
    ----------
    out, back
        Of each axis on both ways (N), shape (n,), by names such as `x1_thrust`.
    expected
        Travel of each axis on the way out (m).
    """
    found: list[Finding] = []
    for axis in AXES:
        channel, asked = f"{axis}_thrust", expected[axis]
        if abs(asked) < LEAST_M:
            found.append(Finding(channel=channel, wrong=None, ratio=None))
            continue
        both = [np.array([part.mean() for part in np.array_split(way[channel], PIECES)]) for way in (out, back)]
        level = 0.5 * (both[0].mean() + both[1].mean())
        with_motion = np.sign(asked) * np.concatenate([both[0] - level, level - both[1]])
        size = float(np.sqrt(np.mean(with_motion**2)))
        ratio = float(with_motion.mean()) / size if size > 0.0 else 0.0
        unclear = "is silent, or not the thrust of this axis"
        wrong = "" if ratio > CLEAR else "is reversed" if ratio < -CLEAR else unclear
        found.append(Finding(channel=channel, wrong=wrong, ratio=ratio))
    if all(one.wrong == "is reversed" for one in found):
        found = [
            Finding(channel=one.channel, wrong="is reversed, or both thrusts are swapped", ratio=one.ratio)
            for one in found
        ]
    return found
