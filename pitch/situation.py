"""What the planner is told once per block, and what it answers."""

from dataclasses import dataclass
from enum import StrEnum
from typing import Literal

REGENERATIVE = "regenerative"
FORCED = "forced"


class Cause(StrEnum):
    """Why the planner decided as it did, for programs; `Decision.reason` says it in words."""

    QUIET = "quiet"
    LATE = "late"
    BAD_DATA = "bad_data"
    NOT_ARMED = "not_armed"
    OUT_OF_CUT = "out_of_cut"
    NO_SPINDLE_SPEED = "no_spindle_speed"
    FORCED = "forced"
    KIND_UNKNOWN = "kind_unknown"
    NO_FREQUENCY = "no_frequency"
    MOVING = "moving"
    WAITING = "waiting"
    CHATTER = "chatter"
    NO_PITCH = "no_pitch"
    EXHAUSTED = "exhausted"
    NOT_FOLLOWED = "not_followed"


@dataclass(frozen=True, slots=True, kw_only=True)
class Situation:
    """One block as the planner sees it. Nothing is checked here: bad numbers lead to "hold" with a reason.

    Attributes
    ----------
    sample : int
        Index of the block's last sample; must grow.
    chatter : bool
        Whether the monitor is in the state "chatter".
    frequency_hz : float or None
        Dominant frequency (Hz).
    kind : str or None
        "regenerative", "forced", or None while unknown.
    spindle_hz : float or None
        Spindle speed (Hz).
    diameter : float or None
        Diameter at the tool (m).
    shift : float or None
        Realised shift of turret 1 (rad).
    requested : float or None
        Target that the machine has accepted last (rad); a planner that comes in mid-run takes it over.
    in_cut : bool
        Whether the tools cut.
    valid : bool
        Whether the block can be trusted (no gap, sensors alive, feed not held).
    moving : bool
        Whether turret 1 is on its way to a target.
    armed : bool
        Whether commands are carried out; if not, the target follows the realised shift.
    loudness : float or None
        Indicator of chatter over its limit; loud chatter lies below the line from which it grew.
    """

    sample: int
    chatter: bool
    frequency_hz: float | None
    kind: str | None
    spindle_hz: float | None
    diameter: float | None
    shift: float | None
    in_cut: bool
    valid: bool = True
    moving: bool = False
    armed: bool = True
    requested: float | None = None
    loudness: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Decision:
    """What to command now.

    Attributes
    ----------
    target_shift : float
        Absolute shift of turret 1 (rad), in every decision finite and between the limits of the shift.
    order : int
        Whole turns of phase in the target.
    action : str
        "move" in the block in which the target changes, "give_up" in the one that gives up, else "hold".
    cause : Cause
        Why, for programs.
    reason : str
        Why, in words.
    phase : float or None
        Phase aimed at (rad), None before the first move.
    moves : int
        Moves made against the present chatter.
    given_up : bool
        Whether the planner has given up on the present chatter.
    frequency_hz, spindle_hz : float or None
        What the decision rests on (Hz).
    advised_spindle_hz : float or None
        Spindle speed (Hz) at which a pitch within the limits should help, where one is known.
    feed_hold : bool
        Whether the feed should be held: it chatters, and no move of turret 1 is left.
    """

    target_shift: float
    order: int
    action: Literal["hold", "move", "give_up"]
    cause: Cause
    reason: str
    phase: float | None
    moves: int
    given_up: bool
    frequency_hz: float | None
    spindle_hz: float | None
    advised_spindle_hz: float | None = None
    feed_hold: bool = False
