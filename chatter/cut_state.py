"""Whether the tools cut, from the signal alone, when nobody says so."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

RISE = 9.0
"""Power of the noise between the lines over that before, from which the tools are in the cut (9.5 dB)."""
FALL = 3.0
"""The same below which they are not."""
STEP = 8.0
"""Departure of the mean over its own scatter, and ..."""
STEP_RMS = 3.0
"""... over the root mean square in air, from which the tools are in the cut: a steady force came."""
HOLD = 5
"""Blocks in a row that a change must last."""
LEARNING = 30
"""Blocks from which the level before is learned."""
MEMORY = 500
"""Blocks over which it follows slow drift."""


class CutState:
    """Compares every block with what the signal was like before; None until it has changed once.

    Parameters
    ----------
    channels : int
        Number of channels.
    """

    def __init__(self, channels: int) -> None:
        self.cutting: bool | None = None
        self.seen = self.held = 0
        self.floor = self.rms = 0.0
        self.mean, self.scatter = np.zeros(channels), np.zeros(channels)

    def look(self, block: Floats, floor: float) -> bool | None:
        """Take a block and return whether the tools cut.

        Parameters
        ----------
        block : ndarray, shape (n, channels)
            Samples as they came.
        floor : float
            Power of the noise between the lines of the band.
        """
        mean = block.mean(axis=0)
        rms = float(np.sqrt(((block - mean) ** 2).sum(axis=1).mean()))
        if self.seen < LEARNING:
            self._learn(mean, floor, rms)
            return self.cutting
        away = np.abs(mean - self.mean)
        stepped = bool(((away > STEP * np.sqrt(self.scatter)) & (away > STEP_RMS * self.rms)).any())
        above = stepped or floor > (FALL if self.cutting else RISE) * self.floor
        below = self.cutting is None and floor * RISE < self.floor
        self.held = self.held + 1 if below or above is not bool(self.cutting) else 0
        if self.held >= HOLD:
            self.held = 0
            if below:  # what was taken for air was the cut
                self.seen = 0
                self.cutting = False
            else:
                self.cutting = above
        elif not above and not below:
            self._learn(mean, floor, rms)
        return self.cutting

    def _learn(self, mean: Floats, floor: float, rms: float) -> None:
        self.seen = min(self.seen + 1, MEMORY)
        share = 1.0 / self.seen
        before = self.mean
        self.mean = before + share * (mean - before)
        self.scatter = (1.0 - share) * (self.scatter + share * (mean - before) ** 2)
        self.floor += share * (floor - self.floor)
        self.rms += share * (rms - self.rms)
