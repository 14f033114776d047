"""What an axis feels without cutting, learned from a recording of it and taken off another one.

Both recordings are cut into runs at constant speed; each run of the cut looks for those of the idling axis at its speed
and place. An axis that stands has no place: there the mean is taken off.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, sosfiltfilt

from chatter.identification.servo import stretches
from chatter.observers.idling import RUNS, SPEED_TOLERANCE, IdlingTable, learn_idling

Floats = NDArray[np.float64]

SPEED_HZ = 20.0
"""Edge of the low-pass of the speed (Hz)."""
LEAST_TIME = 0.1
"""Of a run at constant speed (s)."""
STANDS = 0.01
"""Part of the largest speed below which an axis stands."""
_BINS = 400
_LEAST_SPEED = 1e-6


@dataclass(frozen=True, slots=True, kw_only=True)
class Idling:
    """What was learned.

    Parameters
    ----------
    tables : tuple of IdlingTable
        Force over position, one for each signed speed.
    runs : tuple of int
        Runs behind each table.
    standing : float or None
        Mean force of the standing axis (N), None if it never stands.
    """

    tables: tuple[IdlingTable, ...]
    runs: tuple[int, ...]
    standing: float | None


def speed_of(position: Floats, sample_rate_hz: float, cutoff_hz: float = SPEED_HZ) -> Floats:
    """Return the speed (m/s), smoothed without delay, shape (n,).

    Parameters
    ----------
    position : ndarray, shape (n,)
        Finite (m).
    sample_rate_hz : float
        Sampling rate (Hz).
    cutoff_hz : float
        Edge of the low-pass (Hz).
    """
    edge = min(cutoff_hz, 0.2 * sample_rate_hz)
    sections = butter(2, edge, fs=sample_rate_hz, output="sos")
    if position.size <= 32:
        return np.gradient(position) * sample_rate_hz if position.size > 1 else np.zeros(position.size)
    return np.asarray(np.gradient(sosfiltfilt(sections, position - position[0])) * sample_rate_hz, dtype=np.float64)


def steady_runs(speed: Floats, sample_rate_hz: float) -> list[tuple[slice, float]]:
    """Return stretches of constant speed and that speed (m/s), 0 where the axis stands.

    Parameters
    ----------
    speed : ndarray, shape (n,)
        (m/s)
    sample_rate_hz : float
        Sampling rate (Hz).
    """
    least = max(STANDS * float(np.abs(speed).max(initial=0.0)), _LEAST_SPEED)
    moving = np.abs(speed) > least
    change = np.abs(np.gradient(speed)) * sample_rate_hz * LEAST_TIME if speed.size > 1 else np.zeros(speed.size)
    steady = moving & (change < SPEED_TOLERANCE * np.abs(speed))
    count = LEAST_TIME * sample_rate_hz
    found: list[tuple[slice, float]] = [
        (part, 0.0) for part in stretches(np.logical_not(moving)) if part.stop - part.start >= count
    ]
    for side in (steady & (speed > 0.0), steady & (speed < 0.0)):
        for part in stretches(side):
            middle = float(np.median(speed[part]))
            inner = part.start + np.flatnonzero(np.abs(speed[part] - middle) <= SPEED_TOLERANCE * abs(middle))
            if inner.size >= count:
                found.append((slice(int(inner[0]), int(inner[-1]) + 1), middle))
    return sorted(found, key=lambda one: one[0].start)


def learned(position: Floats, force: Floats, sample_rate_hz: float) -> Idling:
    """Return what an idling axis feels.

    Parameters
    ----------
    position : ndarray, shape (n,)
        Absolute (m).
    force : ndarray, shape (n,)
        Estimated while nothing cuts (N), at the time of its position; NaN where it is not valid.
    sample_rate_hz : float
        Sampling rate (Hz).
    """
    speed = speed_of(position, sample_rate_hz)
    groups: list[tuple[float, list[slice]]] = []
    standing: list[Floats] = []
    for part, middle in steady_runs(speed, sample_rate_hz):
        if middle == 0.0:
            standing.append(force[part])
            continue
        alike = next((g for g in groups if abs(g[0] - middle) <= 0.5 * SPEED_TOLERANCE * abs(middle)), None)
        if alike is None:
            groups.append((middle, [part]))
        else:
            alike[1].append(part)
    tables = [_table(position, force, parts, middle, sample_rate_hz) for middle, parts in groups]
    still = np.concatenate(standing) if standing else np.zeros(0)
    still = still[np.isfinite(still)]
    kept = [(table, len(parts)) for table, (_, parts) in zip(tables, groups, strict=True) if table is not None]
    return Idling(
        tables=tuple(table for table, _ in kept), runs=tuple(count for _, count in kept),
        standing=float(still.mean()) if still.size else None,
    )  # fmt: skip


def _table(
    position: Floats, force: Floats, parts: list[slice], speed: float, sample_rate_hz: float
) -> IdlingTable | None:
    """Return the table of some runs at one speed; of fewer than the table wants each counts several times."""
    usable = [part for part in parts if np.isfinite(force[part]).any()]
    if not usable:
        return None
    times = -(-RUNS // len(usable))
    places = [position[part] for part in usable] * times
    travel = min(abs(float(place[-1] - place[0])) for place in places)
    width = max(1.01 * abs(speed) / sample_rate_hz * (1.0 + SPEED_TOLERANCE), travel / _BINS)
    try:
        return learn_idling(places, [force[part] for part in usable] * times, sample_rate_hz, bin_width=width)
    except ValueError:  # runs that share no stretch of the axis, or too short for two bins
        return None


def taken_off(idling: Idling, position: Floats, sample_rate_hz: float) -> Floats:
    """Return the force (N) that the idling axis would feel, NaN where nothing is known of it, shape (n,).

    Parameters
    ----------
    idling : Idling
        From `learned`.
    position : ndarray, shape (n,)
        Of the cut (m).
    sample_rate_hz : float
        Sampling rate (Hz).
    """
    out = np.full(position.size, np.nan)
    for part, middle in steady_runs(speed_of(position, sample_rate_hz), sample_rate_hz):
        if middle == 0.0:
            out[part] = np.nan if idling.standing is None else idling.standing
            continue
        for table in idling.tables:
            if abs(middle - table.velocity) > SPEED_TOLERANCE * abs(table.velocity):
                continue
            end = table.start + table.bin * (len(table.force) - 1)
            inside = (position[part] >= table.start) & (position[part] <= end)
            found = out[part]
            found[inside] = table.at(position[part][inside], table.velocity)
    return out
