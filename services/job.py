"""What a job says beside machine and cut: which pass it is, in which passes nobody may move turret 1, and room."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from pitch import Box, clearance

PassKind = Literal["rough", "finish", "thread", "groove"]
Envelope = tuple[float, float, float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Job:
    """What a job allows; a case without the table acts in every pass.

    Attributes
    ----------
    pass_kind
        The pass that is cut, None when nobody says so.
    passes_without_action
        Passes in which the guard freezes the shift.
    advise_only
        Whether the controller only says what it would command.
    """

    pass_kind: PassKind | None = None
    passes_without_action: tuple[PassKind, ...] | None = None
    advise_only: bool | None = None

    def __post_init__(self) -> None:
        if self.pass_kind is not None and self.passes_without_action is None:
            raise ValueError("passes_without_action must be given where the pass is, got None")
        named = self.passes_without_action or ()
        if len(set(named)) != len(named):
            raise ValueError(f"passes_without_action must be words that differ, got {list(named)}")

    def forbids(self, pass_kind: str | None) -> str:
        """Return why turret 1 must not move in a pass, empty if it may."""
        return f"{pass_kind} pass: no action" if pass_kind in (self.passes_without_action or ()) else ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Room:
    """What must not come near to each other (SI): boxes along X1 and Y1' about the axis of the spindle.

    Attributes
    ----------
    turret1_envelope, turret2_envelope
        Lowest and highest X1, lowest and highest Y1' (m) of all that moves with a turret, at equal pitch.
    least_clearance
        Distance that must remain (m).
    """

    turret1_envelope: Envelope
    turret2_envelope: Envelope
    least_clearance: float

    def __post_init__(self) -> None:
        for name in ("turret1_envelope", "turret2_envelope"):
            x_low, x_high, y_low, y_high = envelope = getattr(self, name)
            if not (x_low < x_high and y_low < y_high):
                raise ValueError(f"{name} must be lowest and highest X1, lowest and highest Y1', got {envelope}")
        if not self.least_clearance > 0.0:
            raise ValueError(f"least_clearance must be above 0, got {self.least_clearance}")

    def clearance(self, shift: float, diameter: float) -> float:
        """Return the least distance of the turrets on the way to a shift (m).

        Parameters
        ----------
        shift
            Of turret 1 (rad).
        diameter
            At the cutting point (m).
        """
        return clearance(shift, diameter, Box(*self.turret1_envelope), Box(*self.turret2_envelope))
