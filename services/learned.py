"""Limits that a monitor has learned before, as a case file holds them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Self

LEVELS = ("air", "cut")
_PARTS = ("windows", "power", "square", "fourth")


@dataclass(frozen=True, slots=True, kw_only=True)
class Learned:
    """What was learned in air and in quiet cutting: the level of the force in the band (SI).

    Attributes
    ----------
    air_windows, cut_windows
        How many windows of noise were heard.
    air_power, cut_power
        Mean square of the line of each bin (N^2).
    air_square, cut_square, air_fourth, cut_fourth
        Mean square of the band (N^2), and the mean of its square (N^4).
    """

    air_windows: int
    air_power: tuple[float, ...]
    air_square: float
    air_fourth: float
    cut_windows: int
    cut_power: tuple[float, ...]
    cut_square: float
    cut_fourth: float

    def __post_init__(self) -> None:
        for level in LEVELS:
            for part in _PARTS:
                value = getattr(self, f"{level}_{part}")
                if not all(one >= 0.0 for one in (value if isinstance(value, tuple) else (value,))):
                    raise ValueError(f"{level}_{part} must be 0 or more, got {value!r:.60}")

    @classmethod
    def of(cls, snapshot: dict[str, Any]) -> Self:
        """Return what `MonitorNode.snapshot` holds."""
        air, cut = (snapshot[level] for level in LEVELS)
        return cls(
            air_windows=int(air["windows"]), air_power=tuple(air["power"]), air_square=air["square"],
            air_fourth=air["fourth"], cut_windows=int(cut["windows"]), cut_power=tuple(cut["power"]),
            cut_square=cut["square"], cut_fourth=cut["fourth"],
        )  # fmt: skip

    def snapshot(self) -> dict[str, Any]:
        """Return what `MonitorNode.restore` takes."""
        return {level: {part: getattr(self, f"{level}_{part}") for part in _PARTS} for level in LEVELS}


UNITS = {
    f"{level}_{part}": unit
    for level in LEVELS for part, unit in (("power", "n2"), ("square", "n2"), ("fourth", "n4"))
}  # fmt: skip
"""Of the keys in a file."""
