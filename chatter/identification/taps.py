"""The taps in a recording of an impact hammer: where each begins, how long it rings, whether the hammer bounced."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chatter.identification.servo import stretches

Floats = NDArray[np.float64]

LEAST_PEAK = 0.15
"""Part of the strongest tap below which a pulse is none."""
BOUNCE = 0.08
"""Part of a tap that a second pulse must reach to count as a bounce."""
BOUNCE_TIME = 0.25
"""A hammer that comes back later than this (s) has been swung again."""
LEAST_RATIO = 6.0
"""Peak over scatter that a channel with taps must have."""
_LEAD_WIDTHS = 4.0
_RINGING_WIDTHS = 8.0
_LEAST_LENGTH = 64


@dataclass(frozen=True, slots=True, kw_only=True)
class Taps:
    """Windows that hold one tap each, all of one length.

    Parameters
    ----------
    force : ndarray, shape (taps, n)
        Of the hammer, without its offset.
    response : ndarray, shape (taps, n, channels)
        Without offset.
    sample_rate_hz : float
        Sampling rate (Hz).
    start : tuple of int
        First sample of each window.
    doubled : tuple of int
        First samples of windows left out because the hammer bounced in them.
    notes : tuple of str
        What was left out, and what a reader should know.
    """

    force: Floats
    response: Floats
    sample_rate_hz: float
    start: tuple[int, ...]
    doubled: tuple[int, ...] = ()
    notes: tuple[str, ...] = ()


def find_taps(force: ArrayLike, response: ArrayLike, sample_rate_hz: float) -> Taps:
    """Return the taps of a recording; those in which the hammer bounced are left out while others remain.

    Parameters
    ----------
    force : array_like, shape (n,)
        Of the hammer; NaN between recordings that were joined.
    response : array_like, shape (n, channels)
        What was recorded beside it.
    sample_rate_hz : float
        Sampling rate (Hz).
    """
    f = np.asarray(force, dtype=np.float64)
    y = np.asarray(response, dtype=np.float64).reshape(f.size, -1)
    good = np.isfinite(f) & np.isfinite(y).all(axis=1)
    pieces = [piece for piece in stretches(good) if piece.stop - piece.start >= _LEAST_LENGTH]
    if not pieces:
        raise ValueError(f"force must have {_LEAST_LENGTH} samples in a row, got {int(good.sum())} in pieces")
    pulse = np.zeros(f.size)
    for piece in pieces:
        pulse[piece] = f[piece] - np.median(f[piece])
    pulse *= np.sign(pulse[np.argmax(np.abs(pulse))])
    strongest, scatter = float(pulse.max()), float(np.median(np.abs(pulse[good]))) * 1.4826
    if strongest <= LEAST_RATIO * scatter or strongest <= 0.0:
        raise ValueError(f"force must hold taps that stand out of its scatter, got a peak of {strongest:.3g}")
    found = [one for piece in pieces for one in _windows(pulse, piece, strongest, sample_rate_hz)]
    return _cut(f, y, pulse, found, sample_rate_hz)


def _windows(pulse: Floats, piece: slice, strongest: float, rate: float) -> list[tuple[int, int]]:
    """Return first and last sample of the window of each tap in a stretch without gaps."""
    x = pulse[piece]
    above = np.flatnonzero(x > LEAST_PEAK * strongest)
    if not above.size:
        return []
    first = above[np.concatenate([[True], np.diff(above) > BOUNCE_TIME * rate])]
    peaks = [int(k + np.argmax(x[k : k + max(2, int(0.5 * BOUNCE_TIME * rate))])) for k in first]
    starts = [max(0, int(k - _LEAD_WIDTHS * _width(x, k)) - 2) for k in peaks]
    ends = [*(start - 2 for start in starts[1:]), x.size]
    return [(piece.start + a, piece.start + b) for a, b in zip(starts, ends, strict=True) if b - a >= _LEAST_LENGTH]


def _width(x: Floats, peak: int) -> int:
    """Return how many samples a pulse stands above half its height."""
    half = 0.5 * x[peak]
    left = peak - int(np.argmax(x[peak::-1] < half)) if (x[: peak + 1] < half).any() else 0
    right = peak + int(np.argmax(x[peak:] < half)) if (x[peak:] < half).any() else x.size
    return max(1, right - left - 1)


def _cut(f: Floats, y: Floats, pulse: Floats, found: list[tuple[int, int]], rate: float) -> Taps:
    lengths = [b - a for a, b in found]
    length = int(min(n for n in lengths if n >= 0.5 * np.median(lengths)))
    whole = [(a, b) for a, b in found if b - a >= length]
    notes: list[str] = []
    if len(whole) < len(found):
        notes.append(f"{len(found) - len(whole)} of {len(found)} taps end too early and were left out")
    bounced = [a for a, _ in whole if _bounces(pulse[a : a + length])]
    single = [a for a, _ in whole if a not in bounced]
    if bounced:
        kept = "the others count" if single else "there is no other, so they count: doubt lines where the force is weak"
        notes.append(f"the hammer bounced in {len(bounced)} of {len(whole)} taps (double hits); {kept}")
    starts = single or bounced
    force = np.array([_level(f[a : a + length]) for a in starts])
    response = np.array([_level(y[a : a + length]) for a in starts])
    clipped = [a for a, row in zip(starts, force, strict=True) if _clips(row)]
    if clipped:
        notes.append(f"the force stands at its largest value in {len(clipped)} taps: clipped")
    return Taps(
        force=force, response=response, sample_rate_hz=rate, start=tuple(starts),
        doubled=tuple(bounced) if single else (), notes=tuple(notes),
    )  # fmt: skip


def _level(x: Floats) -> Floats:
    """Return a window without the mean of its last quarter, where it has rung down."""
    return x - x[-max(1, len(x) // 4) :].mean(axis=0)


def _bounces(x: Floats) -> bool:
    """Whether a second pulse follows, behind the ringing of filters around the first."""
    peak = int(np.argmax(x))
    rest = x[peak + int(_RINGING_WIDTHS * _width(x, peak)) + 1 :]
    return bool(rest.size) and float(rest.max()) > BOUNCE * float(x[peak])


def _clips(row: Floats) -> bool:
    size = np.abs(row)
    return int(np.count_nonzero(size >= 0.9999 * size.max())) >= 3
