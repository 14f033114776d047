"""When a free line is chatter: loud, coherent, the greater part of what does not repeat, and for long enough."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter, uniform_filter1d

from chatter.coherence import COHERENT, Track, followed, predicted_over
from chatter.separation import Separated, line_during

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]
Doubt = Literal[
    "short", "incoherent", "weaker than forced vibration", "follows a speed", "dies away", "there without the cut"
]

GRID = 0.01
"""Grid in time (s)."""
SMOOTH, SLOW = 0.1, 0.5
"""Time over which energies are compared (s), and over which the level of a cut is (s)."""
BEGAN, RISEN = 0.3, 4.0
"""Part of all free energy that lines hold which were weaker before, by this ratio of power (6 dB)."""
ALONE, PART = 0.7, 0.33
"""Part of all free energy, and of all energy, that one line and its kin hold when nothing shows that they began:
machines have tones of their own, and the loudest of them must not count."""
LOUD = 0.1
"""Power over that of the loud parts of the recording (its upper tenth): chatter is loud, or it is none."""
MATERIAL = 0.1
"""Power over that of the forced lines within an octave to either side (-10 dB)."""
PAUSE = 0.3
"""Pause that does not end an episode (s)."""
LEAST, LEAST_PERIODS, LEAST_PART = 0.25, 2.5, 0.6
"""Least time with chatter: seconds, times the time of prediction, and the part of a recording that is enough."""
TALL, TALL_FOR = 0.25, 0.25
"""Part of its largest power (-6 dB) and time (s) for which a line must stand above it: a blow is shorter."""
STRONG, SURE = 0.25, 0.7
"""A line is strong above this part of its power in the episode, and must be coherent for this part of that time."""
MOVES, STRAIGHT, MOVES_FOR = 0.005, 0.9, 0.4
"""Relative change per second, its straightness (R squared) and length (s), from which a line follows a speed."""
FALLS, RINGS = 1.4, 0.001
"""Fall of the logarithm of power (6 dB) within an episode, and damping, from which a line that falls is a ring."""
STEP, SAME = 5.0, 2.0
"""A line whose power stays within the second ratio while all else changes by the first does not come from the cut."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Episode:
    """A stretch in which a free line dominates.

    Parameters
    ----------
    start, end : float
        Time from the start (s).
    frequency_hz : float
        Frequency of the strongest line (Hz).
    share : float
        Part of the free energy that coherent lines hold, 0...1.
    coherence : float
        Part of the time that the line is strong in which it is coherent, 0...1.
    began : bool
        Whether it was seen to begin or end.
    doubt : str or None
        Why it is no chatter.
    """

    start: float
    end: float
    frequency_hz: float
    share: float
    coherence: float
    began: bool
    doubt: Doubt | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class _Energies:
    """Energies on the grid, and the lines that hold them."""

    time: Floats
    free: Floats
    rest: Floats
    whole: Floats
    loud: float
    tracks: list[Track]
    coherent: Floats
    """Power of every line where it is coherent, shape (lines, n)."""
    risen: Flags
    """Where a line is stronger than in its quiet tenth, shape (lines, n)."""


def episodes(parts: Separated, sample_rate_hz: float, ease: float = 1.0) -> list[Episode]:
    """Return the episodes in which free lines dominate, in order of time; those with a doubt are no chatter.

    Parameters
    ----------
    parts : Separated
        The recording.
    sample_rate_hz : float
        Sampling rate (Hz).
    ease : float
        Ratio by which the limits on power are lowered.
    """
    energies = _energies(parts, sample_rate_hz)
    if not energies.tracks:
        return []
    total = energies.coherent.sum(axis=0)
    risen = np.where(energies.risen, energies.coherent, 0.0).sum(axis=0)
    kin = _kin(energies, parts)
    began = _holds(risen, energies.free, BEGAN, ease)
    alone = _holds(kin, energies.free, ALONE, ease) & _holds(kin, energies.whole, PART, ease)
    on = (began | alone) & (total * ease >= LOUD * energies.loud) & (total > 0.0)
    ranges = spans(on)
    leads = [int(np.argmax(energies.coherent[:, a:b].sum(axis=1))) for a, b in ranges]
    out = []
    for (a, b), lead in zip(ranges, leads, strict=True):
        held = GRID * sum(d - c for (c, d), other in zip(ranges, leads, strict=True) if other == lead)
        out.append(_judged(energies, parts, sample_rate_hz, (a, b), lead, held, ease))
    return out


