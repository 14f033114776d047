"""What else could be done: speed, feed or depth at which the believed process is stable at equal pitch."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from services.config import Case
from services.errors import InputError, RefusalError

SPEEDS = 101
CHANGES = 61
SPEED_SHARE = 0.25
LEAST_DEPTH, LEAST_FEED, MOST = 0.1, 0.25, 2.0
"""Shares of the present depth and feed between which another one is looked for."""
UNITS = {"speed": "speed_rpm", "feed": "feed_mm_per_rev", "depth": "depth_of_cut_mm"}
PLAIN = {"speed": "min⁻¹", "feed": "mm/rev", "depth": "mm"}


class Condition(NamedTuple):
    """A value of speed, feed or depth (in the unit of its key) and its margin (1)."""

    value: float
    margin: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Alternatives:
    """What equal pitch would stand.

    Attributes
    ----------
    margin
        Of the present cut: how much stiffer it could be, 0 on the border, below it unstable (1).
    error
        How far the believed stiffness may be wrong (1): a smaller margin is no promise.
    best, nearest
        For speed, feed and depth: the largest margin within the range, and the stable value nearest to the present
        one, None if there is none.
    ranges
        Where was looked, by the same names.
    notes
        What stands against the ranges.
    """

    margin: float
    error: float
    best: dict[str, Condition]
    nearest: dict[str, Condition | None]
    ranges: dict[str, tuple[float, float]]
    notes: tuple[str, ...] = ()

    def as_dict(self) -> dict[str, Any]:
        """Return the keys of the command line."""
        def told(name: str, one: Condition | None) -> dict[str, Any] | None:
            if one is None:
                return None
            stable, sure = one.margin > 0.0, one.margin >= self.error
            return {UNITS[name]: one.value, "margin_percent": 100.0 * one.margin, "stable": stable, "sure": sure}

        return {
            "present": {"margin_percent": 100.0 * self.margin, "stable": self.margin > 0.0},
            "stiffness_error_percent": 100.0 * self.error,
            **{
                name: {"nearest": told(name, self.nearest[name]), "best": told(name, self.best[name]),
                       "range": list(self.ranges[name])}
                for name in UNITS if name in self.best
            },
            "notes": list(self.notes),
        }  # fmt: skip

    def sentences(self) -> tuple[str, ...]:
        """Return the same for people."""
        percent = f"{100.0 * self.error:.0f} %"
        said = [_present(self.margin, percent)]
        said += [self._of(name, percent) for name in UNITS if name in self.best]
        return (*said, *self.notes)

    def _of(self, name: str, percent: str) -> str:
        (low, high), near, best, unit = self.ranges[name], self.nearest[name], self.best[name], PLAIN[name]
        where = f"between {low:.4g} and {high:.4g} {unit}"
        most = f"{best.value:.4g} {unit}"
        if near is None:
            return f"No {name} {where} is stable at equal pitch; {most} comes nearest ({_margin(best.margin)})."
        sure = "" if best.margin >= self.error else f", less than the {percent} by which the belief may be wrong"
        first = "" if self.margin > 0.0 else (
            f"{name.capitalize()} {near.value:.4g} {unit} is the nearest that is stable at equal pitch "
            f"({_margin(near.margin)}). "
        )  # fmt: skip
        return f"{first}Most stable {where} is a {name} of {most} ({_margin(best.margin)}{sure})."


def _present(margin: float, percent: str) -> str:
    word = "stable" if margin > 0.0 else "unstable"
    return f"As it is, the cut is {word} at equal pitch: {_margin(margin)}; the belief may be wrong by {percent}."


def _margin(margin: float) -> str:
    """Say a margin: 0 is the border."""
    over = 1.0 / (1.0 + margin)
    return f"it could be {100.0 * margin:.0f} % stiffer" if margin > 0.0 else f"{over:.2g} times too stiff"


def alternatives_of(case: Case) -> Alternatives:
    """Return speed, feed and depth that the believed process would stand at equal pitch.

    Stability is that of `pitch.critical_stiffness`, the smallest stiffness at which it is lost: islands above it are
    not advised. Feed and depth change stiffness, overlap and damping as the chip of the nose tells.

    Parameters
    ----------
    case
        With a belief about the process.

    Raises
    ------
    RefusalError
        When nothing is believed of the process.
    """
    if case.foresight is None:
        why = "nothing is believed of bar and cut: the case has no table [belief.process], of a hammer test and a cut"
        nothing: dict[str, object] = {key: None for key in ("present", *UNITS)}
        raise RefusalError(why, nothing)
    cutting, limits = case.cutting, case.limits
    now = cutting.spindle_hz
    slow = max(limits.spindle_hz_min, (1 - SPEED_SHARE) * now)
    fast = min(limits.spindle_hz_max, (1 + SPEED_SHARE) * now)
    nose = 0.999 * cutting.nose_radius
    feeds = LEAST_FEED * cutting.feed_per_rev, min(MOST * cutting.feed_per_rev, nose)
    depths = LEAST_DEPTH * cutting.depth_of_cut, min(MOST * cutting.depth_of_cut, nose)
    if not slow < fast:
        raise InputError("cutting.spindle_speed_rpm", 60.0 * now, "within the speeds that limits.spindle_speed allows")
    notes: list[str] = []
    looked: dict[str, list[Condition]] = {"speed": _looked(np.linspace(slow, fast, SPEEDS), 60.0, _of_speed(case))}
    if cutting.depth_of_cut < nose:
        looked["feed"] = _looked(np.linspace(*feeds, CHANGES), 1e3, lambda f: _changed(case, feed_per_rev=f))
        looked["depth"] = _looked(np.linspace(*depths, CHANGES), 1e3, lambda a: _changed(case, depth_of_cut=a))
    else:
        notes.append("The cut is deeper than the nose: how feed and depth change it is not known here.")
    present = {"speed": 60.0 * now, "feed": 1e3 * cutting.feed_per_rev, "depth": 1e3 * cutting.depth_of_cut}
    return Alternatives(
        margin=_of_speed(case)(now),
        error=case.foresight.stiffness_error,
        best={name: max(found, key=lambda one: one.margin) for name, found in looked.items()},
        nearest={name: _nearest(found, present[name]) for name, found in looked.items()},
        ranges={name: (found[0].value, found[-1].value) for name, found in looked.items()},
        notes=tuple(notes),
    )


def _looked(values: Iterable[float], unit: float, margin: Callable[[float], float]) -> list[Condition]:
    return [Condition(unit * float(value), margin(float(value))) for value in values]


def _nearest(found: list[Condition], present: float) -> Condition | None:
    stable = [one for one in found if one.margin > 0.0]
    return min(stable, key=lambda one: abs(one.value - present), default=None)


def _of_speed(case: Case) -> Callable[[float], float]:
    return lambda spindle_hz: _margin_of(case, spindle_hz, 1.0, 1.0, 1.0)


def _changed(case: Case, **change: float) -> float:
    from turning_sim import condition_change

    ratio = condition_change(case.cutting, **change)
    return _margin_of(case, case.cutting.spindle_hz, ratio.stiffness, ratio.overlap, ratio.damping)


def _margin_of(case: Case, spindle_hz: float, stiffness: float, overlap: float, damping: float) -> float:
    from pitch import OneModeProcess, critical_stiffness

    belief = case.foresight
    process = OneModeProcess(
        belief.modal_mass, belief.natural_frequency_hz, belief.damping_ratio, min(1.0, overlap * belief.overlap),
        damping * belief.process_damping,
    )  # fmt: skip
    critical, _ = critical_stiffness(process, spindle_hz, 0.0)
    return critical / (stiffness * belief.cutting_stiffness) - 1.0
