"""The pitch difference that stands most: largest worst-case decay over what is not known.

Where the process is known, every candidate is judged by its slowest decay over a spread of natural frequency and
cutting stiffness and over the stretch of bar ahead. Where only chatter lines are known, by |cos(deps/2)|, what is left
of the regeneration, within the window of phases that was stable when measured: 0.7 to 1.1 pi (Yamada, PhD thesis, Keio
University, 2017, section 6.5.2). When nothing fits, that is said, and which spindle speed would help.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pitch._checks import positive, within
from pitch.choice import PlannerConfig, reachable
from pitch.many_roots import growth_rates, numbers_of
from pitch.stability import OneModeProcess

Floats = NDArray[np.float64]

MEASURED_WINDOW = (0.7, 1.1)
"""Phase differences over pi that were stable when measured; the same beside every whole turn."""
FINEST, MOST, FINER = 0.02, 600, 21
"""Step of the phase over pi from one candidate to the next, how many there are at most, and how many beside
the best one."""
BAR_WAVES = 0.5
"""Roots below this part of the natural frequency are waves of the delays alone, which no pitch changes much."""
SPEEDS = (0.0, -0.02, 0.02, -0.04, 0.04, -0.07, 0.07, -0.1, 0.1, -0.15, 0.15, -0.2, 0.2)
"""Changes of spindle speed that are tried when no pitch fits."""


IN_WINDOW = 81
"""Pitch differences that are compared within the window of some lines."""
SLOWER = tuple(0.97**k for k in range(1, 100))
"""Shares of the spindle speed that are tried when turret 1 can not go far enough for the lines: less needs less."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Spread:
    """What a pitch difference must stand.

    Attributes
    ----------
    frequency_hz : float
        Of the natural frequency, to either side (Hz).
    stiffness : float
        Of the cutting stiffness, to either side, relative.
    """

    frequency_hz: float = 10.0
    stiffness: float = 0.3

    def __post_init__(self) -> None:
        """Check the ranges."""
        within("frequency_hz", self.frequency_hz, 0.0, 500.0)
        within("stiffness", self.stiffness, 0.0, 0.95)


@dataclass(frozen=True, slots=True, kw_only=True)
class RobustPitch:
    """A pitch difference, how far it is from the edges of what is stable, or why there is none.

    Attributes
    ----------
    found : bool
        Whether one fits.
    pitch_difference : float
        (rad), nan without one.
    frequency_hz : float
        Line that phases and margins refer to (Hz).
    phase : float
        Phase difference of that line (rad).
    order : int
        Whole turns in it.
    worst_growth : float
        Over the spread (1/s), below zero where it is stable; nan when judged by lines alone.
    window : tuple of float
        Pitch differences between which it stays stable, or in the measured window (rad).
    reason : str
        Why it was chosen, or why nothing fits and what would help.
    """

    found: bool
    pitch_difference: float
    frequency_hz: float
    phase: float
    order: int
    worst_growth: float
    window: tuple[float, float]
    reason: str

    @property
    def margin(self) -> tuple[float, float]:
        """Pitch difference to the lower and the upper edge (rad)."""
        return self.pitch_difference - self.window[0], self.window[1] - self.pitch_difference

    @property
    def margin_pi(self) -> tuple[float, float]:
        """The same as phase over pi."""
        per = self.phase / self.pitch_difference / math.pi
        return self.margin[0] * per, self.margin[1] * per

    @property
    def margin_hz(self) -> tuple[float, float]:
        """How far the line may fall and rise with the phase still between those of the edges (Hz)."""
        scale = self.frequency_hz / self.pitch_difference
        return self.margin[0] * scale, self.margin[1] * scale


