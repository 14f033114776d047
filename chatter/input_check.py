"""Signs that the samples are not what the sensor should give: clipped, standing still, sent twice, stored twice."""

import numpy as np
from numpy.typing import NDArray

from chatter import _input_kernels as kernels
from chatter.estimate import Note

Floats = NDArray[np.float64]

PATIENCE = 5
"""Blocks in a row after which a channel that does not change stands still, and twice stored values are no chance."""
FLAT = 3
"""Equal samples in a row at the end of a range that make a clipped peak ..."""
STEEP = 0.02
"""... when the signal came there by a step of more than this part of its range: slow ones rest at their peaks too."""
CLIPPED = 2
"""Clipped peaks in so many blocks that tell."""
ALONE = 0.75
"""Part of the other neighbours that may be equal where every value is stored twice."""


class InputCheck:
    """Looks at every block before it is filtered.

    Parameters
    ----------
    channels : int
        Number of channels.
    """

    def __init__(self, channels: int) -> None:
        self._counts = np.zeros((channels, kernels.COLUMNS), dtype=np.int64)
        self._constant = np.zeros(channels, dtype=np.int64)
        self._doubled = np.zeros(channels, dtype=np.int64)
        self._ends = np.array([np.full(channels, np.inf), np.full(channels, -np.inf)])
        self._last: Floats | None = None
        self._peaks = [0] * PATIENCE

    def look(self, block: Floats) -> tuple[Note, ...]:
        """Take a block and return what is wrong with it.

        Parameters
        ----------
        block : ndarray, shape (n, channels)
            Samples as they came, all finite.
        """
        counts, pairs = self._counts, len(block) - 1
        kernels.count(block, FLAT, STEEP, self._ends, counts)
        last, self._last = self._last, block.copy()
        still = counts[:, kernels.STILL] == pairs
        if last is not None:
            still &= block[0] == last[-1]
        self._constant = (self._constant + 1) * still
        even, odd = counts[:, kernels.EVEN], counts[:, kernels.ODD]
        twice = (np.maximum(even, odd) >= pairs // 2) & (np.minimum(even, odd) < ALONE * (pairs // 2))
        self._doubled = (self._doubled + 1) * twice
        self._peaks = [*self._peaks[1:], int(counts[:, kernels.PEAKS].sum())]
        notes: list[Note] = []
        if self._constant.max() >= PATIENCE:
            notes.append("constant")
        if last is not None and not still.all() and np.array_equal(block, last):
            notes.append("repeated")
        if self._doubled.max() >= PATIENCE:
            notes.append("duplicated")
        if sum(self._peaks) >= CLIPPED:
            notes.append("clipped")
        return tuple(notes)
