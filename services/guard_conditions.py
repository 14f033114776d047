"""State of the machine as the guard gets it, and what it forbids."""

import math
from dataclasses import dataclass

from services.guard_limits import GuardLimits
from services.guard_motion import Floats

LARGEST = 10.0
"""Diameter that no lathe of this kind turns (m)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Conditions:
    """State of the machine at the beginning of a block; trusted no further than that.

    Attributes
    ----------
    in_cut, homed, feed_hold : bool
        Whether the tools cut, the slides are homed, the feed is held.
    spindle_hz : float
        Speed of the spindle (Hz).
    diameter : float
        Diameter of the arc of the tool (m), the one the path is made for.
    measured : ndarray
        Measured shift (rad), x1 and y1 (m) at the last k samples before the block, shape (3, k) or (3,).
    blocked : str
        Any other reason to freeze the shift, such as a tool change; empty if none.
    failed : str
        Any other reason why no motion can be trusted, such as a control that does not answer; empty if none.
    """

    in_cut: bool
    homed: bool
    feed_hold: bool
    spindle_hz: float
    diameter: float
    measured: Floats
    blocked: str = ""
    failed: str = ""

    @property
    def unfit(self) -> str:
        """Why no motion at all can be trusted, empty if it can."""
        if not self.homed:
            return "not homed"
        if self.failed:
            return self.failed
        return "" if 0.0 < self.diameter < LARGEST else f"diameter is {self.diameter}"

    @property
    def radius(self) -> float:
        """Radius of the arc of the tool (m)."""
        return 0.5 * self.diameter if self.diameter < LARGEST else math.nan

    def interlock(self, limits: GuardLimits) -> str:
        """Why nothing may move now, empty if it may."""
        if self.feed_hold:
            return "feed hold"
        if not limits.spindle_hz_min <= self.spindle_hz <= limits.spindle_hz_max:
            return f"spindle at {self.spindle_hz:.6g} Hz"
        return self.blocked


class Spindle:
    """Whether the spindle keeps its speed: after a change of override the old shift may fit no more.

    Parameters
    ----------
    limits : GuardLimits
        What is a change, and how long it counts.
    """

    def __init__(self, limits: GuardLimits) -> None:
        self._share, self._settle = limits.spindle_change, limits.samples(limits.spindle_settle)
        self._speed: float | None = None
        self._left = 0

    def unsettled(self, speed_hz: float, samples: int) -> str:
        """Why the speed (Hz) is not to be relied on in a block of so many samples, empty if it is."""
        if self._speed is None:
            self._speed = speed_hz
        if abs(speed_hz - self._speed) <= self._share * self._speed:
            self._left = max(self._left - samples, 0)
        else:
            self._speed, self._left = speed_hz, self._settle
        return "spindle speed changes" if self._left else ""
