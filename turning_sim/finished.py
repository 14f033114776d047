"""The finished surface as the map left it: heights along the bar on lines at fixed angles."""

from __future__ import annotations

import math

import numpy as np

from turning_sim.surface import mean_roughness

LINES = 4


class FinishedSurface:
    """Heights that no tool will touch again, on lines along the bar a quarter turn apart.

    Parameters
    ----------
    spacing : float
        Of the heights along the bar (m).
    first : float
        Place of the first height from the tool that left it (m).
    """

    def __init__(self, spacing: float, first: float) -> None:
        self.spacing, self._first = spacing, first
        self._last = math.nan
        self._places: list[list[float]] = [[] for _ in range(LINES)]
        self._heights: list[list[np.ndarray]] = [[] for _ in range(LINES)]

    def copy(self) -> FinishedSurface:
        """Return one that grows on its own."""
        twin = FinishedSurface(self.spacing, self._first)
        twin._last = self._last
        twin._places = [list(places) for places in self._places]
        twin._heights = [list(heights) for heights in self._heights]
        return twin

    def add(self, phase: np.ndarray, position: np.ndarray, tails: np.ndarray) -> None:
        """Take what tool 2 left at phases (rad) and positions (m), a feed of heights (m) each, shape (n, cells)."""
        if phase.size == 0:
            return
        quarter = np.floor(phase * (LINES / (2.0 * math.pi)))
        before = np.concatenate([[self._last], quarter[:-1]])
        self._last = float(quarter[-1])
        for i in np.flatnonzero(quarter > before):
            line = int(quarter[i]) % LINES
            self._places[line].append(float(position[i]) + self._first)
            self._heights[line].append(tails[i].copy())

    def line(self, number: int = 0) -> tuple[np.ndarray, np.ndarray]:
        """Return places along the bar (m) and heights over the nominal surface (m) of one line, shape (n,)."""
        heights = self._heights[number % LINES]
        if not heights:
            return np.zeros(0), np.zeros(0)
        cells = np.arange(heights[0].size) * self.spacing
        places = np.array(self._places[number % LINES])
        return (places[:, None] + cells).ravel(), np.concatenate(heights)

    def roughness(self, start: float, stop: float) -> float:
        """Return Ra (m) between two places along the bar (m), mean of the lines; nan where nothing is finished."""
        found = []
        for number in range(LINES):
            place, height = self.line(number)
            inside = (place >= start) & (place < stop)
            if place.size == 0 or place[0] > start or place[-1] < stop - 2.0 * self.spacing:
                return math.nan
            found.append(mean_roughness(height[inside], self.spacing))
        return float(np.mean(found))
