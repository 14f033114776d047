"""Growth of many one-mode processes at once, by Newton's method from a comb of starts on the imaginary axis.

Collocation finds the roots of one process in some 30 ms. Where thousands are asked for (robust pitch, maps, sweeps),
all roots near the axis are found together: neighbours of one family lie two spindle frequencies apart, so starts half
a spindle frequency apart reach every one of them. Symbols and equation as in `pitch.stability`.
"""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pitch.stability import OneModeProcess, StabilityUnresolved

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

STARTS_PER_TURN = 2.0
"""Starts in one spindle frequency."""
STEPS = 14
MOST_STARTS = 4_000_000
SETTLED = 1e-8


def growth_rates(
    modal_mass: ArrayLike, damping: ArrayLike, stiffness: ArrayLike, overlap: ArrayLike, cutting_stiffness: ArrayLike,
    spindle_hz: ArrayLike, pitch_difference: ArrayLike, *, above: float = 0.0,
) -> Complexes:  # fmt: skip
    """Return the strongest root of each process: growth (1/s) and angular frequency (rad/s), shape of the broadcast.

    Parameters
    ----------
    modal_mass : array_like
        At the tools (kg).
    damping : array_like
        Of structure and both flanks (N s/m).
    stiffness : array_like
        Of the mode (N/m).
    overlap : array_like
        Share of the other tool's wave.
    cutting_stiffness : array_like
        Radial, of one tool (N/m).
    spindle_hz : array_like
        Spindle speed (Hz).
    pitch_difference : array_like
        Pitch difference (rad).
    above : float
        Frequency from which roots count, over the natural one; the slow waves of the delays alone lie far below it,
        always decay and hardly know the pitch.
    """
    given = np.broadcast_arrays(
        *(np.asarray(x, dtype=np.float64) for x in
          (modal_mass, damping, stiffness, overlap, cutting_stiffness, spindle_hz, pitch_difference))
    )  # fmt: skip
    shape = given[0].shape
    m, c, k, mu, cut, speed, difference = (x.ravel()[:, None] for x in given)
    if (
        not all(np.isfinite(x).all() for x in (m, c, k, mu, cut, difference))
        or not (m > 0.0).all()
        or (cut < 0.0).any()
    ):
        raise ValueError("modal_mass must be > 0, cutting_stiffness >= 0 and all numbers finite")
    if not (speed > 0.0).all() or not (np.abs(difference) < 2.0 * math.pi).all():
        raise ValueError("spindle_hz must be > 0 and pitch_difference in (-2 pi, 2 pi)")
    high = 1.3 * math.sqrt(float(((k + 2.0 * cut * (1.0 + np.abs(mu))) / m).max()))
    gap = 2.0 * math.pi * float(speed.min()) / STARTS_PER_TURN
    starts = np.arange(0.25 * gap, high + gap, gap)  # waves of the delays alone may outlast those of the bar
    best = np.empty(m.size, dtype=np.complex128)
    piece = max(1, MOST_STARTS // (8 * starts.size))
    for begin in range(0, m.size, piece):
        part = slice(begin, begin + piece)
        best[part] = _strongest(
            m[part], c[part], k[part], mu[part], cut[part], speed[part], difference[part], starts, above
        )
    return best.reshape(shape)


def _strongest(
    m: Floats,
    c: Floats,
    k: Floats,
    mu: Floats,
    cut: Floats,
    speed: Floats,
    difference: Floats,
    starts: Floats,
    above: float,
) -> Complexes:
    omega = 2.0 * math.pi * speed
    tau_1, tau_2 = (math.pi + 0.5 * difference) / omega, (math.pi - 0.5 * difference) / omega
    s = (np.zeros((m.size, 1)) + 1j * starts).astype(np.complex128)
    reach = 0.5 * omega
    step = np.zeros_like(s)
    for _ in range(STEPS):
        one, two = cut * mu * np.exp(-s * tau_1), cut * mu * np.exp(-s * tau_2)
        value = (m * s + c) * s + k + 2.0 * cut + one + two
        slope = 2.0 * m * s + c - tau_1 * one - tau_2 * two
        step = value / np.where(slope == 0.0, 1.0, slope)
        step *= np.minimum(1.0, reach / np.maximum(np.abs(step), 1e-300))
        s = s - step
        np.clip(s.real, -600.0 / (tau_1 + tau_2), None, out=s.real)  # beyond, the wave is gone and its power overflows
    settled = (np.abs(step) < SETTLED * (1.0 + np.abs(s))) & (s.imag > above * np.sqrt(k / m))
    if not settled.any(axis=1).all():
        raise StabilityUnresolved("no root settled for a process; it has none near the frequencies of the bar")
    growth = np.where(settled, s.real, -np.inf)
    return s[np.arange(m.size), growth.argmax(axis=1)]


def numbers_of(process: OneModeProcess) -> tuple[float, float, float, float]:
    """Return modal mass (kg), damping with the flanks of both tools (N s/m), stiffness (N/m) and overlap.

    Parameters
    ----------
    process : OneModeProcess
        Bar and cut.
    """
    omega = 2.0 * math.pi * process.natural_frequency_hz
    damping = 2.0 * process.damping_ratio * process.modal_mass * omega + 2.0 * process.process_damping
    return process.modal_mass, damping, process.modal_mass * omega**2, process.overlap
