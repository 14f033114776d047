"""The numbers of the benchmark as the table that stands in the README."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from services.bench.detector import tally
from services.bench.detector.rivals import NAMES, TURNS
from services.bench.detector.tally import OURS, Point
from services.bench.detector.trial import Result


def page_of(numbers: Result, curves: dict[str, list[Point]], onsets: Sequence[Result]) -> str:
    """Return a table in Markdown: ours at the default, each rival at its quickest setting without a false alarm."""
    ours = curves[OURS][0]
    settings = {OURS: ours, **{rival: tally.silent(curves[rival]) for rival in NAMES}}
    quick = {OURS: ours, **{rival: tally.as_quick(curves[rival], ours.p50_ms) for rival in NAMES}}
    within = {OURS: numbers["frequency"]["within_1_hz"]}
    for rival in NAMES:
        level = curves[rival].index(settings[rival])
        within[rival] = tally.share_within([one["rivals"][rival]["error_hz"][level] for one in onsets], 1.0)
    within[TURNS] = math.nan

    def line(what: str, goal: str, value: Callable[[str], str]) -> str:
        return " | ".join((f"| {what}", goal, *(value(name) for name in settings))) + " |"

    heading = line("", "goal", {OURS: "ours", **NAMES}.__getitem__)
    return "\n".join(
        (
            heading,
            "|---|" + "---:|" * (len(settings) + 1),
            line("latency p50 / p95 / max (ms)", "30 / 80 / -", lambda name: _late(settings[name])),
            line("missed", "0", lambda name: f"{round(settings[name].missed * len(onsets))} of {len(onsets)}"),
            line("false alarms per hour", "0", lambda name: _rate(settings[name])),
            line("the same if as quick as ours (p50)", "-", lambda name: _rate(quick[name])),
            line("frequency within 1 Hz (%)", "95", lambda name: _plain(100.0 * within[name])),
            line("excess over the least latency p95 (ms)", "40",
                 lambda name: _plain(numbers["excess_ms"]["p95"] if name == OURS else math.nan)),
        )
    ) + "\n"  # fmt: skip


def _late(point: Point) -> str:
    return " / ".join(_plain(value) for value in (point.p50_ms, point.p95_ms, point.max_ms))


def _rate(point: Point | None) -> str:
    if point is None:
        return "never so quick"
    if point.alarms == 0:
        return f"0 in {point.hours:.3g} h (at most {point.bound_per_hour:.2g})"
    return _plain(point.per_hour)


def _plain(value: float) -> str:
    if math.isnan(value):
        return "-"
    if math.isinf(value):
        return "missed"
    return f"{value:.0f}" if abs(value) >= 100.0 else f"{value:.3g}"