def _holds(power: Floats, whole: Floats, part: float, ease: float) -> Flags:
    """Return where a power holds a part of the whole; the ease is one of the ratio to what is left."""
    return np.asarray(power * ease * (1.0 - part) >= part * (whole - power), dtype=np.bool_)


def _energies(parts: Separated, sample_rate_hz: float) -> _Energies:
    step = max(round(GRID * sample_rate_hz), 1)
    count = len(parts.free) // step
    time = np.asarray((np.arange(count) + 0.5) * step / sample_rate_hz, dtype=np.float64)
    size = max(round(SMOOTH / GRID), 1)
    levels = []
    for signal in (parts.free, parts.rest, parts.whole):
        square = (signal[: count * step] ** 2).sum(axis=1).reshape(count, step).mean(axis=1)
        levels.append(np.asarray(uniform_filter1d(square, size, mode="nearest")))
    tracks = [followed(parts.free, sample_rate_hz, c, time, parts.turn) for c in parts.candidates_hz]
    power = np.array([t.power for t in tracks]).reshape(len(tracks), count)
    sure = np.array([t.coherence >= COHERENT for t in tracks]).reshape(len(tracks), count)
    slow = uniform_filter1d(power, max(round(SLOW / GRID), 1), axis=1, mode="nearest") if power.size else power
    quiet = np.quantile(slow, 0.1, axis=1, keepdims=True) if power.size else power
    return _Energies(
        time=time,
        free=np.maximum(levels[0], np.finfo(np.float64).tiny),
        rest=levels[1],
        whole=np.maximum(levels[2], levels[0]),
        loud=float(np.quantile(levels[2], 0.9)) if count else 0.0,
        tracks=tracks,
        coherent=np.where(sure, power, 0.0),
        risen=power > RISEN * quiet,
    )


def _kin(energies: _Energies, parts: Separated) -> Floats:
    """Return the power of the strongest line with its harmonics and its sidebands at every time."""
    lead = np.argmax(energies.coherent, axis=0)
    centres = np.array([t.centre_hz for t in energies.tracks])
    distance = 1.0 / parts.turn if parts.turn is not None else 0.0
    kin = np.zeros(len(lead))
    for k, centre in enumerate(centres):
        family = np.zeros(len(centres), dtype=bool)
        for harmonic in (1, 2, 3):
            away = centres - harmonic * centre
            slack = 1.0 + 0.001 * centres
            family |= np.abs(away) <= slack
            if distance > 20.0 * slack.max():
                family |= np.abs(away - distance * np.round(away / distance)) <= slack
        kin = np.where(lead == k, energies.coherent[family].sum(axis=0), kin)
    return kin


