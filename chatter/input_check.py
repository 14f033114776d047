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

SIGNS: tuple[tuple[int, Note], ...] = (
    (kernels.CONSTANT, "constant"), (kernels.REPEATED, "repeated"), (kernels.DUPLICATED, "duplicated"),
    (kernels.CLIPPED, "clipped"),
)  # fmt: skip
NOTES: tuple[tuple[Note, ...], ...] = tuple(
    tuple(note for bit, note in SIGNS if signs & bit) for signs in range(2 * kernels.CLIPPED)
)
"""Notes for every set of signs."""


class InputCheck:
    """Looks at every block before it is filtered.

    Parameters
    ----------
    channels : int
        Number of channels.
    """

    def __init__(self, channels: int) -> None:
        self._constant, self._doubled = (np.zeros(channels, dtype=np.int64) for _ in range(2))
        self._ends = np.array([np.full(channels, np.inf), np.full(channels, -np.inf)])
        self._peaks = np.zeros(PATIENCE, dtype=np.int64)
        self._last: Floats = np.zeros((0, channels))

    def look(self, block: Floats) -> tuple[Note, ...]:
        """Take a block and return what is wrong with it.

        Parameters
        ----------
        block : ndarray, shape (n, channels)
            Samples as they came, all finite.
        """
        known = self._last.shape == block.shape
        if not known:
            self._last = np.empty(block.shape)
        return NOTES[
            kernels.look(
                block, self._last, known, FLAT, STEEP, ALONE, CLIPPED, self._ends, self._constant, self._doubled,
                self._peaks,
            )
        ]  # fmt: skip
