"""How much of the process a simulator computes, and the numbers of the surface map."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from turning_sim import _surface_kernels as kernels
from turning_sim._check import require
from turning_sim.cutting import Cutting

TURN_OVER = math.radians(75.0)
"""Beyond this angle the edge is computed without the map, whose cells are too long for a steep flank: at 88 deg the
overlap would be 0.004 off."""
_AHEAD = 150e-6
_BEHIND = 100e-6
_PASSES = 12


@dataclass(frozen=True, slots=True, kw_only=True)
class ProcessModel:
    """How much of the process a simulator computes.

    Attributes
    ----------
    cut : {"linear", "surface"}
        Force linear about the steady cut, with one wave to remember for each tool; or a map of the surface over angle
        and place along the bar that each tool's profile cuts, in which case `cutting_stiffness`, `tangential_ratio` and
        `overlap` of the cut are not used: they follow.
    directions : int
        In which the bar bends: 1 along X1, 2 along X1 and Y1'. The surface map has 2.
    thrust_direction : {"live", "steady"}
        Whether the direction of the thrust follows the engaged edge of the surface map.
    cell : float
        Largest distance of two heights along the bar (m).
    """

    cut: Literal["linear", "surface"] = "linear"
    directions: int = 1
    thrust_direction: Literal["live", "steady"] = "live"
    cell: float = 5e-6

    def __post_init__(self) -> None:
        require(self.cut in ("linear", "surface"), "cut", "linear or surface", self.cut)
        require(self.directions in (1, 2), "directions", "1 or 2", self.directions)
        require(self.cut == "linear" or self.directions == 2, "directions", "2 with the surface map", self.directions)
        require(
            self.thrust_direction in ("live", "steady"), "thrust_direction", "live or steady", self.thrust_direction
        )
        require(0.1e-6 <= self.cell <= 10e-6, "cell", "in 0.1e-6...10e-6", self.cell)


@dataclass(frozen=True, slots=True, kw_only=True)
class CutDerivatives:
    """What the steady cut answers to small changes of depth.

    Attributes
    ----------
    stiffness, tangential_stiffness : float
        Rise of the radial and of the tangential force of one tool with its depth (N/m).
    overlap, tangential_overlap : float
        Fall of each with the depth of the pass before, over that rise.
    area_overlap : float
        The same of the chip area: geometry alone.
    """

    stiffness: float
    tangential_stiffness: float
    overlap: float
    tangential_overlap: float
    area_overlap: float


def grid_of(cutting: Cutting, model: ProcessModel) -> kernels.Map:
    """Return the numbers of the map."""
    half, radius, law = cutting.feed_per_rev / 2.0, cutting.nose_radius, cutting.force_law
    count = math.ceil(half / model.cell)
    dz = half / count
    turn_over = min(cutting.approach_angle, TURN_OVER)
    behind = cutting.feed_per_rev + _reach(_BEHIND, radius, turn_over)
    chip = cutting.chip
    return kernels.Map(
        dz=dz,
        half_feed=count,
        tip=math.ceil(behind / dz),
        depth=cutting.depth_of_cut,
        deepest=_AHEAD,
        radius=radius,
        turn_over=turn_over,
        approach=cutting.approach_angle,
        flank=radius * (1.0 - math.cos(turn_over)) if cutting.approach_angle > turn_over else math.inf,
        thrust=law.thrust_coefficient,
        tangential=law.tangential_coefficient,
        thrust_exponent=law.thrust_exponent,
        tangential_exponent=law.tangential_exponent,
        reference_edge=chip.edge_length,
        live=model.thrust_direction == "live",
        steady_cos=math.cos(chip.thrust_direction),
    )


def cells_of(grid: kernels.Map) -> int:
    """Return how many heights a column has."""
    ahead = _reach(grid.depth + _AHEAD, grid.radius, grid.turn_over)
    return grid.tip + math.ceil(ahead / grid.dz) + 3


def columns_of(grid: kernels.Map, depths: np.ndarray, offsets: tuple[float, float] = (0.0, 0.0)) -> np.ndarray:
    """Return what a tool leaves after a history.

    Parameters
    ----------
    grid : Map
        The map.
    depths : ndarray
        How much deeper than nominal each pass was (m), its own first, then backwards, shape (passes, n).
    offsets : tuple of float
        How far the tool itself and the other one run ahead of their cells (m).

    Returns
    -------
    ndarray
        Heights (m), shape (n, cells).
    """
    columns = np.empty((depths.shape[1], cells_of(grid)))
    ahead = np.array([offsets[k % 2] for k in range(depths.shape[0])])
    kernels.past_columns(grid, np.ascontiguousarray(depths), ahead, columns)
    return columns


def cut_derivatives(cutting: Cutting, model: ProcessModel, change: float = 0.2e-6) -> CutDerivatives:
    """Return how the force on the map answers to small changes of depth (m), by central differences."""
    grid = grid_of(cutting, model)
    now = np.array(_answer(grid, change, 0.0)) - np.array(_answer(grid, -change, 0.0))
    before = np.array(_answer(grid, 0.0, -change)) - np.array(_answer(grid, 0.0, change))
    rise = now / (2.0 * change)
    overlap = before / now
    return CutDerivatives(
        stiffness=float(rise[0]),
        tangential_stiffness=float(rise[1]),
        overlap=float(overlap[0]),
        tangential_overlap=float(overlap[1]),
        area_overlap=float(overlap[2]),
    )


def _answer(grid: kernels.Map, now: float, before: float) -> tuple[float, float, float]:
    """Return both forces (N) and the area (m2) of one tool for its depth and that of the pass before (m)."""
    depths = np.zeros((_PASSES, 1))
    depths[0] = before
    left = columns_of(grid, depths)[0]
    old = np.concatenate([left[grid.half_feed :], np.full(grid.half_feed, grid.depth)])
    tool, gap, extra, out = np.empty((4, old.size)), np.empty(old.size), np.empty(old.size), np.empty(kernels.ANSWERS)
    kernels.tool_profile(grid, 0.0, tool)
    kernels.gap(old, tool, gap, extra)
    kernels.engaged(grid, tool, gap, extra, now, out)
    kernels.lean_over(grid, now, before, out)
    radial, tangential = kernels.chip_forces(grid, tool, out)
    return radial, tangential, float(out[kernels.AREA])


def _reach(height: float, radius: float, turn_over: float) -> float:
    """Return how far from its tip the tool is so high (m)."""
    full = radius * (1.0 - math.cos(turn_over))
    if height < full:
        return math.sqrt(radius**2 - (radius - height) ** 2)
    return radius * math.sin(turn_over) + (height - full) / math.tan(turn_over)
