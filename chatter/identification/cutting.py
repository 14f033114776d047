"""Cutting coefficients from mean forces over feed: a straight line whose slope cuts and whose start is the edge.

Altintas, Manufacturing Automation, 2nd ed., Cambridge 2012, section 2.8.1, eqs. (2.91) to (2.93) for slots; for turning
F = K_c b f + K_e b.
"""

from dataclasses import dataclass
from math import pi

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import stdtrit

Floats = NDArray[np.float64]

LEAST_FEEDS = 3
GOOD_FIT = 0.95
_CURVED = 3.0
_POOR = 0.15


@dataclass(frozen=True, slots=True, kw_only=True)
class Coefficient:
    """A cutting and an edge coefficient.

    Parameters
    ----------
    cutting, edge : float
        (N/m^2) and (N/m).
    cutting_std, edge_std : float
        Their standard deviations, infinite for two feeds.
    half_width : float
        Half of the interval of the cutting coefficient that holds the truth in 95 of 100 cases (N/m^2).
    r_squared : float
        Part of the variance over feed that the line explains.
    flags : tuple of str
        Why not to trust it.
    """

    cutting: float
    edge: float
    cutting_std: float
    edge_std: float
    half_width: float
    r_squared: float
    flags: tuple[str, ...] = ()


def mean_forces(feed: ArrayLike, force: ArrayLike) -> tuple[Floats, Floats]:
    """Return the different feeds, shape (m,), and the mean force at each, shape (m,).

    Parameters
    ----------
    feed : array_like, shape (n,)
        Of each sample or cut (m).
    force : array_like, shape (n,)
        (N); NaN is left out.
    """
    f, y = np.asarray(feed, dtype=np.float64), np.asarray(force, dtype=np.float64)
    good = np.isfinite(f) & np.isfinite(y)
    feeds, at = np.unique(np.round(f[good], 9), return_inverse=True)
    return feeds, np.bincount(at, weights=y[good]) / np.bincount(at) if feeds.size else np.zeros(0)


def cutting_coefficient(feed: ArrayLike, force: ArrayLike, depth: float) -> Coefficient:
    """Return the coefficients of one direction in turning.

    Parameters
    ----------
    feed : array_like, shape (n,)
        Per revolution (m).
    force : array_like, shape (n,)
        Mean (N).
    depth : float
        Of cut (m).
    """
    return _line(feed, force, 1.0 / _positive("depth", depth), 1.0 / depth)


def slotting_coefficient(
    feed: ArrayLike, force: ArrayLike, depth: float, teeth: int, direction: str = "tangential"
) -> Coefficient:
    """Return the coefficients of one direction from slots cut by a cylindrical mill.

    Parameters
    ----------
    feed : array_like, shape (n,)
        Per tooth (m).
    force : array_like, shape (n,)
        Mean (N): against the feed for radial, across it for tangential, along the axis for axial.
    depth : float
        Axial (m).
    teeth : int
        Of the mill.
    direction : {"tangential", "radial", "axial"}
        Which coefficient the force tells.
    """
    if direction not in ("tangential", "radial", "axial"):
        raise ValueError(f"direction must be tangential, radial or axial, got {direction!r}")
    if teeth < 1:
        raise ValueError(f"teeth must be at least 1, got {teeth}")
    width = teeth * _positive("depth", depth)
    return _line(feed, force, pi / width if direction == "axial" else 4.0 / width, 2.0 / width if direction == "axial"
                 else pi / width)  # fmt: skip


def _positive(name: str, value: float) -> float:
    if not (np.isfinite(value) and value > 0.0):
        raise ValueError(f"{name} must be positive and finite, got {value}")
    return float(value)


def _line(feed: ArrayLike, force: ArrayLike, per_slope: float, per_start: float) -> Coefficient:
    feeds, forces = mean_forces(feed, force)
    if feeds.size < 2:
        raise ValueError(f"feed must take at least two values, got {feeds.size}")
    if feeds[0] < 0.0:
        raise ValueError(f"feed must be at least 0, got {feeds[0]}")
    sign = -1.0 if np.polyfit(feeds, forces, 1)[0] < 0.0 else 1.0
    rows = np.column_stack([feeds, np.ones(feeds.size)])
    scale = np.array([feeds.max(), 1.0])
    (slope, start), left = np.linalg.lstsq(rows / scale, forces, rcond=None)[0] / scale, np.zeros(0)
    left = forces - rows @ [slope, start]
    free = feeds.size - 2
    spread = np.linalg.inv((rows / scale).T @ (rows / scale)) * (float(left @ left) / free if free else np.inf)
    stds = np.sqrt(np.maximum(spread.diagonal(), 0.0)) / scale if free else np.full(2, np.inf)
    total = float(np.sum((forces - forces.mean()) ** 2))
    r_squared = 1.0 - float(left @ left) / total if total > 0.0 else 0.0
    width = float(stdtrit(free, 0.975)) * stds[0] if free else np.inf
    return Coefficient(
        cutting=sign * slope * per_slope, edge=sign * start * per_start, cutting_std=float(stds[0]) * per_slope,
        edge_std=float(stds[1]) * per_start, half_width=float(width) * per_slope, r_squared=r_squared,
        flags=_flags(feeds, forces, sign * slope, sign * start, float(stds[0]), float(stds[1]), r_squared),
    )  # fmt: skip


def _flags(
    feeds: Floats, forces: Floats, slope: float, start: float, slope_std: float, start_std: float, r_squared: float
) -> tuple[str, ...]:
    flags: list[str] = []
    if feeds.size < LEAST_FEEDS:
        flags.append(f"{feeds.size} feeds: a line through two points tells nothing of its error")
    if feeds.max() < 1.5 * feeds.min():
        flags.append("the feeds lie close together: the edge coefficient rests on an extrapolation")
    if r_squared < GOOD_FIT:
        flags.append(f"poor fit: the line explains {100.0 * r_squared:.0f} % of the variance")
    elif slope_std > _POOR * slope:
        flags.append(f"the cutting coefficient is poorly determined: {100.0 * slope_std / slope:.0f} %")
    if start < 0.0 and start < -2.0 * start_std:
        flags.append("the edge coefficient is negative: an offset of the dynamometer, or a force that is not linear")
    if feeds.size >= 5:
        curve, spread = np.polyfit(feeds / feeds.max(), forces, 2, cov="unscaled")
        left = forces - np.polyval(curve, feeds / feeds.max())
        std = np.sqrt(spread[0, 0] * float(left @ left) / (feeds.size - 3))
        if abs(curve[0]) > _CURVED * std and abs(curve[0]) > 0.05 * float(np.ptp(forces)):
            flags.append("the force bends over feed: thin chips cut harder than a line says")
    return tuple(flags)
