"""Chatter in a recording: what repeats with the spindle set aside, and the rest judged by what keeps itself up."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chatter.condition import Conditioned, conditioned, repeats
from chatter.episodes import Episode, episodes
from chatter.estimate import Kind
from chatter.forced import Forced, forced_episodes
from chatter.separation import Separated, Stretch, separated, sorted_stretches, stretches_of
from chatter.speed import Speed, confirmed, contradiction, mains

Floats = NDArray[np.float64]

LOWEST_HZ, HIGHEST_HZ = 100.0, 5000.0
"""Band when none is given: below, rooms and drives hum; above, no cutting tool of ordinary size chatters."""
USABLE = 0.45
"""Part of the sampling rate up to which a recorder without a stated filter is trusted."""
SHORTEST, SHORTEST_PERIODS = 0.2, 20.0
"""Least length of a recording (s), and in periods of the lower end of the band."""
WITNESSES = 12
"""Stretches, the loudest, that a stated speed is checked against."""
STEP = 10.0**0.3
"""Ratio of power (3 dB) by which one step of sensitivity lowers every limit."""
MOST_STEPS = 3.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Event:
    """An episode in a recording.

    Parameters
    ----------
    start, end : float
        Time from the start of the recording (s).
    frequency_hz : float
        Frequency of the strongest line (Hz).
    kind : str
        ``regenerative`` or ``forced``.
    confidence : float
        How sure that is, 0...1.
    """

    start: float
    end: float
    frequency_hz: float
    kind: Kind
    confidence: float = 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordingVerdict:
    """What a recording shows.

    Parameters
    ----------
    verdict : str or None
        ``chatter``, ``stable``, or None when the recording cannot tell.
    events : tuple of Event
        Episodes in order of time.
    reason : str or None
        Why there is no verdict.
    notes : tuple of str
        What a reader should know about the verdict.
    confidence : float
        How sure the verdict is, 0...1; 0 without one.
    doubt : str or None
        What makes it less sure.
    """

    verdict: Literal["chatter", "stable"] | None
    events: tuple[Event, ...] = ()
    reason: str | None = None
    notes: tuple[str, ...] = ()
    confidence: float = 0.0
    doubt: str | None = None


def detect_recording(
    signal: ArrayLike,
    sample_rate_hz: float,
    *,
    band_hz: tuple[float, float] | None = None,
    spindle_hz: float | None = None,
    tools: int | None = None,
    sensitivity: float = 0.0,
) -> RecordingVerdict:
    """Judge a recording.

    Chatter is a line that repeats neither with the spindle nor with another machine, keeps its phase for longer than
    any structure rings, is loud, and either began within the recording and holds a good part of what is not forced, or
    holds most of it.

    Parameters
    ----------
    signal : array_like, shape (n,) or (n, channels)
        Samples.
    sample_rate_hz : float
        Sampling rate (Hz).
    band_hz : (float, float) or None
        Band in which chatter is looked for (Hz); None for all that the rate allows.
    spindle_hz : float or None
        Spindle speed (Hz); without it the fundamental of the forced lines is taken from the signal.
    tools : int or None
        Cutting edges that pass per revolution.
    sensitivity : float
        Steps of 3 dB by which every limit is lowered (above 0) or raised (below 0), -3...3.
    """
    samples = _as_samples(signal)
    _check(sample_rate_hz, band_hz, spindle_hz, tools, sensitivity)
    notes: list[str] = []
    times, first = repeats(samples)
    if times > 1:
        samples, sample_rate_hz = samples[first::times], sample_rate_hz / times
        word = "twice" if times == 2 else f"{times} times"
        notes.append(f"every value is stored {word}: taken as sampled at {sample_rate_hz:g} Hz")
    low, high = band_hz if band_hz is not None else (LOWEST_HZ, min(HIGHEST_HZ, USABLE * sample_rate_hz))
    reason = _cannot_tell(samples, sample_rate_hz, low, high, band_hz is None)
    if reason is not None:
        return RecordingVerdict(verdict=None, reason=reason, notes=tuple(notes))
    wide = max(high, min(HIGHEST_HZ, USABLE * sample_rate_hz))  # the forced lines show best in all of the signal
    ready = conditioned(samples, sample_rate_hz, wide)
    parts, speed = _parted(ready, (low, high), spindle_hz, tools)
    found = episodes(parts, ready.sample_rate_hz, STEP**sensitivity)
    if speed.standing == "stated" and _chatters(found):
        alone, _ = _parted(ready, (low, high), None, None)
        other = episodes(alone, ready.sample_rate_hz, STEP**sensitivity)
        if not _chatters(other):  # lines that a speed makes chatter of, which they do not show themselves
            note = f"the signal does not confirm the stated {60.0 * (spindle_hz or 0.0):.6g} 1/min: judged without them"
            parts, found, speed = alone, other, Speed(standing="refuted", notes=(*speed.notes, note))
    forced = forced_episodes(parts, ready.sample_rate_hz)
    return _verdict(found, forced, speed, [*notes, *ready.notes, *speed.notes])


def _as_samples(signal: ArrayLike) -> Floats:
    samples = np.asarray(signal)
    if samples.ndim == 1:
        samples = samples[:, None]
    if samples.ndim != 2 or samples.shape[1] == 0 or not np.issubdtype(samples.dtype, np.number):
        raise ValueError(f"signal must be of numbers, shape (n,) or (n, channels), got {samples.dtype} {samples.shape}")
    if np.iscomplexobj(samples):
        raise ValueError(f"signal must be real, got {samples.dtype}")
    return np.array(samples, dtype=np.float64)


def _check(
    sample_rate_hz: float,
    band_hz: tuple[float, float] | None,
    spindle_hz: float | None,
    tools: int | None,
    sensitivity: float,
) -> None:
    if not (np.isfinite(sample_rate_hz) and sample_rate_hz > 0.0):
        raise ValueError(f"sample_rate_hz must be positive, got {sample_rate_hz}")
    if spindle_hz is not None and not (np.isfinite(spindle_hz) and spindle_hz > 0.0):
        raise ValueError(f"spindle_hz must be positive or None, got {spindle_hz}")
    if band_hz is not None and not 0.0 < band_hz[0] < band_hz[1]:
        raise ValueError(f"band_hz must be (low, high) with 0 < low < high, got {band_hz}")
    if tools is not None and tools < 1:
        raise ValueError(f"tools must be at least 1 or None, got {tools}")
    if not abs(sensitivity) <= MOST_STEPS:
        raise ValueError(f"sensitivity must be in [-{MOST_STEPS:g}, {MOST_STEPS:g}], got {sensitivity}")


def _cannot_tell(samples: Floats, sample_rate_hz: float, low: float, high: float, anywhere: bool) -> str | None:
    """Return why a recording cannot show chatter in a band, None when it can."""
    if anywhere and high < 2.0 * low:
        return f"sampled at {sample_rate_hz:g} Hz, cannot see chatter above {low:g} Hz"
    if high >= 0.5 * sample_rate_hz:
        return f"sampled at {sample_rate_hz:g} Hz, cannot see {low:g}..{high:g} Hz"
    least = max(SHORTEST, SHORTEST_PERIODS / low)
    if len(samples) < least * sample_rate_hz:
        return f"lasts {len(samples) / sample_rate_hz:g} s, at least {least:g} s are needed"
    if not np.isfinite(samples).all(axis=1).any():
        return "holds no finite sample"
    return None


def _parted(
    ready: Conditioned, band_hz: tuple[float, float], spindle_hz: float | None, tools: int | None
) -> tuple[Separated, Speed]:
    """Set the forced lines aside, by the stated speed unless the signal contradicts it."""
    found, length = stretches_of(ready.samples, ready.sample_rate_hz)
    stretches = sorted_stretches(found, band_hz, spindle_hz, tools)
    notes: list[str] = []
    contradicted = None
    if spindle_hz is not None:
        loud = sorted(found, key=lambda f: -float(f[1].power.sum()))[:WITNESSES]
        contradicted = contradiction(sorted_stretches(loud, band_hz, None, None), spindle_hz, tools)
        if contradicted is not None:
            stretches = sorted_stretches(found, band_hz, None, None)
            notes.append(
                f"the stated {60.0 * spindle_hz:.6g} 1/min contradict the signal, whose lines are multiples of"
                f" {contradicted:.2f} Hz: judged without them"
            )
    else:
        notes.append(_unknown_speed(stretches))
    hum = mains(stretches)
    if hum is not None:
        notes.append(f"mains hum at multiples of {hum:g} Hz was set aside")
    parts = separated(ready.samples, ready.sample_rate_hz, band_hz, stretches, length)
    if spindle_hz is None:
        return parts, Speed(standing="unknown", notes=tuple(notes))
    if contradicted is not None:
        return parts, Speed(standing="contradicted", notes=tuple(notes))
    return parts, Speed(standing="confirmed" if confirmed(stretches) else "stated", notes=tuple(notes))


def _chatters(found: Sequence[Episode]) -> bool:
    return any(e.doubt is None for e in found)


def _unknown_speed(stretches: Sequence[Stretch]) -> str:
    combs = [b.fundamental_hz for s in stretches for b in s.bases if b.evidence > 0.0]
    if not combs:
        return "spindle speed unknown, and no forced lines to take it from: less sure"
    return f"spindle speed unknown: forced lines taken for multiples of {float(np.median(combs)):.1f} Hz, less sure"


def _verdict(
    found: Sequence[Episode], forced: Sequence[Forced], speed: Speed, notes: Sequence[str]
) -> RecordingVerdict:
    free = [_event(e, "regenerative", e.share * e.coherence * speed.trust) for e in found if e.doubt is None]
    events = [*free, *(_event(e, "forced", e.share * speed.trust) for e in forced)]
    return RecordingVerdict(
        verdict="chatter" if free else "stable",
        events=tuple(sorted(events, key=lambda e: e.start)),
        notes=tuple(notes),
        confidence=max(e.confidence for e in free) if free else speed.trust,
        doubt=speed.doubt,
    )


def _event(episode: Episode | Forced, kind: Kind, confidence: float) -> Event:
    return Event(
        start=episode.start, end=episode.end, frequency_hz=episode.frequency_hz, kind=kind, confidence=confidence
    )
