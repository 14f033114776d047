"""How fast many linear cuts grow, and at what frequency: each is run in time from one blow, and fitted at its end."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from turning_sim import _delay_kernels as kernels
from turning_sim._check import require
from turning_sim.delay_equation import DelayEquation, step_of

_Floats = np.ndarray
_ORDER = 8
_TOLD, _FAINT, _RIDGE = 1e-6, 1e-3, 1e-15
_BATCH = 64
_PER_WAVE, _PER_DELAY = 7.0, 24.0


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
    sample_rate_hz: float | None = None,
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
    sample_rate_hz : float or None
        (Hz); None for seven samples per wave of the stiffest cut, which leave an error of the growth of 1e-5 1/s.

    Returns
    -------
    Growth
        One entry for each run, in the order of the flattened parameters.
    """
    columns = np.broadcast_arrays(
        modal_mass, natural_frequency_hz, damping_ratio, cutting_stiffness, overlap, process_damping, delay_1, delay_2
    )
    given = np.array([np.ravel(column) for column in columns], dtype=np.float64)
    runs = given.shape[1]
    if runs == 0:
        return Growth(rate=np.empty(0), frequency_hz=np.empty(0))
    fields = DelayEquation.__dataclass_fields__
    worst = [DelayEquation(**dict(zip(fields, extreme, strict=True))) for extreme in (given.min(1), given.max(1))]
    numbers, rate = _numbers(given, sample_rate_hz)
    for equation in worst:  # every rule is a bound, so that the extremes break it first
        step_of(equation, rate)
    turn = math.ceil(float(np.max(numbers[:, 3] + numbers[:, 4])))
    samples = round(duration * rate)
    require(samples >= 10 * turn, "duration", f"at least {10 * turn / rate:.4g} s", duration)
    past = np.zeros(turn + kernels.TAPS)
    past[-1] = 1.0  # at rest but for its last step: a blow
    q, growth, frequency = np.empty(past.size + samples), np.empty(runs), np.empty(runs)
    for first in range(0, runs, _BATCH):
        some = slice(first, first + _BATCH)
        ends = np.empty((numbers[some].shape[0], 4 * turn))
        kernels.advance_many(numbers[some], past, q, ends)
        growth[some], frequency[some] = fitted(ends, math.sqrt(float(numbers[:, 1].max())))
    return Growth(rate=growth * rate, frequency_hz=frequency * rate)


def _numbers(given: _Floats, sample_rate_hz: float | None) -> tuple[_Floats, float]:
    """Return what the kernel needs of each equation, shape (runs, 5), and the sample rate."""
    mass, natural_hz, damping_ratio, stiffness, overlap, process_damping, delay_1, delay_2 = given
    squared = (2.0 * np.pi * natural_hz) ** 2 + 2.0 * stiffness / mass
    decay = 2.0 * np.pi * natural_hz * damping_ratio + process_damping / mass
    if sample_rate_hz is None:
        sample_rate_hz = max(
            _PER_WAVE * math.sqrt(float(squared.max())) / (2.0 * math.pi),
            _PER_DELAY / min(delay_1.min(), delay_2.min()),
        )
    h = 1.0 / sample_rate_hz
    columns = (decay * h, squared * h * h, stiffness * overlap / mass * h * h, delay_1 / h, delay_2 / h)
    return np.stack(columns, axis=1), sample_rate_hz


def fitted(ends: _Floats, highest: float) -> tuple[_Floats, _Floats]:
    """Return growth and frequency of each run's end.

    Parameters
    ----------
    ends : ndarray
        The last samples of each run: an even number of revolutions, shape (runs, n).
    highest : float
        No line is above this by more than a third (rad per sample).

    Returns
    -------
    growth : ndarray
        Per sample, shape (runs,).
    frequency : ndarray
        Cycles per sample, shape (runs,).
    """
    count, lag = ends.shape[1], max(1, int(0.75 * math.pi / highest))
    ends = ends / np.abs(ends).max(axis=1, keepdims=True)
    early, late = ends[:, : count // 2], ends[:, count // 2 :]
    growth = np.log(np.einsum("ij,ij->i", late, late) / np.einsum("ij,ij->i", early, early)) / count
    taps, left = _prediction(late, lag)
    root = _fastest(late, _roots(taps), lag)
    found = np.log(np.abs(root)) / lag
    told = (left < _TOLD) & (np.abs(found - growth) < 0.1 * np.abs(growth) + 0.1 / count)
    frequency = np.abs(np.angle(root)) / (2.0 * math.pi * lag)
    return np.where(told, found, growth), np.where(told, frequency, math.nan)


def _prediction(series: _Floats, lag: int) -> tuple[_Floats, _Floats]:
    """Return the weights of `_ORDER` samples in the next one, oldest first, and the share that they do not explain."""
    window = series.shape[1] - _ORDER * lag
    shifted = np.stack([series[:, j * lag : j * lag + window] for j in range(_ORDER + 1)], axis=1)
    gram = shifted @ np.swapaxes(shifted, 1, 2)
    ridge = _RIDGE * np.einsum("ijj->i", gram)[:, None, None] * np.eye(_ORDER)
    taps = np.linalg.solve(gram[:, :_ORDER, :_ORDER] + ridge, gram[:, :_ORDER, _ORDER:])[:, :, 0]
    left = shifted[:, _ORDER] - (taps[:, None, :] @ shifted[:, :_ORDER])[:, 0]
    return taps, np.sqrt(np.einsum("ij,ij->i", left, left) / gram[:, _ORDER, _ORDER])


def _roots(taps: _Floats) -> _Floats:
    """Return the roots of predictions, shape (runs, `_ORDER`)."""
    companion = np.zeros((len(taps), _ORDER, _ORDER))
    companion[:, np.arange(_ORDER - 1), np.arange(1, _ORDER)] = 1.0
    companion[:, -1, :] = taps
    return np.linalg.eigvals(companion).astype(np.complex128)


def _fastest(series: _Floats, roots: _Floats, lag: int) -> _Floats:
    """Return of each series the root of largest size among those that are not faint."""
    places = 2 * _ORDER + 1
    apart = max(1, series.shape[1] // lag // places)
    powers = np.ones((len(roots), places, _ORDER), dtype=np.complex128)
    powers[:, 1:] = roots[:, None, :] ** apart
    powers = np.multiply.accumulate(powers, axis=1)
    size = np.abs(powers[:, [0, -1]]).max(axis=1)
    powers /= size[:, None, :]
    seen = series[:, : places * apart * lag : apart * lag].astype(np.complex128)
    adjoint = np.conj(np.swapaxes(powers, 1, 2))
    normal = adjoint @ powers + _RIDGE * places * np.eye(_ORDER)
    amplitude = np.abs(np.linalg.solve(normal, adjoint @ seen[:, :, None])[:, :, 0])
    loud = amplitude > _FAINT * amplitude.max(axis=1, keepdims=True)
    best = np.argmax(np.where(loud, np.abs(roots), 0.0), axis=1)
    return roots[np.arange(len(roots)), best]
