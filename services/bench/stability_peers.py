"""Two other ways to a stability chart: turns of D(i w) about zero, and semi-discretisation; see `pitch.stability`."""

from __future__ import annotations

import math

import numpy as np

from pitch import OneModeProcess
from services.messages import Floats

PER_TURN = 24
"""Samples of the frequency per turn of the fastest phase."""
SHARP, FINER, LEVELS = 1.5, 8, 12
"""Steps of the angle (rad) that are sampled so many times more finely, and how often."""


def _numbers(process: OneModeProcess) -> tuple[float, float, float, float]:
    omega = 2.0 * math.pi * process.natural_frequency_hz
    damping = 2.0 * process.damping_ratio * process.modal_mass * omega + 2.0 * process.process_damping
    return process.modal_mass, damping, process.modal_mass * omega**2, process.overlap


def nyquist_column(process: OneModeProcess, spindle_hz: float, difference: float, stiffness: Floats) -> Floats:
    """Return how many pairs of roots grow for every stiffness (N/m), by the argument principle, shape (n,).

    Parameters
    ----------
    process
        Bar and cut.
    spindle_hz
        Spindle speed (Hz).
    difference
        Pitch difference (rad).
    stiffness
        Radial, of one tool (N/m), shape (n,).
    """
    m, _, k, mu = _numbers(process)
    top = 1.02 * math.sqrt((k + 2.0 * float(stiffness.max()) * (1.0 + abs(mu))) / m)
    w = np.arange(0.0, top, 2.0 * math.pi * spindle_hz / PER_TURN)
    steps = _steps(process, spindle_hz, difference, stiffness, w)
    turned = steps.sum(axis=1)
    for cell in np.flatnonzero(np.abs(steps).max(axis=1) > SHARP).tolist():
        turned[cell] = _finely(process, spindle_hz, difference, stiffness[cell : cell + 1], w)
    return np.round((1.0 - turned / math.pi) / 2.0)


def _finely(process: OneModeProcess, spindle_hz: float, difference: float, stiffness: Floats, w: Floats) -> float:
    """Return by how much D(i w) turns (rad), sampled more finely where it turns sharply."""
    for _ in range(LEVELS):
        steps = _steps(process, spindle_hz, difference, stiffness, w)[0]
        sharp = np.flatnonzero(np.abs(steps) > SHARP)
        if not sharp.size:
            break
        parts = np.linspace(w[sharp], w[sharp + 1], FINER + 1)[1:-1]
        w = np.sort(np.concatenate([w, parts.ravel()]))
    return float(_steps(process, spindle_hz, difference, stiffness, w).sum())


def _steps(process: OneModeProcess, spindle_hz: float, difference: float, stiffness: Floats, w: Floats) -> Floats:
    """Return by how much D(i w) turns from sample to sample (rad), shape (stiffness, samples - 1)."""
    m, c, k, mu = _numbers(process)
    omega = 2.0 * math.pi * spindle_hz
    wave = 1.0 + mu * np.exp(-1j * w * math.pi / omega) * np.cos(0.5 * w * difference / omega)
    value = (k - m * w**2 + 1j * c * w)[None, :] + 2.0 * stiffness[:, None] * wave[None, :]
    return np.asarray(np.angle(value[:, 1:] * value[:, :-1].conj()), dtype=np.float64)


def semi_discretised(
    process: OneModeProcess, spindle_hz: float, difference: float, stiffness: float, steps: int = 100
) -> bool:
    """Return whether a cell is stable by semi-discretisation of first order (Insperger and Stepan), dense.

    Parameters
    ----------
    process
        Bar and cut.
    spindle_hz
        Spindle speed (Hz).
    difference
        Pitch difference (rad).
    stiffness
        Radial, of one tool (N/m).
    steps
        In the longest delay.
    """
    from scipy.linalg import expm

    m, c, k, mu = _numbers(process)
    omega = 2.0 * math.pi * spindle_hz
    delays = (math.pi + 0.5 * difference) / omega, (math.pi - 0.5 * difference) / omega
    h = max(delays) / steps
    now = np.array([[0.0, 1.0], [-(k + 2.0 * stiffness) / m, -c / m]])
    step = expm(h * now)
    push = np.linalg.solve(now, step - np.eye(2)) @ np.array([0.0, -stiffness * mu / m])
    size = steps + 3
    matrix = np.zeros((size, size))
    matrix[:2, :2] = step
    for delay in delays:
        back = delay / h - 0.5  # the middle of the step
        whole = math.floor(back)
        for column, share in ((whole, 1.0 - back + whole), (whole + 1, back - whole)):
            matrix[:2, 0 if column == 0 else column + 1] += share * push
    matrix[2, 0] = 1.0
    matrix[np.arange(3, size), np.arange(2, size - 1)] = 1.0
    return bool(np.abs(np.linalg.eigvals(matrix)).max() < 1.0)
