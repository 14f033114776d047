"""The messages between the nodes, and the one table of topics.

Every quantity carries its unit in its name; angles of the spindle are in rad, shifts in degrees. Sample indices
count the servo samples of the machine since its start (`t = sample / sample_rate_hz`).
"""

from __future__ import annotations

from typing import Literal

import msgspec
import numpy as np
from numpy.typing import NDArray

FORMAT_VERSION, FORMAT_MINOR = 1, 1
"""Of all messages. A newer minor one only adds fields, which older programs ignore; another major one is refused."""
BLOCK_S = 0.010
"""Length of a block (s): the grid of all messages, anchored at sample 0."""

ADVICE, ADVICE_OVER, MODE = "advice", "advice_over", "controller_mode"
"""Kinds of event of a controller that only advises."""

Floats = NDArray[np.float64]
GuardState = Literal["OFF", "ARMED", "ACTIVE", "HOLDING", "RETURNING", "FAULT"]


class Message(msgspec.Struct, frozen=True, kw_only=True):
    """What every message carries: who sent it, in which run, which message caused it, and the version of its format."""

    run: str
    source: str
    sequence: int
    cause: int = -1
    version: int = FORMAT_VERSION
    minor: int = FORMAT_MINOR


class Tick(msgspec.Struct, frozen=True):
    """The runner asks the machine for block number `block`; never on the wire."""

    block: int


class SampleBlock(Message, frozen=True, kw_only=True):
    """Servo samples of turret 1 (X1 and Y1), shape (n,) each, and what the control knows beside them."""

    first_sample: int
    sample_rate_hz: float
    x1_thrust_n: Floats
    x1_motor_position_m: Floats
    x1_stage_position_m: Floats
    y1_thrust_n: Floats
    y1_motor_position_m: Floats
    y1_stage_position_m: Floats
    dx1_um: Floats
    dy1p_um: Floats
    shift_requested_deg: float
    shift_applied_deg: float
    moving: bool
    in_cut: bool
    spindle_speed_rpm: float
    diameter_mm: float
    guard_state: GuardState
    session: str


class MachineState(Message, frozen=True, kw_only=True):
    """What the machine says of itself, once per block (the values at the end of the block)."""

    sample: int
    spindle_speed_rpm: float
    spindle_angle_rad: float
    z_mm: float
    feed_mm_per_rev: float
    diameter_mm: float
    override_percent: float
    in_cut: bool
    homed: bool
    feed_hold: bool
    tool: int
    guard_state: GuardState
    session: str
    shift_requested_deg: float
    shift_target_deg: float
    shift_applied_deg: float
    slide_x1_um: float
    slide_y1_um: float
    commands_accepted: int
    commands_rejected: int
    commands_late: int
    reason: str


class ForceBlock(Message, frozen=True, kw_only=True):
    """Estimated cutting force on tool 1, shape (n,) each: X1 pushes the tool out, Y1' along the surface motion."""

    first_sample: int
    sample_rate_hz: float
    force_x1_n: Floats
    force_y1p_n: Floats
    latency_s: float


class ReportedLine(msgspec.Struct, frozen=True, kw_only=True):
    """One line of the spectrum of the force; `kind` is regenerative, forced, background or encoder, and how surely."""

    frequency_hz: float
    amplitude_n: float
    growth_1_per_s: float
    kind: str
    confidence: float


class ChatterReport(Message, frozen=True, kw_only=True):
    """The monitor's verdict on one block.

    `indicator` and `limit` are root mean squares of the band, `line_n` and `line_limit_n` amplitudes of its strongest
    line. `lines` are those near their limits, the strongest first. `cutting` is what the machine says or, if it says
    nothing, what the signal shows. `comb_hz` is the fundamental of harmonics that contradict the spindle speed.
    `false_alarms_per_h` is how often stationary noise passes the line limit at the setting in force. Fields with a
    default came with format version 1.1: a report of version 1.0 is read without them.
    """

    first_sample: int
    samples: int
    guard_state: GuardState
    session: str
    state: str
    indicator: float
    limit: float
    limit_source: str
    frequency_hz: float | None
    amplitude_n: float
    kind: str | None
    confidence: float
    gap_samples: int
    moving: bool
    in_cut: bool
    spindle_speed_rpm: float
    diameter_mm: float
    line_n: float | None = None
    line_limit_n: float | None = None
    lines: tuple[ReportedLine, ...] = ()
    cutting: bool | None = None
    comb_hz: float | None = None
    notes: tuple[str, ...] = ()
    false_alarms_per_h: float | None = None
    shift_requested_deg: float
    shift_applied_deg: float


class TurretCommand(Message, frozen=True, kw_only=True):
    """An absolute target for the shift of turret 1; repeating or losing one does no harm."""

    session: str
    shift_deg: float
    order: int
    action: Literal["hold", "move", "give_up"]
    issued_sample: int
    apply_at_sample: int
    expires_at_sample: int
    reason: str


class OperatorRequest(Message, frozen=True, kw_only=True):
    """What the operator asks of the guard; the nonce makes each request count once."""

    request: Literal["arm", "dry_run", "disarm", "reset", "stop"]
    nonce: str


class Truth(Message, frozen=True, kw_only=True):
    """What no sensor gives, shape (n,) each; recorded and reported, never read by monitor or controller.

    `left1_um` and `left2_um` are the depths that the tools left on the surface, `phase1_rad` and `phase2_rad` the
    material phase under them, `in_cut` is 1 in the cut and 0 in air.
    """

    first_sample: int
    sample_rate_hz: float
    vibration_um: Floats
    bar_displacement_um: Floats
    tool_radial_um: Floats
    force_x1_n: Floats
    force_y1p_n: Floats
    z_mm: Floats
    left1_um: Floats
    left2_um: Floats
    phase1_rad: Floats
    phase2_rad: Floats
    in_cut: Floats


class Event(Message, frozen=True, kw_only=True):
    """A change worth a line in the log: a state, a rejection, a fault.

    `shift_deg` is the target that an event of kind `advice` is about.
    """

    sample: int
    kind: str
    text: str
    shift_deg: float | None = None


TOPICS: dict[str, type[Message]] = {
    "servo/turret1": SampleBlock,
    "machine/state": MachineState,
    "force": ForceBlock,
    "chatter": ChatterReport,
    "pitch/command": TurretCommand,
    "operator/request": OperatorRequest,
    "sim/truth": Truth,
    "event": Event,
}
"""Topic below `antiphase/<machine>/` and the one type that travels there."""
