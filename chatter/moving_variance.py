"""Windowed variance that cannot drift."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chatter import _variance_kernels as kernels
from chatter.blocks import aligned, as_block, positive_integer, reject_non_finite


@dataclass(frozen=True, slots=True, kw_only=True)
class MovingVarianceState:
    """Copy of the whole state of a `MovingVariance`."""

    window: int
    seen: int
    memory: NDArray[np.float64]


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
        each = 3 * -(-self.window // 8) * 8 + 8
        self._work = aligned(self.channels * each).reshape(self.channels, each)
        self._work[:] = 0.0
        self._seen = 0

    def update(self, block: ArrayLike) -> NDArray[np.float64]:
        """Take a block and return the variance after each of its samples, shape (n, channels).

        Parameters
        ----------
        block : array_like, shape (n,) or (n, channels)
            New samples; until there are ``window`` of them the variance is that of the samples seen.
        """
        samples = as_block(block, self.channels)
        count = len(samples)
        out = np.empty((self.channels, count + 24))
        bad = kernels.moving_variance(samples, self._seen, self.window, self._work, out)
        if bad >= 0:
            reject_non_finite(samples, bad, self._seen)
        self._seen += count
        return out[:, 8 : 8 + count].T

    def prepare(self) -> None:
        """Compile the kernel; the state stays as it is."""
        MovingVariance(2, self.channels).update(np.zeros((2, self.channels)))

    def reset(self) -> None:
        """Forget every sample."""
        self._seen = 0

    def snapshot(self) -> MovingVarianceState:
        """Return a copy of the whole state."""
        return MovingVarianceState(window=self.window, seen=self._seen, memory=self._work.copy())

    def restore(self, state: MovingVarianceState) -> None:
        """Continue from a copy of the state.

        Parameters
        ----------
        state : MovingVarianceState
            What `snapshot` of an object with the same window and channels returned.
        """
        if (state.window, len(state.memory)) != (self.window, self.channels):
            raise ValueError(
                f"state must be of {self.channels} channels and a window of {self.window},"
                f" got {len(state.memory)} and {state.window}"
            )
        self._seen = state.seen
        self._work[:] = state.memory
