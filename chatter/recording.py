"""Chatter in a recording: the monitor over a wide band, and its estimates joined to episodes."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.signal import resample_poly

from chatter.comb import comb_of
from chatter.dominance import floor_of
from chatter.episodes import Episode, episodes, joined
from chatter.estimate import Kind, MonitorConfig
from chatter.monitor import ChatterMonitor

Floats = NDArray[np.float64]

LOWEST_HZ, HIGHEST_HZ = 100.0, 5000.0
"""Band when none is given: below, rooms and drives hum; above, no cutting tool of ordinary size chatters."""
USABLE = 0.4
"""Part of the sampling rate up to which a recorder without a stated filter is trusted."""
KERNEL = 10
"""Half length of the kernel of `scipy.signal.resample_poly` in samples of the lower rate."""
MOST_SPECTRA = 6000
"""Spectra of which the quiet ones are taken: enough, and 25 MB."""
WINDOW = 0.1
"""Window of detection (s)."""
HARMONIC_BINS, LONGEST = 5.0, 0.5
"""Bins from one harmonic of the spindle to the next, so that something fits between them; and the longest window."""
QUIET = 0.1
"""Part of the recording, bin by bin, that is taken to hold no chatter."""
STEADY = 2.0
"""A recording whose mean square varies less (3 dB) has no idle part: what is there may have been there all along."""
DOMINANCE = 0.5
"""Chatter holds more energy than all other lines together; cf. the energy ratios of chatter to periodic vibration."""


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
    """

    start: float
    end: float
    frequency_hz: float
    kind: Kind


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
    """

    verdict: Literal["chatter", "stable"] | None
    events: tuple[Event, ...] = ()
    reason: str | None = None
    notes: tuple[str, ...] = ()


def detect_recording(
    signal: ArrayLike,
    sample_rate_hz: float,
    *,
    band_hz: tuple[float, float] | None = None,
    spindle_hz: float | None = None,
    tools: int | None = None,
) -> RecordingVerdict:
    """Judge a recording.

    Chatter is a line that is no harmonic of the spindle, stands still for three windows and either began within the
    recording and holds more energy than all other lines, or holds more than all the rest of the band together.

    Parameters
    ----------
    signal : array_like, shape (n,) or (n, channels)
        Samples.
    sample_rate_hz : float
        Sampling rate (Hz).
    band_hz : (float, float) or None
        Band in which chatter is looked for (Hz); None for all that the rate allows.
    spindle_hz : float or None
        Spindle speed (Hz); tells harmonics of the spindle from chatter.
    tools : int or None
        Cutting edges that pass per revolution.
    """
    samples = _as_samples(signal)
    if not (np.isfinite(sample_rate_hz) and sample_rate_hz > 0.0):
        raise ValueError(f"sample_rate_hz must be positive, got {sample_rate_hz}")
    if spindle_hz is not None and not (np.isfinite(spindle_hz) and spindle_hz > 0.0):
        raise ValueError(f"spindle_hz must be positive or None, got {spindle_hz}")
    low, high = band_hz if band_hz is not None else (LOWEST_HZ, min(HIGHEST_HZ, USABLE * sample_rate_hz))
    if band_hz is None and high < 2.0 * low:
        return RecordingVerdict(
            verdict=None, reason=f"sampled at {sample_rate_hz:g} Hz, cannot see chatter above {low:g} Hz"
        )
    config = _configuration(low, high, spindle_hz, tools)
    if high >= 0.5 * sample_rate_hz:
        return RecordingVerdict(
            verdict=None, reason=f"sampled at {sample_rate_hz:g} Hz, cannot see {low:g}..{high:g} Hz"
        )
    if len(samples) < 2.0 * config.window * sample_rate_hz:
        least = 2.0 * config.window
        return RecordingVerdict(
            verdict=None, reason=f"lasts {len(samples) / sample_rate_hz:g} s, at least {least:g} s are needed"
        )
    notes = []
    if not np.isfinite(samples).all():
        notes.append(f"{int((~np.isfinite(samples)).any(axis=1).sum())} samples are not finite and were left out")
    if not np.isfinite(samples).all(axis=1).any():
        return RecordingVerdict(verdict=None, reason="holds no finite sample", notes=tuple(notes))
    thin, rate = _thinned(samples, sample_rate_hz, high)
    events = tuple(_judged(thin, rate, config, spindle_hz))
    if spindle_hz is None:
        notes.append("spindle speed unknown: forced vibration is told from chatter by its many lines only")
    chatters = any(e.kind == "regenerative" for e in events)
    return RecordingVerdict(verdict="chatter" if chatters else "stable", events=events, notes=tuple(notes))


def _as_samples(signal: ArrayLike) -> Floats:
    samples = np.asarray(signal)
    if samples.ndim == 1:
        samples = samples[:, None]
    if samples.ndim != 2 or samples.shape[1] == 0 or not np.issubdtype(samples.dtype, np.number):
        raise ValueError(f"signal must be of numbers, shape (n,) or (n, channels), got {samples.dtype} {samples.shape}")
    if np.iscomplexobj(samples):
        raise ValueError(f"signal must be real, got {samples.dtype}")
    return np.array(samples, dtype=np.float64)


def _configuration(low: float, high: float, spindle_hz: float | None, tools: int | None) -> MonitorConfig:
    if not 0.0 < low < high:
        raise ValueError(f"band_hz must be (low, high) with 0 < low < high, got {(low, high)}")
    window = max(WINDOW, 10.0 / low, 16.0 / (high - low), min(HARMONIC_BINS / (spindle_hz or np.inf), LONGEST))
    return MonitorConfig(
        band_hz=(low, high),
        window=window,
        refine_window=max(1.0, 2.0 * window),
        air_time=window,
        memory_time=1e5,
        dominance=DOMINANCE,
        tools=1 if tools is None else tools,
    )


def _thinned(samples: Floats, sample_rate_hz: float, high: float) -> tuple[Floats, float]:
    """Return the signal scaled to at most 2, at the lowest rate that keeps the band, not finite where it was not."""
    good = np.asarray(np.isfinite(samples).all(axis=1))
    filled = np.where(good[:, None], samples, 0.0)
    largest = float(np.abs(filled).max(initial=0.0))
    if largest > 0.0:
        filled = np.ldexp(filled, -int(np.floor(np.log2(largest))))
    step = max(int(sample_rate_hz / (2.5 * high)), 1)
    thin = np.asarray(resample_poly(filled, 1, step, axis=0, padtype="line") if step > 1 else filled, dtype=np.float64)
    bad = np.zeros(len(thin), dtype=bool)
    bad[np.flatnonzero(np.logical_not(good)) // step] = True
    reach = np.ones(2 * KERNEL + 1)
    thin[np.convolve(bad, reach)[KERNEL : KERNEL + len(thin)] > 0.5] = np.nan
    return thin, sample_rate_hz / step


def _judged(signal: Floats, rate: float, config: MonitorConfig, spindle_hz: float | None) -> list[Event]:
    """Ask the monitor, set forced vibration aside, and ask again without it."""
    monitor = ChatterMonitor(config, rate, signal.shape[1])
    reach = 1.5 / config.window
    _assume_quiet(monitor, signal)
    quiet = monitor.snapshot()
    found = episodes(monitor.process(signal, 0, spindle_hz=spindle_hz), rate, config.window)
    combs = [comb_of(signal, rate, e.start, e.end, e.frequency_hz, reach) for e in found]
    events = [_event(e, "forced") for e, base in zip(found, combs, strict=True) if base is not None]
    if events:
        monitor.restore(quiet)
        base = min(base for base in combs if base is not None)
        found = episodes(monitor.process(signal, 0, spindle_hz=base), rate, config.window)
        found = [e for e in found if comb_of(signal, rate, e.start, e.end, e.frequency_hz, reach) is None]
    events += [_event(e, "regenerative") for e in joined(found, config.window)]
    return sorted(events, key=lambda e: e.start)


def _event(episode: Episode, kind: Kind) -> Event:
    return Event(start=episode.start, end=episode.end, frequency_hz=episode.frequency_hz, kind=kind)


def _assume_quiet(monitor: ChatterMonitor, signal: Floats) -> None:
    """Take the quiet tenth of every bin for the signal without chatter."""
    every = len(signal) // (monitor.block * MOST_SPECTRA) + 1
    power, square = monitor.levels(signal, every)
    windows = len(power) * every * monitor.config.block / monitor.config.window
    if windows < 1.0 / QUIET:
        return
    low, loud = (float(np.quantile(square, q)) for q in (QUIET, 1.0 - QUIET))
    quiet = np.quantile(power, QUIET, axis=0, overwrite_input=True)
    noise = floor_of(quiet) * np.log(2.0) / -np.log1p(-QUIET)  # a quantile q of noise stands -ln(1 - q) means high
    monitor.assume(np.maximum(quiet, noise), 0.0 if loud < STEADY * low else low, windows)
