"""Poles that stay where they are when the order of the model rises: the stabilisation diagram, read by a program."""

from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

ORDER = 70
"""Highest number of pole pairs of the models."""
LEAST_SHARE = 0.5
"""Part of the upper half of the orders in which a pole must stand."""
LARGEST_DAMPING = 0.12
_SAME_HZ, _SAME_DAMPING = 0.004, 0.4
_LINES_FOR_A_PAIR = 4
LOW_SHARE, _LEAST_LINES = 0.25, 64


@dataclass(frozen=True, slots=True, kw_only=True)
class Candidate:
    """A pole of many orders.

    Parameters
    ----------
    frequency_hz, damping_ratio : float
        Medians over the orders.
    share : float
        Part of the orders in which it stands.
    """

    frequency_hz: float
    damping_ratio: float
    share: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Diagram:
    """All poles of all orders.

    Parameters
    ----------
    frequency_hz, damping_ratio : tuple of ndarray
        Of each order, lowest first.
    candidates : tuple of Candidate
        Those that stay.
    """

    frequency_hz: tuple[Floats, ...]
    damping_ratio: tuple[Floats, ...]
    candidates: tuple[Candidate, ...]


def diagram_of(
    frequency_hz: Floats, response: NDArray[np.complex128], band_hz: tuple[float, float], order: int = ORDER
) -> Diagram:
    """Return the poles of models of rising order; the low quarter of the band has models of its own besides.

    Parameters
    ----------
    frequency_hz : ndarray, shape (lines,)
        Even (Hz).
    response : ndarray, shape (channels, lines)
        Complex.
    band_hz : (float, float)
        Where poles are wanted (Hz).
    order : int
        Pole pairs of the largest model.
    """
    low, high = band_hz
    whole = _diagram(frequency_hz, response, band_hz, order)
    quarter = low + LOW_SHARE * (high - low)
    if np.count_nonzero((frequency_hz >= low) & (frequency_hz <= quarter)) < _LEAST_LINES:
        return whole
    slow = _diagram(frequency_hz, response, (low, quarter), order * 4 // 7)
    apart = quarter - 0.05 * (quarter - low)
    kept = [c for c in slow.candidates if c.frequency_hz < apart]
    more = [c for c in whole.candidates if c.frequency_hz >= apart or not _among(c, kept)]
    both = tuple(sorted([*kept, *more], key=lambda c: c.frequency_hz))
    return Diagram(frequency_hz=whole.frequency_hz, damping_ratio=whole.damping_ratio, candidates=both)


def _among(one: Candidate, others: list[Candidate]) -> bool:
    """Whether a pole stands within the width of another."""
    widths = [(c.frequency_hz, max(c.damping_ratio, one.damping_ratio) * c.frequency_hz) for c in others]
    return any(abs(one.frequency_hz - f) < width for f, width in widths)


def _diagram(
    frequency_hz: Floats, response: NDArray[np.complex128], band_hz: tuple[float, float], order: int
) -> Diagram:
    """Return the poles of common-denominator models of rising order (LSCF), as sdypy-EMA fits them.

    Verboven, Guillaume, Cauberghe, Parloo, Vanlanduit, Stabilization charts and uncertainty bounds for frequency-domain
    linear least squares estimators, IMAC 21, 2003.

    Parameters
    ----------
    frequency_hz : ndarray, shape (lines,)
        Even (Hz).
    response : ndarray, shape (channels, lines)
        Complex.
    band_hz : (float, float)
        Where poles are wanted (Hz).
    order : int
        Pole pairs of the largest model.
    """
    model_of: Any = import_module("sdypy.EMA").Model  # brings matplotlib along: only when it is needed

    low, high = band_hz
    lines = int(np.count_nonzero((frequency_hz >= low) & (frequency_hz <= high)))
    most = max(2, min(order, lines // _LINES_FOR_A_PAIR))
    scale = np.sqrt(np.mean(np.abs(response[:, frequency_hz >= low]) ** 2, axis=1, keepdims=True))
    even = response / np.where(scale > 0.0, scale, 1.0)
    with np.errstate(all="ignore"):
        top = min(high, float(frequency_hz[-1]))
        model = model_of(even, frequency_hz, lower=low, upper=top, pol_order_high=most)
        model.get_poles(method="lscf", show_progress=False)
        hz = [np.asarray(found, dtype=np.float64) for found in model.pole_freq]
        damping = [np.asarray(found, dtype=np.float64) for found in model.pole_xi]
    kept = [(f > low) & (f < high) & (z > 0.0) & (z < LARGEST_DAMPING) for f, z in zip(hz, damping, strict=True)]
    hz = [f[k] for f, k in zip(hz, kept, strict=True)]
    damping = [z[k] for z, k in zip(damping, kept, strict=True)]
    return Diagram(frequency_hz=tuple(hz), damping_ratio=tuple(damping), candidates=_stable(hz, damping))


def _stable(hz: list[Floats], damping: list[Floats]) -> tuple[Candidate, ...]:
    """Return the poles that stand in most of the upper orders, each once."""
    upper = range(len(hz) // 2, len(hz))
    found: list[Candidate] = []
    for k in reversed(upper):
        for f, z in zip(hz[k], damping[k], strict=True):
            if any(_same(f, z, one.frequency_hz, one.damping_ratio) for one in found):
                continue
            near = [(j, _nearest(f, z, hz[j], damping[j])) for j in upper]
            there = [(hz[j][i], damping[j][i]) for j, i in near if i is not None]
            share = len(there) / len(upper)
            if share >= LEAST_SHARE:
                middle = np.median(np.array(there), axis=0)
                found.append(Candidate(frequency_hz=float(middle[0]), damping_ratio=float(middle[1]), share=share))
    return tuple(_each_once(found))


def _same(f: float, z: float, other_f: float, other_z: float) -> bool:
    """Whether two poles are one: nearer than their width, and damped alike."""
    width = min(_SAME_HZ * other_f, max(2.0 * other_z * other_f, 0.0005 * other_f))
    return abs(f - other_f) <= width and abs(z - other_z) <= _SAME_DAMPING * max(z, other_z) + 2e-4


def _nearest(f: float, z: float, hz: Floats, damping: Floats) -> int | None:
    if not hz.size:
        return None
    i = int(np.argmin(np.abs(hz - f)))
    return i if _same(hz[i], damping[i], f, z) else None


def _each_once(found: list[Candidate]) -> list[Candidate]:
    kept: list[Candidate] = []
    for one in sorted(found, key=lambda c: -c.share):
        if not any(_same(one.frequency_hz, one.damping_ratio, c.frequency_hz, c.damping_ratio) for c in kept):
            kept.append(one)
    return sorted(kept, key=lambda c: c.frequency_hz)
