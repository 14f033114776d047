"""How fast many linear cuts grow, and at what frequency: each is run in time from one blow, and fitted at its end."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from turning_sim import _delay_kernels as kernels
from turning_sim._check import require
from turning_sim.delay_equation import DelayEquation, step_of

_Floats = np.ndarray
_ORDERS = (4, 8)
_ENOUGH = (1e-7, 1e-5)
_FAINT, _RIDGE = 1e-3, 1e-15
_BATCH = 64


@dataclass(frozen=True, slots=True, kw_only=True)
class Growth:
    """What became of each run.

    Attributes
    ----------
    rate : ndarray
        Growth (1/s), negative for a stable cut; shape (runs,).
    frequency_hz : ndarray
        Of the line that grows fastest (Hz); nan where no few lines explain the end, shape (runs,).
    """

    rate: _Floats
    frequency_hz: _Floats

    @property
    def stable(self) -> _Floats:
        """Whether the vibration dies out, shape (runs,)."""
        return self.rate < 0.0


def growth_of(
    *,
    modal_mass: float | _Floats,
    natural_frequency_hz: float | _Floats,
    damping_ratio: float | _Floats,
    cutting_stiffness: float | _Floats,
    overlap: float | _Floats,
    process_damping: float | _Floats,
    delay_1: float | _Floats,
    delay_2: float | _Floats,
    duration: float = 2.0,
    sample_rate_hz: float = 9000.0,
) -> Growth:
    """Run many equations for a while after a blow, and say how each grows at its end.

    The parameters are those of `DelayEquation`, each one number or an array; they are broadcast against each other.
    Up to four lines are fitted to the last two revolutions (linear prediction; Marple, Digital Spectral Analysis,
    Prentice Hall 1987, chapter 11). Where more lines are left over, the growth is that of the energy over the last two
    revolutions against the two before.

    Parameters
    ----------
    modal_mass : float or ndarray
        (kg)
    natural_frequency_hz : float or ndarray
        (Hz)
    damping_ratio : float or ndarray
        Of the bar alone.
    cutting_stiffness : float or ndarray
        Of one tool (N/m).
    overlap : float or ndarray
        In [-1, 1].
    process_damping : float or ndarray
        Of one tool (N s/m).
    delay_1, delay_2 : float or ndarray
        (s)
    duration : float
        Of each run (s), at least ten of the longest revolutions.
    sample_rate_hz : float
        (Hz)

    Returns
    -------
    Growth
        One entry for each run, in the order of the flattened parameters.
    """
    given = np.broadcast_arrays(
        modal_mass, natural_frequency_hz, damping_ratio, cutting_stiffness, overlap, process_damping, delay_1, delay_2
    )
    columns = [np.ravel(column).astype(np.float64).tolist() for column in given]
    steps = np.array([step_of(DelayEquation(**_named(run)), sample_rate_hz) for run in zip(*columns, strict=True)])
    steps = steps.reshape(-1, 6)
    turn = math.ceil(float(np.max(steps[:, 3] + steps[:, 4], initial=1.0)))
    samples = round(duration * sample_rate_hz)
    require(samples >= 10 * turn, "duration", f"at least {10 * turn / sample_rate_hz:.4g} s", duration)
    past = np.zeros(turn + kernels.TAPS)
    past[-1] = 1.0  # at rest but for its last step: a blow
    q, rate, frequency = np.empty(past.size + samples), np.empty(len(steps)), np.empty(len(steps))
    for first in range(0, len(steps), _BATCH):
        some = slice(first, first + _BATCH)
        ends = np.empty((len(steps[some]), 4 * turn))
        kernels.advance_many(np.ascontiguousarray(steps[some, :5]), past, q, ends)
        rate[some], frequency[some] = _fitted(ends, math.sqrt(float(steps[some, 1].max())))
    return Growth(rate=rate * sample_rate_hz, frequency_hz=frequency * sample_rate_hz)


def _named(run: tuple[float, ...]) -> dict[str, float]:
    return dict(zip(DelayEquation.__dataclass_fields__, run, strict=True))


def _fitted(ends: _Floats, highest: float) -> tuple[_Floats, _Floats]:
    """Return growth and frequency per sample; no line is above `highest` (rad per sample) by more than a third."""
    runs, count = ends.shape
    early, late = ends[:, : count // 2], ends[:, count // 2 :]
    scale = np.abs(ends).max(axis=1, keepdims=True)
    late, early = late / scale, early / scale
    growth = np.log(np.einsum("ij,ij->i", late, late) / np.einsum("ij,ij->i", early, early)) / count
    frequency = np.full(runs, math.nan)
    lag, todo = max(1, int(0.75 * math.pi / highest)), np.arange(runs)
    window = late.shape[1] - _ORDERS[-1] * lag
    shifted = np.stack([late[:, j * lag : j * lag + window] for j in range(_ORDERS[-1] + 1)], axis=1)
    gram = shifted @ np.swapaxes(shifted, 1, 2)
    for order, enough in zip(_ORDERS, _ENOUGH, strict=True):
        taps, left = _prediction(gram[todo], shifted[todo], order)
        root = _strongest(late[todo], _roots(taps), lag)
        found = np.log(np.abs(root)) / lag
        good = (left < enough) & (np.abs(found - growth[todo]) < 0.1 * np.abs(growth[todo]) + 0.1 / count)
        growth[todo[good]] = found[good]
        frequency[todo[good]] = np.abs(np.angle(root[good])) / (2.0 * math.pi * lag)
        todo = todo[~good]
    return growth, frequency


def _prediction(gram: _Floats, shifted: _Floats, order: int) -> tuple[_Floats, _Floats]:
    """Return the weights of `order` samples in the next one, oldest first, and the share that they do not explain."""
    ridge = _RIDGE * np.einsum("ijj->i", gram)[:, None, None] * np.eye(order)
    taps = np.linalg.solve(gram[:, :order, :order] + ridge, gram[:, :order, order : order + 1])[:, :, 0]
    left = shifted[:, order] - (taps[:, None, :] @ shifted[:, :order])[:, 0]
    return taps, np.sqrt(np.einsum("ij,ij->i", left, left) / gram[:, order, order])


def _roots(taps: _Floats) -> _Floats:
    """Return the roots of predictions, shape (runs, order)."""
    runs, order = taps.shape
    companion = np.zeros((runs, order, order))
    companion[:, np.arange(order - 1), np.arange(1, order)] = 1.0
    companion[:, -1, :] = taps
    return np.linalg.eigvals(companion).astype(np.complex128)


def _strongest(series: _Floats, roots: _Floats, lag: int) -> _Floats:
    """Return of each series the root of largest size among those that are not faint."""
    order = roots.shape[1]
    apart = max(1, series.shape[1] // lag // (4 * order))
    places = apart * np.arange(4 * order - 3)
    powers = roots[:, None, :] ** places[None, :, None]
    size = np.abs(powers).max(axis=1)
    powers = powers / size[:, None, :]
    seen = series[:, places * lag].astype(np.complex128)
    adjoint = np.conj(np.swapaxes(powers, 1, 2))
    normal = adjoint @ powers + 1e-13 * np.eye(order)
    amplitude = np.abs(np.linalg.solve(normal, adjoint @ seen[:, :, None])[:, :, 0])
    loud = amplitude > _FAINT * amplitude.max(axis=1, keepdims=True)
    best = np.argmax(np.where(loud, np.abs(roots), 0.0), axis=1)
    return roots[np.arange(len(roots)), best]
