"""Which plant the observations are computed with: the only file of this package that knows there are several."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, Literal

from pitch import OneModeProcess, rightmost_root
from services.config import Case, load_case
from turning_sim import linear_parameters

PlantName = Literal["lumped", "surface"]
MODELS: dict[PlantName, dict[str, Any]] = {
    "lumped": {"process.cut": "linear", "process.directions": 1},
    "surface": {"process.cut": "surface", "process.directions": 2},
}
Progress = Callable[[float], None]


def prepared_case(plant: PlantName, name: str, changes: dict[str, Any] | None = None) -> Case:
    """Return a shipped case, with values changed, on the wanted plant.

    Parameters
    ----------
    plant
        `lumped`: one mode and a law linearised about the cut. `surface`: the surface as a map that each tool cuts.
    name
        Of the case.
    changes
        Values that replace those of the file.
    """
    return load_case(name, (changes or {}) | MODELS[plant])


def strongest_root(case: Case, position: float, shift: float) -> complex:
    """Return growth (1/s) and angular frequency (rad/s) of the strongest root of the linear process.

    Parameters
    ----------
    case
        The case.
    position
        Tools from the tip (m).
    shift
        Of turret 1 (rad).
    """
    linear = linear_parameters(case.workpiece, case.cutting, position)
    process = OneModeProcess(
        linear.mass_at_tools,
        linear.natural_frequency_hz,
        linear.damping_ratio,
        linear.overlap,
        linear.process_damping,
    )
    return rightmost_root(process, linear.cutting_stiffness, case.cutting.spindle_hz, 2.0 * shift)


def strongest_of_pass(case: Case, shift: float, positions: Sequence[float]) -> complex:
    """Return the strongest of the roots over several tool positions (m)."""
    return max((strongest_root(case, position, shift) for position in positions), key=lambda root: root.real)


def hertz(root: complex) -> float:
    """Return the frequency of a root (Hz)."""
    return abs(root.imag) / (2.0 * math.pi)


def feed_speed(case: Case) -> float:
    """Return how fast both tools travel along the bar (m/s)."""
    return case.cutting.feed_per_rev * case.cutting.spindle_hz