def spans(on: Flags) -> list[tuple[int, int]]:
    """Return first and one past the last index of every run of true on the grid, short pauses bridged.

    Parameters
    ----------
    on : ndarray, shape (n,)
        Flags.
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[0], on.astype(int), [0]])))
    found: list[tuple[int, int]] = []
    for a, b in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        if found and (a - found[-1][1]) * GRID <= PAUSE:
            found[-1] = (found[-1][0], b)
        else:
            found.append((a, b))
    return found


def _judged(
    energies: _Energies,
    parts: Separated,
    sample_rate_hz: float,
    span: tuple[int, int],
    lead: int,
    held: float,
    ease: float,
) -> Episode:
    a, b = span
    track = energies.tracks[lead]
    weight = energies.coherent[lead, a:b]
    frequency = float(np.average(track.frequency_hz[a:b], weights=weight))
    frequency = line_during(parts, sample_rate_hz, (a * GRID, b * GRID), forced=False, near_hz=frequency) or frequency
    total = energies.coherent[:, a:b].sum(axis=0)
    power = float(np.median(total))
    strong = track.power >= STRONG * float(np.quantile(track.power[a:b], 0.75))
    coherence = float((track.coherence[strong] >= COHERENT).mean()) if strong.any() else 0.0
    least = min(max(LEAST, LEAST_PERIODS * predicted_over(frequency)), LEAST_PART * GRID * len(energies.time))
    doubt: Doubt | None = None
    tall = GRID * float((track.power[a:b] >= TALL * track.power[a:b].max()).sum())
    if held < least or tall < min(TALL_FOR, least):
        doubt = "short"
    elif coherence < SURE:
        doubt = "incoherent"
    elif power * ease < MATERIAL * _forced(parts, sample_rate_hz, (a * GRID, b * GRID), frequency):
        doubt = "weaker than forced vibration"
    elif _moves(energies, span):
        doubt = "follows a speed"
    elif _rings(energies, span, lead):
        doubt = "dies away"
    elif _is_apart(energies, span, lead):
        doubt = "there without the cut"
    return Episode(
        start=a * GRID if a > 5 else 0.0,
        end=b * GRID if b < len(energies.time) - 5 else len(parts.free) / sample_rate_hz,
        frequency_hz=frequency,
        share=float(np.clip(power / np.median(energies.free[a:b]), 0.0, 1.0)),
        coherence=coherence,
        began=bool(energies.risen[lead, a:b].mean() > 0.5),
        doubt=doubt,
    )


def _forced(parts: Separated, sample_rate_hz: float, span: tuple[float, float], frequency_hz: float) -> float:
    """Return the mean power of the forced lines within an octave of a line during an episode."""
    powers = []
    for s in parts.stretches:
        start = s.first / sample_rate_hz
        if start < span[1] and start + parts.length / sample_rate_hz > span[0]:
            near = s.forced & (np.abs(np.log2(s.lines.frequency_hz / frequency_hz)) < 1.0)
            powers.append(float(s.lines.power[near].sum()))
    return float(np.mean(powers)) if powers else 0.0


def _moves(energies: _Energies, span: tuple[int, int]) -> bool:
    """Return whether the line glides, as one that follows the speed of a machine does."""
    a, b = span
    coherent = energies.coherent[:, a:b]
    lead = np.argmax(coherent, axis=0)
    seen = coherent.max(axis=0) > 0.0
    if seen.sum() * GRID < MOVES_FOR:
        return False
    frequency = np.array([t.frequency_hz[a:b] for t in energies.tracks])[lead, np.arange(b - a)][seen]
    time = energies.time[a:b][seen]
    slope, start = np.polyfit(time, frequency, 1)
    left = float(np.var(frequency - start - slope * time))
    straight = 1.0 - left / max(float(np.var(frequency)), np.finfo(np.float64).tiny)
    return bool(abs(slope) > MOVES * frequency.mean() and straight > STRAIGHT)


def _rings(energies: _Energies, span: tuple[int, int], lead: int) -> bool:
    """Return whether the line falls all the time, as a structure does that was knocked at."""
    power = energies.tracks[lead].power[span[0] : span[1]]
    peak = int(np.argmax(power))
    if peak > 0.4 * len(power) or len(power) - peak < 5:
        return False
    level = np.log(np.maximum(power[peak:], np.finfo(np.float64).tiny))
    time = energies.time[span[0] + peak : span[1]]
    slope, start = np.polyfit(time, level, 1)
    left = float(np.var(level - start - slope * time))
    fast = slope < -2.0 * RINGS * 2.0 * np.pi * energies.tracks[lead].centre_hz
    falls = fast and slope * (time[-1] - time[0]) < -FALLS
    return bool(falls and left < (1.0 - STRAIGHT) * float(np.var(level)))


def _is_apart(energies: _Energies, span: tuple[int, int], lead: int) -> bool:
    """Return whether the line keeps its level while a cut that is as loud begins or ends."""
    size = max(round(SLOW / GRID), 1)
    power = np.asarray(uniform_filter1d(energies.tracks[lead].power, size, mode="nearest"))
    rest = np.asarray(median_filter(energies.rest, size, mode="nearest"))  # a knock is no cut
    level = float(np.median(power[span[0] : span[1]]))
    same = (power > level / SAME) & (power < level * SAME) & (energies.coherent[lead] > 0.0)
    if not same.any():
        return False
    power, rest = power[same], np.maximum(rest[same], 1e-3 * level)
    high, low = rest >= np.quantile(rest, 0.7), rest <= np.quantile(rest, 0.3)
    step = float(np.median(rest[high]) / np.median(rest[low]))
    return step > STEP and float(np.median(rest[high])) > 0.5 * level