def robust_for_process(
    processes: Sequence[OneModeProcess],
    cutting_stiffness: float,
    spindle_hz: float,
    config: PlannerConfig,
    diameter: float,
    *,
    frequency_hz: float | None = None,
    spread: Spread | None = None,
) -> RobustPitch:
    """Return the pitch difference of largest worst-case decay rate.

    Parameters
    ----------
    processes : sequence of OneModeProcess
        Bar and cut at places along the stretch ahead.
    cutting_stiffness : float
        Radial, of one tool (N/m).
    spindle_hz : float
        Spindle speed (Hz).
    config : PlannerConfig
        Limits of shift and slides, highest order.
    diameter : float
        At the cutting point (m).
    frequency_hz : float or None
        Line that phases refer to (Hz); None for the strongest root at equal pitch.
    spread : Spread or None
        What it must stand.
    """
    if not processes:
        raise ValueError("processes must be at least one, got none")
    stands = spread or Spread()
    line = frequency_hz or _line(processes, cutting_stiffness, spindle_hz)
    for change in SPEEDS:
        speed = spindle_hz * (1.0 + change)
        candidates = _candidates(config, speed, line, diameter)
        if not candidates.size:
            continue
        worst = _worst(processes, positive("cutting_stiffness", cutting_stiffness), speed, candidates, stands)
        best = int(worst.argmin())
        if worst[best] >= 0.0:
            continue
        if change:
            return _none(line, f"{_room(config, diameter)} at {60 * spindle_hz:.0f} 1/min; try {60 * speed:.0f} 1/min")
        found = _found(candidates, np.asarray(worst < 0.0, dtype=np.bool_), best, float(worst[best]), line, speed)
        near = candidates[max(best - 1, 0) : best + 2]
        fine = np.linspace(near[0], near[-1], FINER)
        closer = _worst(processes, cutting_stiffness, speed, fine, stands)
        return _finer(found, float(fine[closer.argmin()]), float(closer.min()), speed)
    return _none(line, f"{_room(config, diameter)}, at no speed within 20 %")


