"""What an axis feels without cutting, over its absolute position: learned while it idles, taken off while it cuts.

A table in time would slip; one over position does not, as long as the encoder knows where it is. A ripple of wavelength
Lambda that is taken off delta beside its place leaves 2 |sin(pi delta/Lambda)| of itself: beyond Lambda/6 it would have
been better left alone. Friction depends on speed and direction, so there is a table for each.
"""

from dataclasses import dataclass
from math import ceil, pi, sin

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]

RUNS = 3
"""Idling runs that a table is the mean of, at least."""
SPEED_TOLERANCE = 0.05


@dataclass(frozen=True, slots=True, kw_only=True)
class IdlingTable:
    """Mean force of an idling axis over its position, for one direction and speed.

    Attributes
    ----------
    start : float
        Position of the middle of the first bin (m).
    bin : float
        Width of a bin (m).
    force : ndarray
        Mean force in each bin (N), shape (bins,).
    velocity : float
        Signed feed speed that it was learned at (m/s).
    """

    start: float
    bin: float
    force: Floats
    velocity: float

    def at(self, position: ArrayLike, velocity: float) -> Floats:
        """Return the force at positions (N), linear between the bins, shape (n,).

        Parameters
        ----------
        position : array_like, shape (n,)
            Absolute positions (m).
        velocity : float
            Feed speed at which the axis moves now (m/s).
        """
        if abs(velocity - self.velocity) > SPEED_TOLERANCE * abs(self.velocity):
            raise ValueError(
                f"velocity must be within {SPEED_TOLERANCE:.0%} of {self.velocity:g} m/s, for which the idling table"
                f" was learned, got {velocity:g} m/s"
            )
        place = (np.asarray(position, dtype=np.float64) - self.start) / self.bin
        outside = (place < -0.5) | (place > len(self.force) - 0.5)
        if outside.any():
            end = self.start + self.bin * (len(self.force) - 1)
            got = float(np.asarray(position)[outside][0])
            raise ValueError(
                f"position must be within the idling table, {self.start:.6g} to {end:.6g} m, got {got:.6g} m"
            )
        return np.interp(place, np.arange(len(self.force)), self.force)


def learn_idling(
    positions: list[Floats], forces: list[Floats], sample_rate_hz: float, *, bin_width: float | None = None
) -> IdlingTable:
    """Return the table of several idling runs at one speed.

    Parameters
    ----------
    positions : list of ndarray, shape (n,)
        Absolute position in each run (m).
    forces : list of ndarray, shape (n,)
        Force estimate in each run (N), shifted to the time of its position.
    sample_rate_hz : float
        Sampling rate (Hz).
    bin_width : float or None
        Width of a bin (m), at least the travel in one sample; None for that.
    """
    if len(positions) != len(forces) or len(positions) < RUNS:
        raise ValueError(f"positions must be those of at least {RUNS} runs, got {len(positions)} with {len(forces)}")
    speeds = [float((p[-1] - p[0]) / (len(p) - 1)) * sample_rate_hz for p in positions]
    velocity = float(np.mean(speeds))
    if max(abs(v - velocity) for v in speeds) > SPEED_TOLERANCE * abs(velocity) or velocity == 0.0:
        raise ValueError(f"positions must be of runs at one speed, got {', '.join(f'{v:g}' for v in speeds)} m/s")
    step = abs(velocity) / sample_rate_hz
    width = step if bin_width is None else bin_width
    if width < step * (1.0 - 1e-9):
        raise ValueError(f"bin_width must be at least the travel in one sample, {step:.3g} m, got {width:.3g} m")
    low = max(min(p[0], p[-1]) for p in positions)
    high = min(max(p[0], p[-1]) for p in positions)
    bins = ceil((high - low) / width - 1e-9)
    if bins < 2:
        raise ValueError(f"positions must have a common stretch of two bins, got {max(high - low, 0.0):.3g} m")
    place, force = np.concatenate(positions), np.concatenate(forces)
    index = np.floor((place - low) / width).astype(np.int64)
    inside = (index >= 0) & (index < bins) & np.isfinite(force)
    count = np.bincount(index[inside], minlength=bins)
    total = np.bincount(index[inside], weights=force[inside], minlength=bins)
    known = np.flatnonzero(count)
    mean = np.interp(np.arange(bins), known, total[known] / count[known])
    return IdlingTable(start=low + 0.5 * width, bin=width, force=mean, velocity=velocity)


def left_of_ripple(misalignment: float, wavelength: float) -> float:
    """Return which part of a ripple stays when it is taken off beside its place: 2 |sin(pi delta/Lambda)|.

    Parameters
    ----------
    misalignment : float
        delta (m).
    wavelength : float
        Lambda (m).
    """
    return 2.0 * abs(sin(pi * misalignment / wavelength))
