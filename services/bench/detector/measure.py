"""The benchmark of the detector: populations, table, files."""

from __future__ import annotations

import csv
import json
import math
import pathlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from services.bench.detector import tally
from services.bench.detector.draw import TURRETS
from services.bench.detector.page import page_of
from services.bench.detector.rivals import NAMES, TURNS
from services.bench.detector.tally import OURS, Point
from services.bench.detector.trial import Result
from services.bench.detector.work import Job, perform_all

Row = dict[str, Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class Size:
    """How much is simulated.

    Attributes
    ----------
    onsets, pairs
        Cuts that chatter, and of them with two lines that grow together.
    stable, cut_s
        Stable cuts, and the time in the cut of each (s).
    sweep_every
        Our other settings are tried on every so many stable cuts.
    """

    onsets: int
    pairs: int
    stable: int
    cut_s: float
    sweep_every: int


SHORT = Size(onsets=250, pairs=24, stable=60, cut_s=60.0, sweep_every=3)
LONG = Size(onsets=600, pairs=60, stable=600, cut_s=120.0, sweep_every=6)


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """Table, all numbers, curves for the figure, and the trials themselves."""

    rows: list[Row]
    numbers: Result
    curves: dict[str, list[Point]]
    onsets: list[Result]

    def write(self, out: pathlib.Path) -> list[pathlib.Path]:
        """Write numbers, onsets, figure, and the table that stands in the README."""
        from services.figures.detector import detector_figure

        numbers, onsets, figure, page = (out / f"detector.{ending}" for ending in ("json", "csv", "png", "md"))
        numbers.write_text(json.dumps(_finite({"rows": self.rows, **self.numbers}), indent=1) + "\n", encoding="utf-8")
        _write_csv(onsets, self.onsets)
        detector_figure(self.curves, names={OURS: "ours", **NAMES}).savefig(figure, metadata={"Software": None})
        page.write_text(page_of(self.numbers, self.curves, self.onsets), encoding="utf-8")
        return [numbers, onsets, figure, page]


def measure(
    size: Size, *, seed: int, workers: int, out: pathlib.Path | None, progress: Callable[[float], None],
    turrets: Sequence[str] = TURRETS,
) -> Outcome:  # fmt: skip
    """Simulate everything, or go on where an earlier call with the same folder was stopped, and evaluate it.

    Parameters
    ----------
    size
        How much.
    seed
        Of everything that is drawn.
    workers
        Processes; the result does not depend on them.
    out
        Where trials are kept as they come; None keeps nothing.
    progress
        Told the share that is done, 0...1.
    turrets
        Cases whose turrets take part.
    """
    trials = perform_all(
        jobs_of(size, seed, tuple(turrets)), workers=workers, progress=progress,
        kept=None if out is None else out / "detector-trials.jsonl",
    )  # fmt: skip
    return evaluate(list(trials.values()))


def jobs_of(size: Size, seed: int, turrets: tuple[str, ...]) -> list[Job]:
    """Return the trials of a benchmark."""
    plan = (("onset", size.onsets, 0.0), ("pair", size.pairs, 0.0), ("stable", size.stable, size.cut_s))
    return [
        Job(population, seed, number, cut_s, number % size.sweep_every == 0, turrets)
        for population, count, cut_s in plan
        for number in range(count)
    ]


def evaluate(trials: Sequence[Result]) -> Outcome:
    """Return what follows from the trials."""
    drawn, stable, two = ([t for t in trials if t["population"] == name] for name in ("onset", "stable", "pair"))
    onsets = [one for one in drawn if one["onset_s"] is not None]
    points = tally.curves(onsets, stable)
    all_of, alarms, pairs = tally.summary(onsets), tally.false_alarms(stable), tally.pairs(two)
    numbers: Result = {
        **all_of,
        "without_onset": len(drawn) - len(onsets),
        "false_alarms": alarms,
        "pairs": pairs,
        "by": tally.by_group(onsets),
        "curves": {name: [point.as_dict() for point in curve] for name, curve in points.items()},
    }
    rows = [*_against_rivals(onsets, points, all_of), *_quick_rows(points), *_alone(all_of, alarms, pairs)]
    return Outcome(rows=rows, numbers=numbers, curves=points, onsets=onsets)


def _row(what: str, ours: float, peer: float, unit: str) -> Row:
    ratio = ours / peer if peer and math.isfinite(peer) else math.nan
    return {"case": what, "ours": ours, "peer": peer, "ratio": ratio, "unit": unit}


def _against_rivals(onsets: Sequence[Result], points: dict[str, list[Point]], ours: Result) -> list[Row]:
    """Return ours at the default beside each rival at its quickest setting without a false alarm."""
    rows: list[Row] = []
    for rival, title in NAMES.items():
        best = tally.silent(points[rival])
        quiet = "at no false alarm" if best.alarms == 0 else f"at {best.alarms} false alarms"
        level = points[rival].index(best)
        late = [one["rivals"][rival]["latency_ms"][level] for one in onsets]
        beside = f"beside {title}, {quiet}"
        rows += [
            _row(f"latency {name}, {beside}", ours["latency_ms"][name], tally.quantile(late, share), "ms")
            for name, share in (("p50", 0.5), ("p95", 0.95))
        ]
        marked = [_marked_mm(one, late_ms) for one, late_ms in zip(onsets, late, strict=True)]
        rows.append(_row(f"marked p95, {beside}", ours["marked_mm"]["p95"], tally.quantile(marked, 0.95), "mm"))
        if rival != TURNS:
            wrong = [one["rivals"][rival]["error_hz"][level] for one in onsets]
            told = 100.0 * ours["frequency"]["within_1_hz"]
            rows.append(_row(f"frequency within 1 Hz, {beside}", told, 100.0 * tally.share_within(wrong, 1.0), "%"))
    return rows


def _marked_mm(one: Result, late_ms: float | None) -> float | None:
    speed = one["feed_per_rev_mm"] * one["spindle_speed_rpm"] / 60.0
    return None if late_ms is None else max(1e-3 * late_ms, 0.0) * speed


def _quick_rows(points: dict[str, list[Point]]) -> list[Row]:
    """Return our false alarms beside those of each rival at a threshold that makes it as quick as ours."""
    ours = points[OURS][0]
    rows: list[Row] = []
    for rival, name in NAMES.items():
        peer = tally.as_quick(points[rival], ours.p50_ms)
        rate = math.nan if peer is None else peer.per_hour
        rows.append(_row(f"false alarms, beside {name}, as quick (p50)", ours.per_hour, rate, "1/h"))
    return rows


def _alone(ours: Result, alarms: Result, pairs: Result) -> list[Row]:
    """Return what has no peer, beside its goal."""
    names = ("within_1_hz", "at_once_within_1_hz", "truth_within_1_hz")
    near, at_once, stays = (100.0 * ours["frequency"][name] for name in names)
    goals = (
        ("latency p50, beside the goal", ours["latency_ms"]["p50"], 30.0, "ms"),
        ("latency p95, beside the goal", ours["latency_ms"]["p95"], 80.0, "ms"),
        ("latency max, beside the end of the record", ours["latency_ms"]["max"], 1300.0, "ms"),
        ("excess over the least latency p95, beside the goal", ours["excess_ms"]["p95"], 40.0, "ms"),
        ("missed onsets, beside the goal", float(ours["missed"]), 0.0, "1"),
        ("frequency within 1 Hz of the truth 200 ms on, beside the goal", near, 95.0, "%"),
        ("frequency within 1 Hz of the truth 200 ms on, beside the truth until then", near, stays, "%"),
        ("frequency within 1 Hz of the truth until then, beside the goal", at_once, 95.0, "%"),
        (f"false alarms in {alarms['hours']:.3g} h, beside the goal", float(alarms["count"]), 0.0, "1"),
        ("bound of their rate at 95 %, beside that of 20 h without one", alarms["bound_per_hour"], 0.15, "1/h"),
    )
    rows = [_row(what, value, goal, unit) for what, value, goal, unit in goals]
    if pairs["told"] is not None:
        share = 100.0 * pairs["told"] / pairs["together"]
        rows.append(_row("two lines 37 to 40 Hz apart both told within 150 ms, beside the goal", share, 100.0, "%"))
    return rows


def _write_csv(path: pathlib.Path, onsets: Sequence[Result]) -> None:
    left_out = {"ours", "rivals", "population"}
    names = list(dict.fromkeys(name for one in onsets for name in one if name not in left_out))
    with path.open("w", encoding="utf-8", newline="") as file:
        table = csv.DictWriter(file, names, extrasaction="ignore")
        table.writeheader()
        table.writerows(onsets)


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_finite(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