def _finer(found: RobustPitch, difference: float, growth: float, spindle_hz: float) -> RobustPitch:
    if growth >= found.worst_growth:
        return found
    phase = difference * found.frequency_hz / spindle_hz
    return replace(
        found, pitch_difference=difference, phase=phase, order=int(phase // (2.0 * math.pi)), worst_growth=growth,
        reason=f"slowest decay {-growth:.1f} 1/s",
    )  # fmt: skip


def _room(config: PlannerConfig, diameter: float) -> str:
    if reachable(config, config.max_shift, diameter):
        return f"no stable pitch within a shift of {math.degrees(config.max_shift):.1f} deg"
    travel = max(abs(end) for end in (*config.x1_travel, *config.y1_travel))
    return f"no stable pitch within {1e3 * travel:g} mm of travel"


def robust_for_lines(
    lines_hz: Sequence[float], spindle_hz: float, config: PlannerConfig, diameter: float
) -> RobustPitch:
    """Return the pitch difference that leaves least regeneration of the worst of several lines.

    Parameters
    ----------
    lines_hz : sequence of float
        Chatter lines, or both edges of a band (Hz), the most important first.
    spindle_hz : float
        Spindle speed (Hz).
    config : PlannerConfig
        Limits of shift and slides, highest order.
    diameter : float
        At the cutting point (m).
    """
    lines = np.array([positive("lines_hz", line) for line in lines_hz])
    if not lines.size:
        raise ValueError("lines_hz must be at least one, got none")
    found = _of_lines(lines, spindle_hz, config, diameter)
    if found is not None:
        return found
    if lines.max() * MEASURED_WINDOW[0] > lines.min() * MEASURED_WINDOW[1]:
        widest = f"{lines.min():.0f}..{lines.max():.0f} Hz"
        return _none(float(lines[0]), f"no pitch puts {widest} between 0.7 and 1.1 pi at once, at any speed")
    room = f"{_room(config, diameter)} at {60 * spindle_hz:.0f} 1/min"
    for change in SLOWER:
        speed = spindle_hz * change
        if _of_lines(lines, speed, config, diameter) is not None:
            return _none(float(lines[0]), f"{room}; try {60 * speed:.0f} 1/min")
    return _none(float(lines[0]), f"{room}, nor at a twentieth of the speed")


def _of_lines(lines: Floats, spindle_hz: float, config: PlannerConfig, diameter: float) -> RobustPitch | None:
    """Return the pitch difference at one speed, None when none leaves all lines in the measured window."""
    grid = _candidates(config, spindle_hz, float(lines[0]), diameter)
    per_pi = math.pi * spindle_hz / lines
    best: tuple[float, float, float, float] | None = None
    for turns in np.unique((0.5 * grid[:, None] / per_pi).astype(np.int64), axis=0) if grid.size else ():
        low = float(((2.0 * turns + MEASURED_WINDOW[0]) * per_pi).max())
        high = min(float(((2.0 * turns + MEASURED_WINDOW[1]) * per_pi).min()), float(grid[-1]))
        inside = np.linspace(low, high, IN_WINDOW) if low <= high else np.empty(0)
        inside = np.array([d for d in inside.tolist() if reachable(config, 0.5 * d, diameter)])
        if inside.size:
            left = np.abs(np.cos(0.5 * math.pi * inside[:, None] / per_pi)).max(axis=1)
            found = (float(left.min()), float(inside[left.argmin()]), float(inside[0]), float(inside[-1]))
            best = min(best or found, found)
    if best is None:
        return None
    _, difference, low, high = best
    phase = difference * float(lines[0]) / spindle_hz
    return RobustPitch(
        found=True, pitch_difference=difference, frequency_hz=float(lines[0]), phase=phase,
        order=int(phase // (2.0 * math.pi)), worst_growth=math.nan, window=(low, high),
        reason="least regeneration of the worst line",
    )  # fmt: skip


def _candidates(config: PlannerConfig, spindle_hz: float, line_hz: float, diameter: float) -> Floats:
    """Return the pitch differences (rad) that turret 1 can reach and whose order is allowed, rising from above zero."""
    count = math.ceil(2.0 * config.max_shift * line_hz / positive("spindle_hz", spindle_hz) / math.pi / FINEST)
    shifts = np.linspace(0.0, config.max_shift, min(max(count, 2), MOST) + 1)[1:]
    orders = np.floor(shifts * line_hz / spindle_hz / math.pi)
    return 2.0 * np.array(
        [h for h, order in zip(shifts, orders, strict=True)
         if order <= config.max_order and reachable(config, float(h), diameter)]
    )  # fmt: skip


def _worst(
    processes: Sequence[OneModeProcess], stiffness: float, spindle_hz: float, candidates: Floats, spread: Spread
) -> Floats:
    """Return the largest growth rate over the spread for each candidate (1/s)."""
    scenes: list[tuple[float, ...]] = []
    for process in processes:
        mass, damping, k, overlap = numbers_of(process)
        for shift in {-spread.frequency_hz, 0.0, spread.frequency_hz}:
            softer = (1.0 + shift / process.natural_frequency_hz) ** 2
            for factor in {1.0 - spread.stiffness, 1.0, 1.0 + spread.stiffness}:
                scenes.append((mass, damping, k * softer, overlap, factor * stiffness))
    mass, damping, k, overlap, cut = (np.array(column)[:, None] for column in zip(*scenes, strict=True))
    growth = growth_rates(mass, damping, k, overlap, cut, spindle_hz, candidates, above=BAR_WAVES).real
    return np.asarray(growth.max(axis=0), dtype=np.float64)


def _line(processes: Sequence[OneModeProcess], stiffness: float, spindle_hz: float) -> float:
    roots = [complex(growth_rates(*numbers_of(process), stiffness, spindle_hz, 0.0)) for process in processes]
    return max(roots, key=lambda root: root.real).imag / (2.0 * math.pi)


def _found(
    candidates: Floats, good: NDArray[np.bool_], best: int, growth: float, line: float, spindle_hz: float
) -> RobustPitch:
    low = high = best
    while low > 0 and good[low - 1]:
        low -= 1
    while high + 1 < len(good) and good[high + 1]:
        high += 1
    difference = float(candidates[best])
    phase = difference * line / spindle_hz
    return RobustPitch(
        found=True, pitch_difference=difference, frequency_hz=line, phase=phase,
        order=int(phase // (2.0 * math.pi)), worst_growth=growth,
        window=(float(candidates[low]), float(candidates[high])), reason=f"slowest decay {-growth:.1f} 1/s",
    )  # fmt: skip


def _none(line: float, reason: str) -> RobustPitch:
    nothing = math.nan
    return RobustPitch(
        found=False, pitch_difference=nothing, frequency_hz=line, phase=nothing, order=0, worst_growth=nothing,
        window=(nothing, nothing), reason=reason,
    )  # fmt: skip
