"""Everything that bounds the guard: one frozen set of numbers from the configuration, none of them with a default."""

import math
from dataclasses import dataclass, field, fields
from typing import Literal

MARGIN = 1e-6
"""Share by which the guard stays below each stated limit, so that no rounding of whoever checks it gets beyond."""

SHIFT_AND_SLIDE = (
    ("shift_speed", "shift_acceleration", "shift_jerk", "shift_step", "shift_travel", "shift_following", "path_shift"),
    ("slide_speed", "slide_acceleration", "slide_jerk", "slide_step", "slide_travel", "slide_following", "path_slide"),
)
"""Limits that exist once for the shift and once for each of the slides X1 and Y1, in the same order."""

OnLoss = Literal["hold", "return"]


def _quantity(unit: str) -> float:
    """Field that must be given, with its unit for `describe`."""
    return field(metadata={"unit": unit})


@dataclass(frozen=True, slots=True, kw_only=True)
class GuardLimits:
    """What may leave the guard, which commands it takes, and what it does without them.

    Attributes
    ----------
    sample_rate_hz : float
        Rate of the set points (Hz).
    axis_angle : float
        Angle between the slides X1 and Y1 (rad).
    shift, dx, dy, x1, y1 : float
        Largest magnitude of a set point: shift (rad), offset of tool 1 along X1 and Y1' (m), slides (m).
    shift_speed, slide_speed : float
        Largest speed (rad/s, m/s); of the set points, by finite difference, like all that follow.
    shift_acceleration, slide_acceleration : float
        Largest acceleration (rad/s^2, m/s^2).
    shift_jerk, slide_jerk : float
        Largest jerk (rad/s^3, m/s^3).
    interval : float
        Interval of the next limit (s).
    shift_step, slide_step : float
        Largest change over one interval (rad, m).
    shift_travel, slide_travel : float
        Largest path length in one session (rad, m).
    shift_following, slide_following : float
        Largest difference between commanded and measured position (rad, m).
    path_shift, path_slide : float
        Largest departure of a set point from the way to the target (rad) and of the slides from the arc (m).
    target, target_step : float
        Largest magnitude and largest change of a commanded target (rad).
    moves_per_minute : int
        Most changes of the target in any 60 s.
    dwell : float
        Least time between two changes of the target (s); 0 for none.
    command_age, command_lead : float
        Longest time since a command was issued, and until it applies (s).
    return_speed : float
        Largest speed of the shift while it returns to zero (rad/s).
    spindle_hz_min, spindle_hz_max : float
        Speeds of the spindle at which the turret may move (Hz).
    spindle_change : float
        Change of its speed, over the speed, that unsettles the spindle, as an override does.
    spindle_settle : float
        Time for which the shift is frozen after such a change (s).
    loss_hold, loss_return, loss_fault : float
        Time without a valid command until the shift is held, returned, given up: T1, T2, T3 (s).
    on_loss : {"hold", "return"}
        What the job wants at T2; returning to equal pitch may bring the chatter back.
    freeze_out_of_cut : bool
        Whether the shift is frozen while the tools are out of the cut.
    """

    sample_rate_hz: float = _quantity("Hz")
    axis_angle: float = _quantity("rad")
    shift: float = _quantity("rad")
    dx: float = _quantity("m")
    dy: float = _quantity("m")
    x1: float = _quantity("m")
    y1: float = _quantity("m")
    shift_speed: float = _quantity("rad/s")
    slide_speed: float = _quantity("m/s")
    shift_acceleration: float = _quantity("rad/s^2")
    slide_acceleration: float = _quantity("m/s^2")
    shift_jerk: float = _quantity("rad/s^3")
    slide_jerk: float = _quantity("m/s^3")
    interval: float = _quantity("s")
    shift_step: float = _quantity("rad")
    slide_step: float = _quantity("m")
    shift_travel: float = _quantity("rad")
    slide_travel: float = _quantity("m")
    shift_following: float = _quantity("rad")
    slide_following: float = _quantity("m")
    path_shift: float = _quantity("rad")
    path_slide: float = _quantity("m")
    target: float = _quantity("rad")
    target_step: float = _quantity("rad")
    moves_per_minute: int = field(metadata={"unit": "1/min"})
    dwell: float = _quantity("s")
    command_age: float = _quantity("s")
    command_lead: float = _quantity("s")
    return_speed: float = _quantity("rad/s")
    spindle_hz_min: float = _quantity("Hz")
    spindle_hz_max: float = _quantity("Hz")
    spindle_change: float = _quantity("Hz/Hz")
    spindle_settle: float = _quantity("s")
    loss_hold: float = _quantity("s")
    loss_return: float = _quantity("s")
    loss_fault: float = _quantity("s")
    on_loss: OnLoss = field(metadata={"unit": ""})
    freeze_out_of_cut: bool = field(metadata={"unit": ""})

    def __post_init__(self) -> None:
        """Check each number, then what must hold between them."""
        for item in fields(self):
            value = getattr(self, item.name)
            if item.metadata["unit"] and not 0 < value < math.inf and not (item.name == "dwell" and value == 0):
                raise ValueError(f"{item.name} must be positive and finite, got {value}")
        self._check("axis_angle", self.axis_angle < math.pi / 2, "below pi/2")
        self._check("shift", self.shift < math.pi / 4, "below pi/4")
        self._check("target", self.target <= 0.999 * self.shift, f"at most 0.999 of shift ({self.shift})")
        self._check("return_speed", self.return_speed <= self.shift_speed, f"at most {self.shift_speed}")
        self._check("interval", self.samples(self.interval) >= 1, "at least one sample")
        self._check("moves_per_minute", self.moves_per_minute == int(self.moves_per_minute), "a whole number")
        self._check("spindle_hz_max", self.spindle_hz_max > self.spindle_hz_min, f"above {self.spindle_hz_min}")
        self._check("loss_return", self.loss_return > self.loss_hold, f"above loss_hold ({self.loss_hold})")
        self._check("loss_fault", self.loss_fault > self.loss_return, f"above loss_return ({self.loss_return})")
        self._check("on_loss", self.on_loss in ("hold", "return"), "'hold' or 'return'")
        self._check("freeze_out_of_cut", self.freeze_out_of_cut in (True, False), "true or false")
        self._check("dwell", self.dwell < 60.0, "below 60 s")

    def _check(self, name: str, holds: bool, rule: str) -> None:
        if not holds:
            raise ValueError(f"{name} must be {rule}, got {getattr(self, name)}")

    def samples(self, duration: float) -> int:
        """Whole number of samples nearest to a duration (s)."""
        return round(duration * self.sample_rate_hz)

    def each(self, quantity: str) -> tuple[float, float, float]:
        """Limit of shift, X1 and Y1 on a quantity of `SHIFT_AND_SLIDE`, named by its last word or `path`."""
        shift, slide = ((row for row in rows if quantity in row.split("_")) for rows in SHIFT_AND_SLIDE)
        of_slide = getattr(self, next(slide))
        return getattr(self, next(shift)), of_slide, of_slide

    def describe(self) -> tuple[str, ...]:
        """One line for each limit: name, value, unit; angles also in degrees."""
        lines: list[str] = []
        for item in fields(self):
            value, unit = getattr(self, item.name), item.metadata["unit"]
            degrees = f" ({math.degrees(value):.6g} {unit.replace('rad', 'deg')})" if unit.startswith("rad") else ""
            lines.append(f"{item.name} = {value} {unit}".rstrip() + degrees)
        return tuple(lines)
