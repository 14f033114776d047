"""Chatter in a recording: the monitor over a wide band, and its estimates joined to episodes."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from chatter.estimate import Kind


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

    Parameters
    ----------
    signal : array_like, shape (n,) or (n, channels)
        Samples.
    sample_rate_hz : float
        Sampling rate (Hz).
    band_hz : (float, float) or None
        Band in which chatter is looked for (Hz); None for all that the rate allows.
    spindle_hz : float or None
        Spindle speed (Hz).
    tools : int or None
        Cutting edges that pass per revolution.
    """
    raise NotImplementedError
