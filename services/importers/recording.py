"""One type for every recording, whatever file it came from."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from services.errors import InputError
from services.messages import Floats


@dataclass(frozen=True, slots=True, kw_only=True)
class Recording:
    """Evenly sampled channels.

    Attributes
    ----------
    source
        File the samples came from.
    rate_hz
        Sampling rate (Hz).
    names, units
        One word for each channel; the unit is empty where the file does not tell.
    samples
        shape (n, channels); NaN marks a sample that the file does not have.
    notes
        What a user should know before he trusts the result: truncation, gaps, missing values.
    roles
        What each channel is: `position`, `thrust`, `hammer` ...; empty as long as nobody has said.
    numbers
        Single numbers that the file holds beside its channels: gains, constants.
    """

    source: str
    rate_hz: float
    names: tuple[str, ...]
    units: tuple[str, ...]
    samples: Floats
    notes: tuple[str, ...] = ()
    roles: tuple[str, ...] = ()
    numbers: Mapping[str, float] = field(default_factory=dict[str, float])

    @property
    def duration_s(self) -> float:
        """Length of the recording (s)."""
        return len(self.samples) / self.rate_hz

    def only(self, which: Sequence[int]) -> Recording:
        """Return the recording with some of its channels, given by number."""
        names, units = ([words[k] for k in which] for words in (self.names, self.units))
        roles = tuple(self.roles[k] for k in which) if self.roles else ()
        samples = self.samples[:, list(which)]
        return replace(self, names=tuple(names), units=tuple(units), roles=roles, samples=samples)

    def channel(self, wanted: str | None) -> tuple[str, Floats]:
        """Return the name and samples, shape (n,), of a channel given by name or number from 0.

        Without a wish the first channel that is not constant is taken (a stereo file may have one dead side).
        """
        if wanted is None:
            alive = [k for k in range(len(self.names)) if _varies(self.samples[:, k])]
            index = alive[0] if alive else 0
        elif wanted in self.names:
            index = self.names.index(wanted)
        elif wanted.isdigit() and int(wanted) < len(self.names):
            index = int(wanted)
        else:
            listed = ", ".join(f"{k}: {name}" for k, name in enumerate(self.names))
            raise InputError("channel", wanted, f"one of the channels of {self.source} ({listed})")
        if not np.isfinite(self.samples[:, index]).any():
            raise InputError("channel", self.names[index], f"one that holds numbers in {self.source}")
        return self.names[index], self.samples[:, index]


def _varies(x: Floats) -> bool:
    finite = x[np.isfinite(x)]
    return bool(finite.size) and bool(finite.max() > finite.min())
