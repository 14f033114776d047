"""One cut, heard by all schemes and compared with the truth; the result is plain JSON."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from services.bench.detector.draw import Process, onset_process, pair_process, stable_process
from services.bench.detector.ours import DEFAULT, Said, listen, settings
from services.bench.detector.programme import KINDS, Kind, conditions, programme
from services.bench.detector.rivals import LEVELS, SCHEMES, Scores
from services.bench.detector.stream import Stream, onset_stream, stable_stream
from services.bench.detector.truth import envelope, least_time, onset_sample, true_lines
from services.messages import BLOCK_S
from services.metrics import ONSET_HOLD_S

Result = dict[str, Any]

ALARM_S = 1.0
"""How much of an alarm counts as one."""
TAIL_S, BEHIND_S = 0.2, 0.1
PAIR_S, PAIR_ERROR_HZ = 0.15, 3.0
"""Within so much of the onset two lines must be told, and each so near the true one."""


def onset_trial(seed: int, number: int, turrets: Sequence[str]) -> Result:
    """Return what every scheme made of one onset; `onset_s` is None when the cut never passed the threshold."""
    process = onset_process(seed, number, turrets)
    stream = onset_stream(process)
    result = {"population": "onset", "number": number, **_described(process, stream)}
    sample = onset_sample(stream)
    if sample is None:
        return {**result, "onset_s": None}
    onset, begin = sample / stream.rate, stream.begin / stream.rate
    heard = {
        name: listen(stream, config, until=max(onset, begin), tail_s=TAIL_S)
        for name, config in settings(process.case.monitor).items()
    }
    return {
        **result,
        "onset_s": onset,
        **_judged(stream, heard[DEFAULT], onset),
        "ours": {name: _latency_ms(said.first(begin), onset) for name, said in heard.items()},
        "rivals": {name: _swept(stream, scheme(stream), onset) for name, scheme in SCHEMES.items()},
    }


def _described(process: Process, stream: Stream) -> Result:
    cutting, bar = process.case.cutting, process.case.workpiece
    return {
        "turret": process.turret,
        "axes": process.axes,
        "seed": process.seed,
        "growth_1_s": process.growth,
        "root_hz": process.chatter_hz,
        "rival_root_hz": process.rival_hz if math.isfinite(process.rival_hz) else None,
        "spindle_speed_rpm": 60.0 * cutting.spindle_hz,
        "feed_per_rev_mm": 1e3 * cutting.feed_per_rev,
        "depth_of_cut_mm": 1e3 * cutting.depth_of_cut,
        "cutting_stiffness_n_per_m": cutting.cutting_stiffness,
        "diameter_mm": 1e3 * bar.diameter,
        "length_mm": 1e3 * bar.length,
        "force_noise_n_per_rthz": cutting.force_noise,
        "threshold_um": 1e6 * process.threshold,
        "expected_limit_n": process.case.monitor.expected_limit,
        "begins": "entry" if process.calm == 1.0 else "in the cut",
        "entry_s": stream.entry / stream.rate,
        "growth_from_s": stream.begin / stream.rate,
    }


def _latency_ms(first: tuple[float, Any] | None, onset: float) -> float | None:
    return None if first is None else 1e3 * (first[0] - onset)


def _judged(stream: Stream, said: Said, onset: float) -> Result:
    """Return the numbers of the default setting."""
    process, begin = stream.process, stream.begin / stream.rate
    least = least_time(
        stream.force[:, process.channels], said.limit, stream.rate, process.band_hz,
        latency=stream.latency, begin=begin, onset=onset,
    )  # fmt: skip
    first = said.first(begin)
    early = said.alarm[: round(begin / BLOCK_S)]
    result: Result = {"least_ms": None if least is None else 1e3 * (least - onset), "early_alarms": _count(early)}
    if first is None:
        return {**result, "detected_s": None}
    time, estimate = first
    lines, before = true_lines(stream, time), true_lines(stream, max(time - BEHIND_S, begin), BEHIND_S)
    marked = max(time - onset, 0.0) * process.case.cutting.feed_per_rev * process.case.cutting.spindle_hz
    return {
        **result,
        "detected_s": time,
        "latency_ms": 1e3 * (time - onset),
        "excess_ms": None if least is None else 1e3 * (time - least),
        "marked_mm": 1e3 * marked,
        "frequency_hz": estimate.frequency_hz,
        "true_hz": lines[0] if lines else None,
        "true_before_hz": before[0] if before else None,
        "limit_source": estimate.limit_source,
        "confidence": estimate.confidence,
    }


def alarms_in(times: np.ndarray) -> np.ndarray:
    """Return when alarms begin, given all rising times (s) at which a scheme is in alarm.

    Each counts for one second, and one that goes on counts again: this is the least number of stretches of a second
    that hold them all. So it can only grow when a threshold is lowered; a scheme that never stops has 3600 an hour.
    """
    begins: list[float] = []
    k = 0
    while k < times.size:
        begins.append(float(times[k]))
        k = int(np.searchsorted(times, times[k] + ALARM_S, side="left"))
    return np.array(begins)


def _count(alarm: np.ndarray) -> int:
    return int(alarms_in(np.flatnonzero(alarm) * BLOCK_S).size)


def _swept(stream: Stream, scores: Scores, onset: float) -> Result:
    """Return for each threshold of a rival when it was passed (ms) and how wrong its frequency was then (Hz)."""
    after = np.flatnonzero(scores.time > stream.begin / stream.rate)
    highest = np.maximum.accumulate(scores.score[after]) if after.size else np.zeros(0)
    at = np.searchsorted(highest, LEVELS, side="right")
    wrong = {int(k): _error_hz(stream, scores, int(after[k])) for k in np.unique(at[at < after.size])}
    return {
        "latency_ms": [1e3 * float(scores.time[after[k]] - onset) if k < after.size else None for k in at],
        "error_hz": [wrong.get(int(k)) for k in at],
    }


def _error_hz(stream: Stream, scores: Scores, at: int) -> float | None:
    told, lines = float(scores.frequency_hz[at]), true_lines(stream, float(scores.time[at]))
    return told - lines[0] if lines and math.isfinite(told) else None


def stable_trial(seed: int, number: int, cut_s: float, turrets: Sequence[str], *, sweep: bool = True) -> Result:
    """Return how often each scheme cried wolf in a stable cut; what happens in it goes round by number.

    Parameters
    ----------
    seed, number
        What is drawn.
    cut_s
        Time in the cut (s).
    turrets
        Cases whose turrets take part.
    sweep
        Whether to try our other settings too: each costs as much as the default.
    """
    kind = KINDS[number % len(KINDS)]
    process = stable_process(seed, number, conditions(kind), turrets)
    stream = stable_stream(process, _programme(kind, process, cut_s))
    tried = settings(process.case.monitor)
    heard = {name: listen(stream, config) for name, config in tried.items() if sweep or name == DEFAULT}
    felt = envelope(stream) > 1.0
    return {
        "population": "stable",
        "number": number,
        "kind": kind,
        **_described(process, stream),
        "cut_s": stream.cut_s,
        "simulated_s": len(stream.vibration) / stream.rate,
        "felt": _felt(felt, stream.rate),
        "alarms": _alarms(stream, heard[DEFAULT]),
        "ours": {name: _count(said.alarm) for name, said in heard.items()},
        "rivals": {name: _false(scheme(stream)) for name, scheme in SCHEMES.items()},
    }


def _programme(kind: Kind, process: Process, cut_s: float) -> Any:
    cutting, bar = process.case.cutting, process.case.workpiece
    fastest = 1.2 * cutting.spindle_hz * 1.2 * cutting.feed_per_rev
    return programme(
        kind, np.random.default_rng([process.seed, 13]), cut_s, rate=process.case.settings.sample_rate_hz,
        spindle_hz=cutting.spindle_hz, longest_s=0.4 * bar.length / fastest, circumference=math.pi * bar.diameter,
    )  # fmt: skip


def _felt(above: np.ndarray, rate: float) -> int:
    """Return how often the vibration really was above the threshold for 20 ms."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], above.astype(np.int8), [0]])))
    begins, ends = edges[::2], edges[1::2]
    return int(alarms_in(begins[ends - begins >= ONSET_HOLD_S * rate] / rate).size)


