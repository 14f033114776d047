"""From trials to the numbers of the benchmark."""

# pyright: reportMissingTypeStubs=false

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.stats import chi2

from services.bench.detector.ours import DEFAULT
from services.bench.detector.programme import KINDS
from services.bench.detector.rivals import LEVELS, NAMES
from services.bench.detector.trial import Result

OURS = "antiphase"
NEAR_HZ = (1.0, 3.0)
CONFIDENCE = 0.95


@dataclass(frozen=True, slots=True, kw_only=True)
class Point:
    """One setting of one scheme: how late, and how often in vain.

    Attributes
    ----------
    setting
        Threshold, or the name of our setting.
    p50_ms, p95_ms, max_ms
        Latency from the true onset (ms); infinite where more is missed.
    missed
        Share of the onsets.
    alarms, hours
        False alarms, and hours of stable cutting that they came in.
    """

    setting: str
    p50_ms: float
    p95_ms: float
    max_ms: float
    missed: float
    alarms: int
    hours: float

    @property
    def per_hour(self) -> float:
        """False alarms per hour."""
        return self.alarms / self.hours if self.hours else math.nan

    @property
    def bound_per_hour(self) -> float:
        """What the rate does not exceed, at 95 %."""
        return rate_bound(self.alarms, self.hours)

    def as_dict(self) -> Result:
        """Return everything as plain values."""
        names = ("setting", "p50_ms", "p95_ms", "max_ms", "missed", "alarms", "hours", "per_hour", "bound_per_hour")
        return {name: getattr(self, name) for name in names}


def rate_bound(events: int, hours: float) -> float:
    """Return the upper bound of a rate at 95 % after so many events (1/h): for none it is 3 / hours."""
    return float(chi2.ppf(CONFIDENCE, 2 * events + 2)) / 2.0 / hours if hours else math.inf


def quantile(values: Iterable[float | None], share: float) -> float:
    """Return the smallest value that at least a share of all does not exceed; None counts as infinite."""
    known = np.sort([math.inf if value is None else value for value in values])
    if not known.size:
        return math.nan
    return float(known[max(math.ceil(share * known.size) - 1, 0)])


def curves(onsets: Sequence[Result], stable: Sequence[Result]) -> dict[str, list[Point]]:
    """Return the points of every scheme, the default of ours first."""
    swept = [one for one in stable if len(one["ours"]) > 1]
    found: dict[str, list[Point]] = {OURS: []}
    for setting in onsets[0]["ours"] if onsets else ():
        heard = stable if setting == DEFAULT else swept
        late = [one["ours"][setting] for one in onsets]
        found[OURS].append(_point(setting, late, heard, lambda one, s=setting: one["ours"][s]))
    for rival in NAMES:
        found[rival] = [
            _point(
                f"{level:.3g}", [one["rivals"][rival]["latency_ms"][k] for one in onsets], stable,
                lambda one, r=rival, k=k: one["rivals"][r][k],
            )
            for k, level in enumerate(LEVELS)
        ]  # fmt: skip
    return found


def _point(setting: str, late: list[float | None], stable: Sequence[Result], count: Callable[[Result], int]) -> Point:
    return Point(
        setting=setting,
        p50_ms=quantile(late, 0.5),
        p95_ms=quantile(late, 0.95),
        max_ms=quantile(late, 1.0),
        missed=sum(one is None for one in late) / max(len(late), 1),
        alarms=sum(map(count, stable)),
        hours=sum(one["cut_s"] for one in stable) / 3600.0,
    )


def silent(points: Sequence[Point]) -> Point:
    """Return the quickest setting without a false alarm, or else the one with the fewest."""
    fewest = min(point.alarms for point in points)
    return min((point for point in points if point.alarms == fewest), key=lambda point: (point.p95_ms, point.p50_ms))


def as_quick(points: Sequence[Point], p50_ms: float) -> Point | None:
    """Return the setting with the fewest false alarms of those whose median latency is not above a given one (ms)."""
    quick = [point for point in points if point.p50_ms <= p50_ms]
    return min(quick, key=lambda point: point.alarms) if quick else None


