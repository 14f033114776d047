"""Which estimator the closed loop should take: each on the same cuts, and what a sample of it costs."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from services.bench.rounds import Say, interleaved, silent
from services.case_settings import ESTIMATORS
from services.clock import WallClock
from services.closed_loop import run_case
from services.config import load_case
from services.estimator import estimated_force, force_observer

Row = dict[str, Any]
DEFAULT = "standing"
BLOCK = 90


def measure(
    *, seeds: int = 5, case: str = "thesis-652", blocks: int = 400, names: Sequence[str] = ESTIMATORS, say: Say = silent
) -> list[Row]:
    """Return the rows of the table: detection, false moves and cost of every estimator beside the default.

    Parameters
    ----------
    seeds
        Cuts of the case for each estimator.
    case
        The case.
    blocks
        Blocks that each is timed over.
    names
        Estimators; the default is one of them.
    say
        Told what is measured.
    """
    found: dict[str, tuple[float, float, float]] = {}
    for name in names:
        say(name)
        found[name] = _cuts(name, case, seeds)
    taken, _ = interleaved({name: _streaming(name, case, blocks) for name in names}, 5, WallClock())
    cost = {name: 1e9 * seconds / (blocks * BLOCK * 2) for name, seconds in taken.items()}
    rows: list[Row] = []
    for name in names:
        share, latency, moves = found[name]
        _, usual, usual_moves = found[DEFAULT]
        rows += [
            _row(f"{name}: chatter ended, share of {seeds} cuts", share, found[DEFAULT][0], "1"),
            _row(f"{name}: detected after onset, median", latency, usual, "ms"),
            _row(f"{name}: moves of the turret, mean", moves, usual_moves, "1"),
            _row(f"{name}: cost of a sample and axis", cost[name], cost[DEFAULT], "ns"),
        ]
    return rows


def _row(what: str, ours: float, peer: float, unit: str) -> Row:
    ratio = ours / peer if peer and math.isfinite(ours) else math.nan
    return {"case": what, "ours": ours, "peer": peer, "ratio": ratio, "unit": unit}


def _cuts(name: str, case: str, seeds: int) -> tuple[float, float, float]:
    """Return the share of cuts in which chatter ended, the median latency (ms) and the mean number of moves."""
    known = load_case(case, {"case.force_estimator": name})
    done = [run_case(known, seed + 1, WallClock()).summary for seed in range(seeds)]
    late = [math.inf if one.detection_latency_s is None else 1e3 * one.detection_latency_s for one in done]
    ended = [one.outcome in ("suppressed", "prevented") for one in done]
    return float(np.mean(ended)), float(np.median(late)), float(np.mean([one.moves for one in done]))


def _streaming(name: str, case: str, blocks: int) -> Callable[[], None]:
    """Return what estimates as many blocks, one call each."""
    observer = force_observer(load_case(case, {"case.force_estimator": name}))
    rng = np.random.default_rng(1)
    motor, stage = (np.cumsum(1e-9 * rng.standard_normal((BLOCK, 2)), axis=0) for _ in range(2))
    thrust = rng.standard_normal(BLOCK)
    observer.prepare()

    def run() -> None:
        for _ in range(blocks):
            estimated_force(observer, (thrust, thrust), motor, stage)

    return run
