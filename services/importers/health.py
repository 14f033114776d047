"""What is wrong with a recording that can be read: values held, clipped or constant."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from services.importers.channels import varies
from services.importers.recording import Recording
from services.messages import Floats

_CHANGES = 64
"""Changes of value that must be there before their spacing tells anything."""
_AGREE = 0.98
_MOST_HELD = 64
_CLIPPED_RUNS, _CLIPPED_SHARE = 10, 1e-4


def held_for(x: Floats) -> int:
    """Return for how many samples every value is held: 1 unless all changes lie on such a grid."""
    changes = np.flatnonzero(np.diff(np.nan_to_num(x)) != 0.0) + 1
    if changes.size < _CHANGES:
        return 1
    gaps = np.diff(changes)
    for factor in range(min(int(np.quantile(gaps, 1.0 - _AGREE)), _MOST_HELD), 1, -1):
        if (gaps % factor == 0).mean() >= _AGREE:
            return factor
    return 1


def unheld(recording: Recording) -> Recording:
    """Return a recording in which no value stands twice: of values that are held only the first is kept.

    The rate in the file is that of its samples; what they can show ends at half the rate at which they change.
    """
    factors = [held_for(recording.samples[:, k]) for k in range(len(recording.names)) if _alive(recording, k)]
    factor = min(factors, default=1)
    if factor == 1:
        return recording
    moving = next(k for k in range(len(recording.names)) if _alive(recording, k))
    first = int(np.flatnonzero(np.diff(np.nan_to_num(recording.samples[:, moving])) != 0.0)[0] + 1) % factor
    rate = recording.rate_hz / factor
    note = (
        f"every value is stored {factor} times: at {recording.rate_hz:g} Hz the samples change only {rate:g} times a "
        f"second; one of {factor} was taken"
    )
    samples = recording.samples[first::factor]
    return replace(recording, samples=samples, rate_hz=rate, notes=(*recording.notes, note))


def _alive(recording: Recording, k: int) -> bool:
    return varies(recording.samples[:, k])


def clipped_share(x: Floats) -> float:
    """Return the part of the samples that stands at the largest or the smallest value, 0 if that is no clipping."""
    finite = x[np.isfinite(x)]
    if finite.size < 2:
        return 0.0
    share = 0.0
    for edge in (finite.max(), finite.min()):
        at = finite == edge
        flat = at[1:] & at[:-1]  # a peak that is not clipped has one highest sample
        runs = int(np.count_nonzero(flat[1:] & ~flat[:-1])) + int(flat[:1].sum())
        share += float(at.mean()) if runs >= _CLIPPED_RUNS else 0.0
    return share if share >= _CLIPPED_SHARE else 0.0


def ailments(recording: Recording) -> list[str]:
    """Return what a reader should know of each channel, in words."""
    said: list[str] = []
    for k, name in enumerate(recording.names):
        x = recording.samples[:, k]
        share = clipped_share(x)
        if share and np.unique(x[np.isfinite(x)][: 1 << 16]).size > 16:
            said.append(
                f"{100.0 * share:.2g} % of the samples of {name} are clipped (they stand at its largest or smallest "
                "value): harmonics of a strong line are then made by the recorder"
            )
    return said


def dead(recording: Recording) -> str | None:
    """Return why nothing can be told from a recording whose channels are all constant."""
    if any(_alive(recording, k) for k in range(len(recording.names))):
        return None
    firsts = [_first(recording.samples[:, k]) for k in range(len(recording.names))]
    said = ", ".join(f"{name} is always {value:g}" for name, value in zip(recording.names, firsts, strict=True))
    return f"constant: {said}; a channel that never changes shows no vibration"


def _first(x: Floats) -> float:
    return float(x[np.isfinite(x)][0])
