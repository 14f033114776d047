"""Force of an end mill along the feed: the load case on which force observers are judged."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from turning_sim._check import require

_GROOVE = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class Milling:
    """A cut with a cylindrical end mill, rigid (mechanistic): force proportional to the area of the chip.

    Attributes
    ----------
    spindle_hz : float
        (revolutions/s)
    teeth : int
        Evenly spaced.
    feed_per_tooth : float
        (m)
    tool_diameter : float
        (m)
    axial_depth, radial_depth : float
        (m), the latter up to the diameter (slotting).
    direction : {"down", "up"}
        Which side of the tool cuts when it is not a slot.
    tangential_coefficient, radial_coefficient : float
        Force over area of chip (Pa).
    helix_angle : float
        Of the flutes (rad).
    runout : float
        Of the tool: how much deeper one tooth cuts than the one before it by turns, `runout` times +1 and -1 with two
        teeth, along a cosine with more (m).
    """

    spindle_hz: float
    teeth: int
    feed_per_tooth: float
    tool_diameter: float
    axial_depth: float
    radial_depth: float
    direction: Literal["down", "up"] = "down"
    tangential_coefficient: float
    radial_coefficient: float
    helix_angle: float = 0.0
    runout: float = 0.0

    def __post_init__(self) -> None:
        names = ("spindle_hz", "feed_per_tooth", "tool_diameter", "axial_depth", "radial_depth")
        for name in (*names, "tangential_coefficient"):
            require(0.0 < getattr(self, name) < math.inf, name, "finite and positive", getattr(self, name))
        require(self.teeth >= 1, "teeth", "at least 1", self.teeth)
        require(self.radial_depth <= self.tool_diameter, "radial_depth", "at most tool_diameter", self.radial_depth)
        require(self.direction in ("down", "up"), "direction", "'down' or 'up'", self.direction)
        radial = self.radial_coefficient
        require(0.0 <= radial < math.inf, "radial_coefficient", "finite and at least 0", radial)
        require(0.0 <= self.helix_angle <= 1.3, "helix_angle", "in [0, 1.3] rad", self.helix_angle)
        require(abs(self.runout) < self.feed_per_tooth, "runout", "below feed_per_tooth", self.runout)

    @property
    def tooth_pass_hz(self) -> float:
        """Teeth per second (Hz)."""
        return self.teeth * self.spindle_hz

    @property
    def feed_rate(self) -> float:
        """Speed of the stage (m/s)."""
        return self.feed_per_tooth * self.tooth_pass_hz

    @property
    def engagement(self) -> tuple[float, float]:
        """Angles at which a tooth enters and leaves, from the normal of the feed on the up side (rad)."""
        cut = math.acos(1.0 - 2.0 * self.radial_depth / self.tool_diameter)
        return (math.pi - cut, math.pi) if self.direction == "down" else (0.0, cut)

    def force(self, time: np.ndarray) -> np.ndarray:
        """Return the force along the feed, positive against it (N), shape of `time`.

        Y. Altintas, Manufacturing Automation, 2nd ed. 2012, pp. 35-46, without edge forces; the helix is integrated in
        closed form.

        Parameters
        ----------
        time : ndarray
            (s)
        """
        turned = 2.0 * math.pi * self.spindle_hz * np.asarray(time, dtype=np.float64)
        total = np.zeros_like(turned)
        for tooth in range(self.teeth):
            pitch = 2.0 * math.pi * tooth / self.teeth
            deeper = self.runout * math.cos(pitch)
            total += self._tooth((turned - pitch) % (2.0 * math.pi), deeper)
        return self.axial_depth * total

    def _tooth(self, angle: np.ndarray, deeper: float) -> np.ndarray:
        """Return the force of one tooth over the axial depth (N/m); `angle` is that of its tip, the helix trails."""
        enter, leave = self.engagement
        least = math.asin(-deeper / self.feed_per_tooth)
        enter, leave = max(enter, least), min(leave, math.pi - least)
        lag = 2.0 * self.axial_depth * math.tan(self.helix_angle) / self.tool_diameter
        if lag < _GROOVE:
            inside = (angle >= enter) & (angle < leave)
            return np.where(inside, self._edge(angle, deeper), 0.0)
        total = np.zeros_like(angle)
        for turn in range(2 + int(lag / (2.0 * math.pi))):
            tip = np.clip(angle + 2.0 * math.pi * turn, enter, leave)
            top = np.clip(angle + 2.0 * math.pi * turn - lag, enter, leave)
            total += self._along_edge(tip, deeper) - self._along_edge(top, deeper)
        return total / lag

    def _edge(self, angle: np.ndarray, deeper: float) -> np.ndarray:
        chip = self.feed_per_tooth * np.sin(angle) + deeper
        push = self.tangential_coefficient * np.cos(angle) + self.radial_coefficient * np.sin(angle)
        return chip * push

    def _along_edge(self, angle: np.ndarray, deeper: float) -> np.ndarray:
        """Return the integral of `_edge` over the angle."""
        tangential, radial = self.tangential_coefficient, self.radial_coefficient
        thin = 0.5 * tangential * np.sin(angle) ** 2 + 0.5 * radial * (angle - np.sin(angle) * np.cos(angle))
        return self.feed_per_tooth * thin + deeper * (tangential * np.sin(angle) - radial * np.cos(angle))


def thesis_condition(number: int, helix_angle: float = 0.0) -> Milling:
    """Return a condition of the milling simulations, thesis (Yamada, 2017) Table 4-2.

    The table is silent on helix, run-out and edge forces: none of them is assumed here.

    Parameters
    ----------
    number : int
        1 and 2: 1 mm radial depth, down milling, at 2000 and 6000 1/min; 3 and 4: slots at the same speeds.
    helix_angle : float
        (rad)
    """
    require(number in (1, 2, 3, 4), "condition", "1, 2, 3 or 4", number)
    return Milling(
        spindle_hz=(2000.0 if number in (1, 3) else 6000.0) / 60.0,
        teeth=2,
        feed_per_tooth=30e-6,
        tool_diameter=6e-3,
        axial_depth=1e-3,
        radial_depth=1e-3 if number < 3 else 6e-3,
        tangential_coefficient=1800e6,
        radial_coefficient=820e6,
        helix_angle=helix_angle,
    )
