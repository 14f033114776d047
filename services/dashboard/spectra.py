"""The scrolling spectrogram: one column of levels for each 50 ms of force, both axes added by power."""

from __future__ import annotations

from collections import deque

import numpy as np
from numpy.typing import NDArray

from services.dashboard.history import SPAN_S
from services.messages import Floats

HOP_S = 0.050
WINDOW_S = 0.100
FLOOR_DB, STEP_DB = -30.0, 0.3
"""Level (dB over 1 N) of byte 1, and from one byte to the next; byte 0 is nothing."""
COLUMNS = round(SPAN_S / HOP_S)


class Spectra:
    """Cuts a stream of force into windows on a grid and keeps their spectra as bytes.

    Parameters
    ----------
    sample_rate_hz
        Of the force.
    top_hz
        Highest frequency that is shown.

    Attributes
    ----------
    bin_hz
        Distance of two bins (Hz); the first is at 0.
    bins
        How many there are.
    head
        Number of the newest column, -1 before the first; column k ends at (k + 1) times the hop.
    """

    def __init__(self, sample_rate_hz: float, top_hz: float) -> None:
        self.sample_rate_hz = sample_rate_hz
        self._hop = max(1, round(HOP_S * sample_rate_hz))
        self._size = max(2, round(WINDOW_S * sample_rate_hz))
        self._taper = np.hanning(self._size + 2)[1:-1]
        self._scale = 2.0 / self._taper.sum()
        self.bin_hz = sample_rate_hz / (2 * self._size)
        self.bins = min(self._size, max(1, int(top_hz / self.bin_hz))) + 1
        self._held: Floats = np.zeros((2, 0))
        self._next = -1
        self._columns: deque[tuple[int, bytes]] = deque(maxlen=COLUMNS)

    @property
    def head(self) -> int:
        """Number of the newest column."""
        return self._columns[-1][0] if self._columns else -1

    def clear(self) -> None:
        """Forget everything."""
        self._held, self._next = np.zeros((2, 0)), -1
        self._columns.clear()

    def update(self, first: int, forces: Floats) -> None:
        """Take the samples from index `first` on, shape (2, n) (N); a gap empties the window."""
        if first != self._next:
            self._held = np.zeros((2, 0))
        self._held = np.concatenate([self._held, forces], axis=1)
        self._next = first + forces.shape[1]
        start = self._next - self._held.shape[1]
        end = max((start + self._size + self._hop - 1) // self._hop, self._next // self._hop - COLUMNS + 1) * self._hop
        while end <= self._next:
            self._add(end // self._hop - 1, self._held[:, end - self._size - start : end - start])
            end += self._hop
        self._held = self._held[:, -self._size :]

    def _add(self, column: int, forces: Floats) -> None:
        if column <= self.head:
            return
        with np.errstate(all="ignore"):  # NaN: a sensor that failed has an empty column
            amplitudes = np.fft.rfft(forces * self._taper, n=2 * self._size, axis=1)[:, : self.bins]
            power = np.square(np.abs(amplitudes)).sum(axis=0) * self._scale**2
            level = (10.0 * np.log10(power + 1e-12) - FLOOR_DB) / STEP_DB + 1.0
        level[np.isnan(level)] = 0.0
        self._columns.append((column, np.clip(level, 0.0, 255.0).astype(np.uint8).tobytes()))

    def since(self, column: int) -> tuple[list[int], bytes]:
        """Return the numbers of the columns behind `column`, and their bytes one after the other."""
        found = [item for item in self._columns if item[0] > column]
        return [number for number, _ in found], b"".join(levels for _, levels in found)


def levels_db(column: bytes) -> NDArray[np.float64]:
    """Return the levels (dB over 1 N) that the bytes of a column stand for."""
    return FLOOR_DB + STEP_DB * (np.frombuffer(column, np.uint8).astype(np.float64) - 1.0)
