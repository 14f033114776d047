"""Which chuck holds the bar: two measured frequencies give its two stiffnesses."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares

from turning_sim._check import require
from turning_sim.workpiece import Chuck, Workpiece

_RIGID = 1e6
_CLOSE = 1e-7
_STARTS = ((200.0, 5.0), (20.0, 5.0), (20.0, 0.5), (200.0, 50.0))
_RANGE = (math.log(1e-3), math.log(_RIGID))


@dataclass(frozen=True, slots=True, kw_only=True)
class HammerTest:
    """One measured bending frequency.

    Attributes
    ----------
    length : float
        Projection of the bar from the chuck (m).
    frequency_hz : float
        (Hz)
    mode : int
        1 to 3, the lowest first.
    """

    length: float
    frequency_hz: float
    mode: int = 1

    def __post_init__(self) -> None:
        require(self.length > 0.0, "length", "positive", self.length)
        require(self.frequency_hz > 0.0, "frequency_hz", "positive", self.frequency_hz)
        require(self.mode in (1, 2, 3), "mode", "1, 2 or 3", self.mode)


def identify_chuck(workpiece: Workpiece, first: HammerTest, second: HammerTest) -> Chuck:
    """Return the chuck with which the bar has two measured frequencies.

    Parameters
    ----------
    workpiece : Workpiece
        The bar; its length and its chuck are replaced, the loss of the chuck is kept.
    first, second : HammerTest
        At two projections, or two modes at one.

    Returns
    -------
    Chuck
        Lateral and tilt stiffness.
    """
    tests = (first, second)
    same = first.length == second.length and first.mode == second.mode
    require(not same, "second", "another projection or another mode", second)
    unit = _bending_stiffness(workpiece, first.length)
    for test in tests:
        rigid = _frequency_hz(workpiece, test, _RIGID * unit)
        require(test.frequency_hz < rigid, "frequency_hz", f"below {rigid:.6g} (rigid chuck)", test.frequency_hz)

    def miss(logarithms: np.ndarray) -> list[float]:
        stiffness = np.exp(logarithms) * unit
        return [math.log(_frequency_hz(workpiece, t, stiffness) / t.frequency_hz) for t in tests]

    for start in np.log(_STARTS):
        found = least_squares(miss, start, bounds=_RANGE, diff_step=1e-5, xtol=1e-7, ftol=1e-15, gtol=1e-15)
        if float(np.hypot(*found.fun)) < _CLOSE:
            lateral, tilt = (np.exp(found.x) * unit).tolist()
            return replace(workpiece.chuck, lateral_stiffness=lateral, tilt_stiffness=tilt)
    values = (first.frequency_hz, second.frequency_hz)
    raise ValueError(f"frequency_hz must be a pair that some chuck gives this bar, got {values}")


def _bending_stiffness(workpiece: Workpiece, length: float) -> np.ndarray:
    """Return EI/L^3 (N/m) and EI/L (N m/rad), the scales of the two springs."""
    bending = workpiece.young_modulus * math.pi * workpiece.diameter**4 / 64.0
    return np.array([bending / length**3, bending / length])


def _frequency_hz(workpiece: Workpiece, test: HammerTest, stiffness: np.ndarray) -> float:
    lateral, tilt = stiffness.tolist()
    ratios = (*workpiece.damping_ratios, *(0.01,) * 3)[: test.mode]
    bar = replace(
        workpiece,
        length=test.length,
        turned_length=min(workpiece.turned_length, 0.999 * test.length),
        chuck=Chuck(lateral_stiffness=lateral, tilt_stiffness=tilt),
        damping_ratios=ratios,
    )
    return bar.modes(0.0)[test.mode - 1].natural_frequency_hz
