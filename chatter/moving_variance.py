"""Windowed variance that cannot drift."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chatter import _kernels
from chatter.blocks import as_block, positive_integer, reject_non_finite


@dataclass(frozen=True, slots=True, kw_only=True)
class MovingVarianceState:
    """Copy of the whole state of a `MovingVariance`."""

    seen: int
    ring: NDArray[np.float64]
    suffix: NDArray[np.float64]
    running: NDArray[np.float64]


class MovingVariance:
    """Population variance of the last samples after every sample of a stream.

    No sum ever has a sample taken out of it, so nothing accumulates and nothing cancels: the window is the end of
    one epoch (summed backward once it is complete) and the start of the next (summed forward).

    Parameters
    ----------
    window : int
        Samples in the window.
    channels : int
        Number of channels.
    """

    def __init__(self, window: int, channels: int = 1) -> None:
        self.window = positive_integer("window", window)
        self.channels = positive_integer("channels", channels)
        self._ring = np.zeros((self.channels, self.window))
        self._suffix = np.zeros((self.channels, 2, self.window))
        self._running = np.zeros((self.channels, 3))
        self._seen = 0

    def update(self, block: ArrayLike) -> NDArray[np.float64]:
        """Take a block and return the variance after each of its samples, shape (n, channels).

        Parameters
        ----------
        block : array_like, shape (n,) or (n, channels)
            New samples; until there are ``window`` of them the variance is that of the samples seen.
        """
        samples = as_block(block, self.channels)
        out = np.empty_like(samples)
        bad = _kernels.moving_variance(samples, self._seen, self._ring, self._suffix, self._running, out)
        if bad >= 0:
            reject_non_finite(samples, bad, self._seen)
        self._seen += samples.shape[0]
        return out

    def prepare(self) -> None:
        """Compile the kernel; the state stays as it is."""
        MovingVariance(2, self.channels).update(np.zeros((2, self.channels)))

    def reset(self) -> None:
        """Forget every sample."""
        self._seen = 0

    def snapshot(self) -> MovingVarianceState:
        """Return a copy of the whole state."""
        return MovingVarianceState(
            seen=self._seen, ring=self._ring.copy(), suffix=self._suffix.copy(), running=self._running.copy()
        )

    def restore(self, state: MovingVarianceState) -> None:
        """Continue from a copy of the state.

        Parameters
        ----------
        state : MovingVarianceState
            What `snapshot` of an object with the same window and channels returned.
        """
        if state.ring.shape != self._ring.shape:
            raise ValueError(f"state must be of (channels, window) {self._ring.shape}, got {state.ring.shape}")
        self._seen = state.seen
        self._ring[:], self._suffix[:], self._running[:] = state.ring, state.suffix, state.running
