"""What is wrong with a recording that can be read: values held, or all the same."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from chatter.condition import repeats
from services.importers.channels import varies
from services.importers.recording import Recording
from services.messages import Floats


def unheld(recording: Recording) -> Recording:
    """Return a recording in which no value stands twice: of values that are held only the first is kept.

    The rate in the file is that of its samples; what they can show ends at half the rate at which they change.
    """
    factor, first = repeats(recording.samples)
    if factor == 1:
        return recording
    rate = recording.rate_hz / factor
    times = "twice" if factor == 2 else f"{factor} times"
    note = (
        f"every value is stored {times}: at {recording.rate_hz:g} Hz the samples change only {rate:g} times a "
        f"second; one of {factor} was taken"
    )
    samples = recording.samples[first::factor]
    return replace(recording, samples=samples, rate_hz=rate, notes=(*recording.notes, note))


def _alive(recording: Recording, k: int) -> bool:
    return varies(recording.samples[:, k])


def dead(recording: Recording) -> str | None:
    """Return why nothing can be told from a recording whose channels are all constant."""
    if any(_alive(recording, k) for k in range(len(recording.names))):
        return None
    firsts = [_first(recording.samples[:, k]) for k in range(len(recording.names))]
    said = ", ".join(f"{name} is always {value:g}" for name, value in zip(recording.names, firsts, strict=True))
    return f"constant: {said}; a channel that never changes shows no vibration"


def _first(x: Floats) -> float:
    return float(x[np.isfinite(x)][0])
