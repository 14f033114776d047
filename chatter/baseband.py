"""The band shifted down to zero and thinned out, block by block: what frequencies are fitted to."""

from dataclasses import dataclass
from math import cos, pi, sin

import numpy as np
from numpy.typing import NDArray

from chatter.spectrum import OVERSAMPLING, smoothing

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]


@dataclass(frozen=True, slots=True, kw_only=True)
class BasebandState:
    """Copy of the whole state of a `Baseband`."""

    blocks: int
    tail: Floats
    ring: Complexes


class Baseband:
    """Keeps the end of the shifted and thinned signal, `step` samples of the signal for one of its own.

    Only one side of the spectrum is kept, so there is no image at the negative frequency to bias an estimate. The
    last value is centred half a kernel before the end of the signal.

    Parameters
    ----------
    centre_hz : float
        Frequency that becomes zero (Hz).
    half_band_hz : float
        Half of the band kept (Hz).
    sample_rate_hz : float
        Sampling rate (Hz).
    block : int
        Samples in a block; the step divides them.
    channels : int
        Number of channels.
    duration : float
        Time that is kept at least (s).
    """

    def __init__(
        self, centre_hz: float, half_band_hz: float, sample_rate_hz: float, block: int, channels: int, duration: float
    ) -> None:
        self.centre_hz, self.half_band_hz = centre_hz, half_band_hz
        most = max(int(sample_rate_hz / (OVERSAMPLING * half_band_hz)), 1)
        self.step = max(step for step in range(1, min(most, block) + 1) if block % step == 0)
        self.rate = sample_rate_hz / self.step
        kernel = smoothing(self.step)
        self._each = block // self.step
        turns = centre_hz / sample_rate_hz
        matrix = np.zeros((self._each, block + len(kernel) - self.step), dtype=np.complex128)
        for row in range(self._each):
            start = row * self.step
            index = np.arange(start, start + len(kernel))
            matrix[row, index] = kernel * np.exp(-2j * np.pi * turns * (index - (len(kernel) - self.step)))
        self._parts = np.concatenate([matrix.real, matrix.imag])
        self._turns = (turns * block) % 1.0
        self._reach = len(kernel) - self.step
        self._depth = self._each * (int(duration * self.rate / self._each) + 1)
        self._ring = np.zeros((2 * self._depth, channels), dtype=np.complex128)
        self._tail = np.zeros((self._reach, channels))
        self._blocks = 0

    def reset(self) -> None:
        """Forget every sample."""
        self._tail = np.zeros_like(self._tail)
        self._blocks = 0

    def update(self, block: Floats) -> None:
        """Take a block in.

        Parameters
        ----------
        block : ndarray, shape (block, channels)
            New samples.
        """
        data = np.concatenate([self._tail, block])
        angle = 2.0 * pi * ((self._blocks * self._turns) % 1.0)
        parts = self._parts @ data
        slow = parts[: self._each] + 1j * parts[self._each :]
        slow *= complex(cos(angle), -sin(angle))
        start = (self._blocks * self._each) % self._depth
        self._ring[start : start + self._each] = slow
        self._ring[start + self._depth : start + self._depth + self._each] = slow
        self._tail = data[len(data) - self._reach :]
        self._blocks += 1

    def last(self, duration: float) -> Complexes:
        """Return the values that rest on the last stretch of the signal alone, shape (m, channels), the newest last.

        Parameters
        ----------
        duration : float
            Length of the stretch (s); less where less has been seen.
        """
        seen = min(round(duration * self.rate), self._blocks * self._each, self._depth)
        end = self._depth + (self._blocks * self._each - 1) % self._depth + 1
        return self._ring[end - max(seen - self._reach // self.step, 0) : end]

    def snapshot(self) -> BasebandState:
        """Return a copy of the whole state."""
        return BasebandState(blocks=self._blocks, tail=self._tail.copy(), ring=self._ring.copy())

    def restore(self, state: BasebandState) -> None:
        """Continue from a copy of the state.

        Parameters
        ----------
        state : BasebandState
            What `snapshot` of an object with the same parameters returned.
        """
        self._blocks, self._tail, self._ring = state.blocks, state.tail.copy(), state.ring.copy()
