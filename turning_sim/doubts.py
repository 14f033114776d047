"""Where the model ends: what lies outside its range is said, never silently computed."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from turning_sim.cutting import Cutting
from turning_sim.process import ProcessModel
from turning_sim.workpiece import Workpiece

_DEPTH = (0.05e-3, 0.5e-3)
_SPEED_HZ = (10.0, 50.0)
_FREQUENCY_HZ = (300.0, 1500.0)
_SHIFT = math.radians(20.0)
_BUCKLING_SHARE = 0.1
_ROUNDING = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class Doubt:
    """A quantity outside the range in which the model holds.

    Attributes
    ----------
    name : str
        Of the quantity.
    value : float
        What it is (SI).
    least, most : float
        Between what it should be (SI).
    reason : str
        What the model leaves out otherwise.
    """

    name: str
    value: float
    least: float = -math.inf
    most: float = math.inf
    reason: str

    def __str__(self) -> str:
        """Return one sentence, in SI."""
        return self.sentence(self.name)

    def sentence(self, name: str, unit: float = 1.0) -> str:
        """Return one sentence with another name for the quantity, in a unit of so much SI."""
        least, most = self.least / unit, self.most / unit
        rule = f"in {least:.6g}...{most:.6g}" if math.isfinite(least) else f"at most {most:.6g}"
        return f"{name} should be {rule}, got {self.value / unit:.6g}: {self.reason}"


def validity(
    workpiece: Workpiece,
    cutting: Cutting,
    *,
    model: ProcessModel | None = None,
    tool_position: float = 0.0,
    shift: float = 0.0,
) -> tuple[Doubt, ...]:
    """Return what lies outside the range of the model, nothing if all is well.

    What has no meaning at all (a bar without length, a feed beyond the nose) is refused when the objects are made.

    Parameters
    ----------
    workpiece : Workpiece
        The bar.
    cutting : Cutting
        The cut.
    model : ProcessModel or None
        How it is computed; None for the linear cut.
    tool_position : float
        Of the tools from the tip (m).
    shift : float
        Largest shift of turret 1 (rad).
    """
    model = ProcessModel() if model is None else model
    return (*_of_cut(cutting, model), *_of_bar(workpiece, cutting, tool_position), *_of_shift(shift))


def _of_cut(cutting: Cutting, model: ProcessModel) -> Iterator[Doubt]:
    depth, radius, feed = cutting.depth_of_cut, cutting.nose_radius, cutting.feed_per_rev / 2.0
    nose = radius * (1.0 - math.cos(min(cutting.approach_angle, math.pi / 2.0)))
    yield from _within("depth_of_cut", depth, _DEPTH, "force law and size effect are fitted there")
    if model.cut == "linear":
        reason = "beyond the height of the nose the flank cuts too; stiffness and overlap must belong to this depth"
        yield from _within("depth_of_cut", depth, (-math.inf, nose), reason)
    reason = "beyond a third of the nose radius the chip is no longer that of a nose"
    yield from _within("feed_per_tool", feed, (-math.inf, radius / 3.0), reason)
    yield from _within("spindle_hz", cutting.spindle_hz, _SPEED_HZ, "process damping is fitted there")


def _of_bar(workpiece: Workpiece, cutting: Cutting, tool_position: float) -> Iterator[Doubt]:
    mode = workpiece.modes(tool_position)[0]
    mass = mode.modal_mass / max(mode.shape, 1e-6) ** 2
    natural = mode.natural_frequency_hz
    stiffened = math.sqrt(natural**2 + 2.0 * cutting.cutting_stiffness / mass / (2.0 * math.pi) ** 2)
    reason = "tool and turret modes, or several edges in one wave, are left out"
    yield from _within("natural_frequency_hz", natural, _FREQUENCY_HZ, reason)
    yield from _within("stiffened_frequency_hz", stiffened, _FREQUENCY_HZ, reason)
    inertia = math.pi * workpiece.cutting_diameter**4 / 64.0
    euler = math.pi**2 * workpiece.young_modulus * inertia / (4.0 * workpiece.length**2)
    axial = 2.0 * cutting.steady_forces[0] * math.tan(cutting.chip.thrust_direction)
    reason = "beyond a tenth of Euler's load the feed force softens the bar, which may buckle"
    yield from _within("feed_force", axial, (-math.inf, _BUCKLING_SHARE * euler), reason)
    radius = workpiece.cutting_diameter / 2.0
    yield from _within("depth_of_cut", cutting.depth_of_cut, (-math.inf, radius), "nothing is left of the bar")


def _of_shift(shift: float) -> Iterator[Doubt]:
    yield from _within("shift", shift, (-_SHIFT, _SHIFT), "the tool no longer keeps its angles")


def _within(name: str, value: float, limits: tuple[float, float], reason: str) -> Iterator[Doubt]:
    slack = _ROUNDING * abs(value)
    if not limits[0] - slack <= value <= limits[1] + slack:
        yield Doubt(name=name, value=value, least=limits[0], most=limits[1], reason=reason)
