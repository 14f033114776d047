"""A recording parted into what repeats with the spindle and what does not."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from chatter.lines import Lines, hann, lines_of
from chatter.sorting import Base, Sorted, sort_lines

Floats = NDArray[np.float64]

STRETCH = 1.0
"""Length of the stretches whose lines are sorted (s): 1 Hz apart, and spindles keep their speed for as long."""
LOWEST_HZ = 15.0
"""Lowest line that may take part in a comb (Hz)."""
NEAR, NEAR_HZ = 0.015, 8.0
"""Part of its frequency, and least distance (Hz), within which a line may wander and still be the same."""
CANDIDATES = 8
"""Free lines that are followed through the recording."""
FAINT = 0.03
"""Power of a free line over that of the strongest, below which it is not followed."""
SILENT = 0.02
"""Power of the lines over that in the loud tenth of a recording, below which a stretch is not looked at."""
SEEN = 2
"""Stretches in which a fundamental must be found to be known in all."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Stretch:
    """One stretch of a recording with its lines.

    Parameters
    ----------
    first : int
        Index of its first sample.
    lines : Lines
        Its lines.
    forced : ndarray, shape (n,)
        Which of them repeat with the spindle.
    bases : tuple of Base
        What that was told by.
    """

    first: int
    lines: Lines
    forced: NDArray[np.bool_]
    bases: tuple[Base, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Separated:
    """A recording without its forced lines.

    Parameters
    ----------
    free : ndarray, shape (n, channels)
        The band of the recording without forced lines.
    rest : ndarray, shape (n, channels)
        All but the candidates, what is below the band too.
    whole : ndarray, shape (n, channels)
        The band with them.
    stretches : tuple of Stretch
        Half-overlapping stretches in order of time.
    length : int
        Samples in a stretch.
    band_hz : (float, float)
        Band of interest (Hz).
    candidates_hz : tuple of float
        Free lines, the strongest first (Hz).
    turn : float or None
        Time of a revolution or a tooth (s), when the lines tell or it is stated.
    """

    free: Floats
    rest: Floats
    whole: Floats
    stretches: tuple[Stretch, ...]
    length: int
    band_hz: tuple[float, float]
    candidates_hz: tuple[float, ...]
    turn: float | None


def stretches_of(signal: Floats, sample_rate_hz: float) -> tuple[list[tuple[int, Lines]], int]:
    """Return first samples and lines of half-overlapping stretches, and their length in samples.

    Parameters
    ----------
    signal : ndarray, shape (n, channels)
        The recording.
    sample_rate_hz : float
        Sampling rate (Hz).
    """
    length = min(round(STRETCH * sample_rate_hz), len(signal))
    firsts = list(range(0, len(signal) - length + 1, max(length // 2, 1)))
    if firsts[-1] + length < len(signal):
        firsts.append(len(signal) - length)
    return [(k, lines_of(signal[k : k + length], sample_rate_hz, LOWEST_HZ)) for k in firsts], length


def sorted_stretches(
    found: list[tuple[int, Lines]], band_hz: tuple[float, float], spindle_hz: float | None, tools: int | None
) -> tuple[Stretch, ...]:
    """Return the stretches with their lines sorted, what some know being used in all.

    Parameters
    ----------
    found : list of (int, Lines)
        First sample and lines of every stretch.
    band_hz : (float, float)
        Band of interest (Hz).
    spindle_hz : float or None
        Stated speed (Hz).
    tools : int or None
        Cutting edges that pass per revolution.
    """
    loud = _loud([lines for _, lines in found], band_hz)
    nothing = [Sorted(forced=np.zeros(len(lines.power), dtype=bool), bases=()) for _, lines in found]
    first = [
        sort_lines(lines, band_hz, spindle_hz=spindle_hz, tools=tools) if is_loud else empty
        for (_, lines), is_loud, empty in zip(found, loud, nothing, strict=True)
    ]
    known = _known(first)
    again = [
        sort_lines(lines, band_hz, spindle_hz=spindle_hz, tools=tools, known_hz=known)
        if is_loud and known and not _has(done, known)
        else done
        for (_, lines), is_loud, done in zip(found, loud, first, strict=True)
    ]
    return tuple(
        Stretch(first=k, lines=lines, forced=s.forced, bases=s.bases)
        for (k, lines), s in zip(found, again, strict=True)
    )


def _loud(lines: Sequence[Lines], band_hz: tuple[float, float]) -> Sequence[bool]:
    """Return which stretches are loud enough to hold chatter."""
    power = np.array([x.power[(x.frequency_hz >= band_hz[0]) & (x.frequency_hz <= band_hz[1])].sum() for x in lines])
    return [bool(loud) for loud in power >= SILENT * np.quantile(power, 0.9)]


def _has(done: Sorted, known: Sequence[float]) -> bool:
    """Return whether a stretch shows all that others know."""
    found = np.array([b.fundamental_hz for b in done.bases] or [0.0])
    return all((np.abs(found / k - 1.0) < 0.01).any() for k in known) or bool(done.forced.all())


def _known(done: Sequence[Sorted]) -> list[float]:
    """Return the fundamentals that several stretches agree on."""
    every = np.array([b.fundamental_hz for s in done for b in s.bases if b.source == "comb" and b.evidence > 0.0])
    known: list[float] = []
    while every.size:
        alike = np.abs(every[:, None] / every - 1.0) < 0.01
        best = int(np.argmax(alike.sum(axis=1)))
        if alike[best].sum() < SEEN:
            break
        known.append(float(np.median(every[alike[best]])))
        every = every[~alike[best]]
    return known


def separated(
    signal: Floats, sample_rate_hz: float, band_hz: tuple[float, float], stretches: tuple[Stretch, ...], length: int
) -> Separated:
    """Return the band of a recording with and without its forced lines.

    A line that is free in most of what is seen of it is free in all: chatter may drift over a harmonic.

    Parameters
    ----------
    signal : ndarray, shape (n, channels)
        The recording.
    sample_rate_hz : float
        Sampling rate (Hz).
    band_hz : (float, float)
        Band of interest (Hz).
    stretches : tuple of Stretch
        Its stretches.
    length : int
        Samples in a stretch.
    """
    candidates = _candidates(stretches, band_hz)
    free, rest, whole = (np.zeros_like(signal) for _ in range(3))
    weight = np.zeros(len(signal))
    window = hann(length)
    kept: list[Stretch] = []
    for s in stretches:
        near = [np.abs(s.lines.frequency_hz - c) <= reach(c) for c in candidates]
        forced = s.forced & ~np.any(near, axis=0) if near else s.forced
        kept.append(Stretch(first=s.first, lines=s.lines, forced=forced, bases=s.bases))
        part = slice(s.first, s.first + length)
        spectrum = s.lines.spectrum.copy()
        without = spectrum.copy()
        without[: int(LOWEST_HZ / s.lines.spacing_hz)] = 0.0
        for c in candidates:
            bins = slice(int((c - reach(c)) / s.lines.spacing_hz), int((c + reach(c)) / s.lines.spacing_hz) + 1)
            without[bins] = 0.0
        spectrum[: int(np.ceil(band_hz[0] / s.lines.spacing_hz))] = 0.0
        spectrum[int(band_hz[1] / s.lines.spacing_hz) + 1 :] = 0.0
        whole[part] += np.fft.irfft(spectrum, length, axis=0)
        rest[part] += np.fft.irfft(without, length, axis=0)
        for first, last in zip(s.lines.first[forced], s.lines.last[forced], strict=True):
            spectrum[first : last + 1] = 0.0
        free[part] += np.fft.irfft(spectrum, length, axis=0)
        weight[part] += window
    scale = np.where(weight > 0.05, 1.0 / np.maximum(weight, 0.05), 0.0)[:, None]
    return Separated(
        free=free * scale,
        rest=rest * scale,
        whole=whole * scale,
        stretches=tuple(kept),
        length=length,
        band_hz=band_hz,
        candidates_hz=tuple(candidates),
        turn=_turn(stretches),
    )


def _turn(stretches: Sequence[Stretch]) -> float | None:
    """Return the time of a revolution (s): the stated one, or the slowest that the lines agree on."""
    bases = [b for s in stretches for b in s.bases]
    told = [b.fundamental_hz for b in bases if b.source == "stated"]
    found = told or [b.fundamental_hz for b in bases if b.source == "sidebands"]
    return 1.0 / float(np.median(found)) if found else None


def reach(frequency_hz: float) -> float:
    """Return how far a line may wander and still be the same (Hz).

    Parameters
    ----------
    frequency_hz : float
        Its frequency (Hz).
    """
    return max(NEAR * frequency_hz, NEAR_HZ)


def line_during(
    parts: Separated, sample_rate_hz: float, span: tuple[float, float], *, forced: bool, near_hz: float | None = None
) -> float | None:
    """Return the frequency of the strongest line of a kind in the band during a time (Hz), None without one.

    Parameters
    ----------
    parts : Separated
        The recording.
    sample_rate_hz : float
        Sampling rate (Hz).
    span : (float, float)
        The time (s).
    forced : bool
        Whether a forced or a free line is asked for.
    near_hz : float or None
        About where the line is (Hz); None for the strongest.
    """
    found: list[tuple[Floats, Floats]] = []
    for s in parts.stretches:
        begin = s.first / sample_rate_hz
        if begin < span[1] and begin + parts.length / sample_rate_hz > span[0]:
            line = s.lines.frequency_hz
            inside = (s.forced == forced) & (line >= parts.band_hz[0]) & (line <= parts.band_hz[1])
            if inside.any():
                found.append((line[inside], s.lines.power[inside]))
    if not found:
        return None
    if near_hz is None:
        frequency, power = max(found, key=lambda lines: float(lines[1].max()))
        near_hz = float(frequency[np.argmax(power)])
    close = [np.where(np.abs(frequency - near_hz) <= reach(near_hz), power, 0.0) for frequency, power in found]
    at = np.array([frequency[np.argmax(near)] for (frequency, _), near in zip(found, close, strict=True)])
    power = np.array([near.max() for near in close])
    if power.max() <= 0.0:
        return None
    order = np.argsort(at)
    half = np.searchsorted(np.cumsum(power[order]), 0.5 * power.sum())  # the median by energy: lines drift
    return float(at[order[half]])


def _candidates(stretches: Sequence[Stretch], band_hz: tuple[float, float]) -> list[float]:
    """Return the free lines that hold most, and more than what is forced near them."""
    frequency = np.concatenate([s.lines.frequency_hz for s in stretches])
    power = np.concatenate([s.lines.power for s in stretches])
    free = ~np.concatenate([s.forced for s in stretches])
    left = np.where(free & (frequency >= band_hz[0]) & (frequency <= band_hz[1]), power, 0.0)
    found: list[tuple[float, float]] = []
    for _ in range(CANDIDATES):
        if not left.size or left.max() <= 0.0:
            break
        peak = frequency[np.argmax(left)]
        near = free & (np.abs(frequency - peak) <= reach(peak))
        centre = float(np.average(frequency[near], weights=power[near]))
        near = np.abs(frequency - centre) <= reach(centre)
        left[(np.abs(frequency - centre) <= 1.5 * reach(centre)) | (np.abs(frequency - peak) <= 0.5 * reach(peak))] = (
            0.0
        )
        if power[near & free].sum() > power[near & ~free].sum():
            found.append((centre, float(power[near & free].sum())))
    strongest = max((p for _, p in found), default=0.0)
    return [c for c, p in sorted(found, key=lambda e: -e[1]) if p >= FAINT * strongest]