def summary(onsets: Sequence[Result]) -> Result:
    """Return the numbers of our default setting over some onsets.

    `within_1_hz` is the share of detections whose frequency is so near to the line that dominates the truth in the
    200 ms after them, `at_once_within_1_hz` to that of the 100 ms before, and `truth_within_1_hz` the share in which
    these two true lines are so near: chatter that saturates or hops moves, and nobody can know that before.
    """
    late = [one.get("latency_ms") for one in onsets]
    found = [one for one in onsets if one.get("latency_ms") is not None]
    wrong, early = (_apart_hz(found, "frequency_hz", true) for true in ("true_hz", "true_before_hz"))
    moved = _apart_hz(found, "true_before_hz", "true_hz")
    excess = [one["excess_ms"] for one in found if one["excess_ms"] is not None]
    return {
        "onsets": len(onsets),
        "missed": len(onsets) - len(found),
        "early_alarms": sum(one["early_alarms"] for one in onsets),
        "latency_ms": _spread(late),
        "least_ms": _spread([one["least_ms"] for one in onsets if one["least_ms"] is not None]),
        "excess_ms": _spread(excess),
        "marked_mm": _spread([one["marked_mm"] for one in found]),
        "frequency": {
            **{f"within_{near:g}_hz": share_within(wrong, near) for near in NEAR_HZ},
            **{f"at_once_within_{near:g}_hz": share_within(early, near) for near in NEAR_HZ},
            **{f"truth_within_{near:g}_hz": share_within(moved, near) for near in NEAR_HZ},
            "p50_hz": quantile(wrong, 0.5),
            "p95_hz": quantile(wrong, 0.95),
        },
    }


def _spread(values: Sequence[float | None]) -> Result:
    return {name: quantile(values, share) for name, share in (("p50", 0.5), ("p95", 0.95), ("max", 1.0))}


def _apart_hz(found: Sequence[Result], told: str, true: str) -> list[float | None]:
    """Return how far one frequency is from another (Hz) where the other is known; None where the one was not told."""
    known = [one for one in found if one[true] is not None]
    return [None if one[told] is None else abs(one[told] - one[true]) for one in known]


def share_within(wrong: Sequence[float | None], near_hz: float) -> float:
    """Return the share of frequencies that are no further off than that; one that was not told is wrong."""
    return sum(one is not None and abs(one) <= near_hz for one in wrong) / len(wrong) if wrong else math.nan


GROUPS: dict[str, Callable[[Result], str]] = {
    "begins": lambda one: one["begins"],
    "axes": lambda one: one["axes"],
    "turret": lambda one: one["turret"],
    "growth_1_s": lambda one: _range(one["growth_1_s"], (10, 20, 30, 40, 50, 60)),
    "spindle_speed_rpm": lambda one: _range(one["spindle_speed_rpm"], (600, 1000, 1400, 1800, 2400)),
    "force_noise_n_per_rthz": lambda one: _range(one["force_noise_n_per_rthz"], (0.01, 0.015, 0.02, 0.025, 0.03)),
}


def _range(value: float, edges: Sequence[float]) -> str:
    k = min(max(int(np.searchsorted(edges, value, side="right")) - 1, 0), len(edges) - 2)
    return f"{edges[k]:g}..{edges[k + 1]:g}"


def by_group(onsets: Sequence[Result]) -> Result:
    """Return the numbers of our default setting for each part of the population."""
    found: Result = {}
    for name, of in GROUPS.items():
        found[name] = {part: summary([one for one in onsets if of(one) == part]) for part in sorted(map(of, onsets))}
    return found


def false_alarms(stable: Sequence[Result]) -> Result:
    """Return the false alarms of our default setting, in all and for each thing that happens in a stable cut."""

    def of(part: Sequence[Result]) -> Result:
        count, hours = sum(one["ours"][DEFAULT] for one in part), sum(one["cut_s"] for one in part) / 3600.0
        return {
            "count": count, "hours": hours, "per_hour": count / hours if hours else math.nan,
            "bound_per_hour": rate_bound(count, hours), "felt": sum(one["felt"] for one in part),
        }  # fmt: skip

    parts = {kind: of([one for one in stable if one["kind"] == kind]) for kind in KINDS}
    events = [{"number": one["number"], "kind": one["kind"], **alarm} for one in stable for alarm in one["alarms"]]
    return {**of(stable), "by_kind": parts, "events": events}


def pairs(trials: Sequence[Result]) -> Result:
    """Return in how many cuts with two lines both were told in time; None for a monitor that tells one only."""
    together = [one for one in trials if one.get("together")]
    told: list[Any] = [one["told"] for one in together if one["told"] is not None]
    return {"cuts": len(trials), "together": len(together), "told": sum(told) if told else None}