def _alarms(stream: Stream, said: Said) -> list[Result]:
    """Return when and how the default setting alarmed, to see why."""
    loudness = envelope(stream)
    found: list[Result] = []
    for time in alarms_in(np.flatnonzero(said.alarm) * BLOCK_S).tolist():
        block = round(time / BLOCK_S)
        estimate, end = said.estimates[block], (block + 1) * stream.block
        found.append(
            {
                "time_s": time,
                "frequency_hz": estimate.frequency_hz,
                "growth_1_s": estimate.growth,
                "amplitude_n": estimate.amplitude,
                "limit_n": float(said.limit[block]),
                "limit_source": estimate.limit_source,
                "confidence": estimate.confidence,
                "loudness": float(loudness[max(end - 10 * stream.block, 0) : end].max()),
            }
        )
    return found


def _false(scores: Scores) -> list[int]:
    return [int(alarms_in(scores.time[scores.score > level]).size) for level in LEVELS]


def pair_trial(seed: int, number: int, turrets: Sequence[str]) -> Result:
    """Return whether two lines 37 to 40 Hz apart were told within 150 ms of the onset.

    `together` says whether the truth holds both in those 150 ms, the weaker at least half as strong; `told` is None for
    a monitor that reports one line only.
    """
    process = pair_process(seed, number, turrets)
    stream = onset_stream(process)
    result = {"population": "pair", "number": number, **_described(process, stream)}
    sample = onset_sample(stream)
    if sample is None:
        return {**result, "onset_s": None}
    onset = sample / stream.rate
    true = true_lines(stream, onset, PAIR_S)
    said = listen(stream, process.case.monitor, until=onset, tail_s=PAIR_S)
    return {
        **result,
        "onset_s": onset,
        "true_hz": list(true),
        "together": len(true) == 2,
        "told": _told(said, true, stream.begin / stream.rate, onset + PAIR_S),
    }


def _told(said: Said, true: Sequence[float], begin: float, end: float) -> bool | None:
    reports = said.estimates[round(begin / BLOCK_S) : int(end / BLOCK_S)]
    if not hasattr(reports[0], "lines"):
        return None
    for estimate in reports:
        lines = [line.frequency_hz for line in estimate.lines]  # pyright: ignore[reportAttributeAccessIssue]
        if len(lines) >= 2 and all(min(abs(line - hertz) for line in lines) < PAIR_ERROR_HZ for hertz in true):
            return True
    return False
