"""How a motor moves: what its encoder says below an edge, what its thrust makes of its inertia above.

At chatter frequency a motor moves by a hundredth of a count, so its encoder carries only counts. One of them is worth
6...10 N on the spring of the screw, and a servo that hunts about one toggles it for minutes: lines at some 300 Hz, of
more force than chatter. What is left once the counts are smoothed is what the toggling thrust really does to the motor,
some 2 N; that is known, for above the edge the motor is a free mass: x_m = T / (M_r s^2).
"""

import numpy as np
from numpy.typing import NDArray

from chatter.filters import BiquadFilter, BiquadFilterState, response
from chatter.observers.nominal import NominalFeedDrive

Floats = NDArray[np.float64]

ABOVE = 1.2
"""Edge over the frequency sqrt(K / M_r) / 2 pi of a motor on the spring of its screw."""
POLES = (1.0, 1.0), (1.0, 0.5 * (5.0**0.5 - 1.0), 1.0), (1.0, 0.5 * (5.0**0.5 + 1.0), 1.0)
"""Factors of the Butterworth polynomial D of order 5, highest power first, for an edge of 1 rad/s."""


class MotorMotion:
    """Motor positions without the counts: L x_m + (1 - L) T / (M_r s^2).

    L = (d_2 s^2 + d_1 s + d_0) / D falls with the third power of frequency, and 1 - L has the factor s^3: a slide that
    moves or accelerates evenly and a steady thrust leave nothing behind, and above the edge no phase is wrong.

    Parameters
    ----------
    drives : tuple of NominalFeedDrive
        The drives, all with one edge.
    sample_rate_hz : float
        Sampling rate (Hz).
    delayed : bool
        Whether the ages of the signals and the lag of the current loop are taken into account.
    """

    def __init__(self, drives: tuple[NominalFeedDrive, ...], sample_rate_hz: float, *, delayed: bool = True) -> None:
        self._sample_rate_hz = sample_rate_hz
        free = min(np.sqrt(drive.screw_stiffness / drive.rotor_mass) for drive in drives) / (2.0 * np.pi)
        self.edge_hz = float(min(ABOVE * free, 0.1 * sample_rate_hz))
        omega = 2.0 * np.pi * self.edge_hz
        low, free_mass = _sections(2.0 * sample_rate_hz / omega)
        self._low = BiquadFilter(low, len(drives))
        self._gain = np.array([1.0 / (drive.rotor_mass * omega**2) for drive in drives])
        late = [_lag(drive, sample_rate_hz) if delayed else [] for drive in drives]
        alike = all(sections == late[0] for sections in late)
        self._pushed = [
            BiquadFilter(np.array([*free_mass, *sections]), len(drives) if alike else 1)
            for sections in (late[:1] if alike else late)
        ]

    def update(self, motor_position: Floats, thrust: Floats) -> Floats:
        """Take a block of signals and return the positions of the motors (m), shape (n, axes).

        Parameters
        ----------
        motor_position : ndarray, shape (n, axes)
            As measured (m).
        thrust : ndarray, shape (n, axes)
            As commanded (N).
        """
        if len(self._pushed) == 1:
            free = self._pushed[0].update(thrust)
        else:
            free = np.hstack([part.update(thrust[:, axis : axis + 1]) for axis, part in enumerate(self._pushed)])
        return self._low.update(motor_position) + self._gain * free

    def response(self, frequency_hz: Floats) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
        """Return what the encoder, shape (k,), and the thrust, shape (k, axes), weigh in the position of the motor.

        Parameters
        ----------
        frequency_hz : ndarray, shape (k,)
            Frequencies (Hz).
        """
        low, *pushed = (response(part.sections, frequency_hz, self._sample_rate_hz) for part in self._parts)
        return low, np.stack(pushed, axis=1) * self._gain  # one response for all where their lags agree

    def reset(self) -> None:
        """Forget every sample."""
        for part in self._parts:
            part.reset()

    def snapshot(self) -> tuple[BiquadFilterState, ...]:
        """Return a copy of the whole state."""
        return tuple(part.snapshot() for part in self._parts)

    def restore(self, state: tuple[BiquadFilterState, ...]) -> None:
        """Continue from a copy of the state.

        Parameters
        ----------
        state : tuple of BiquadFilterState
            What `snapshot` returned.
        """
        for part, saved in zip(self._parts, state, strict=True):
            part.restore(saved)

    @property
    def _parts(self) -> tuple[BiquadFilter, ...]:
        return self._low, *self._pushed


def _sections(k: float) -> tuple[Floats, ...]:
    """Return the sections of L and of (1 - L) / s^2 for an edge of 1 rad/s; bilinear, s = k (z - 1) / (z + 1)."""
    d5, d4, d3, d2, d1, d0 = np.polymul(np.polymul(POLES[0], POLES[1]), POLES[2]).tolist()
    low = zip(((1.0,), (d2, d1, d0), (1.0,)), POLES, strict=True)
    pushed = zip(((1.0, 0.0), (d5, d4, d3), (1.0,)), POLES, strict=True)
    return tuple(np.array([_bilinear(top, below, k) for top, below in part]) for part in (low, pushed))


def _bilinear(top: tuple[float, ...], below: tuple[float, ...], k: float) -> list[float]:
    """Return b0 b1 b2 a1 a2 of a section whose numerator and denominator in s are given, highest power first."""
    rows: list[Floats] = []
    for poly in (top, below):
        s2, s1, s0 = np.concatenate([np.zeros(3 - len(poly)), poly])
        rows.append(np.array([s2 * k * k + s1 * k + s0, 2.0 * (s0 - s2 * k * k), s2 * k * k - s1 * k + s0]))
    b, a = rows[0] / rows[1][0], rows[1] / rows[1][0]
    return [*b.tolist(), *a[1:].tolist()]


def _lag(drive: NominalFeedDrive, sample_rate_hz: float) -> list[list[float]]:
    """Return sections for the lag of the current loop and whole samples between a command and the position it makes."""
    e = float(np.exp(-drive.omega_current / sample_rate_hz))
    late = round((drive.motor_delay + drive.thrust_delay) * sample_rate_hz)
    return [[0.0, 1.0 - e, 0.0, -e, 0.0], *[[0.0, 1.0, 0.0, 0.0, 0.0]] * late]
