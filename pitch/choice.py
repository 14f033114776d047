"""Which shifts are worth trying against one chatter frequency, in order of preference, and which of them fit."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from pitch._checks import finite, positive, whole, within
from pitch.geometry import AXIS_ANGLE, slide_set_points
from pitch.optimum import pitch_difference_for_phase

MAX_SHIFT = math.radians(20)  # beyond, neither the one-axis posture nor the rake of the tool means anything


class Candidate(NamedTuple):
    """A shift to try (rad), with the phase (rad) it stands for and the whole turns in that."""

    shift: float
    order: int
    phase: float


@dataclass(frozen=True, slots=True, kw_only=True)
class PlannerConfig:
    """How the planner aims and how far, how often and how long it may act.

    Attributes
    ----------
    sample_rate_hz : float
        Rate of the sample index (Hz).
    target_phase : float
        Phase aimed at first (rad), in (0, 2 pi); pi is the optimum of eq. (6-10).
    fallback_phases : tuple of float
        Phases (rad) tried next at the same frequency. Below pi comes first: 0.7 to 1.1 pi was stable in Yamada, PhD
        thesis, Keio University, 2017, section 6.5.2.
    order, max_order : int
        Whole turns of phase: preferred, and the largest to fall back to.
    min_shift, max_shift : float
        Limits of the shift (rad); a negative minimum allows the mirrored shift where the other does not fit.
    x1_travel, y1_travel : tuple of float
        Travel left on each slide from equal pitch, lowest and highest (m).
    axis_angle : float
        Angle between the slides (rad).
    dwell : float
        Least time from one move to the next (s), at least 1.0 as on the published machine.
    settle_time : float
        Time after the end of a move before its effect is judged (s).
    persist_time : float
        Time for which chatter must last without a break before another move (s).
    arrive_time : float
        Time after which a turret that is not where it was sent is reported (s).
    arrival_tolerance : float
        How near to the target counts as there (rad).
    calm_time : float
        Time without chatter after which tries are forgotten (s).
    reaim_threshold : float
        Least change of phase, at the frequency of the moment, that is worth a move (rad).
    max_moves : int
        Moves against one chatter before giving up.
    """

    sample_rate_hz: float
    target_phase: float = math.pi
    fallback_phases: tuple[float, ...] = (0.85 * math.pi, 1.1 * math.pi)
    order: int = 0
    max_order: int = 0
    min_shift: float = 0.0
    max_shift: float = math.radians(6.0)
    x1_travel: tuple[float, float] = (-2e-3, 2e-3)
    y1_travel: tuple[float, float] = (-2e-3, 2e-3)
    axis_angle: float = AXIS_ANGLE
    dwell: float = 1.0
    settle_time: float = 0.3
    persist_time: float = 0.1
    arrive_time: float = 2.0
    arrival_tolerance: float = math.radians(0.05)
    calm_time: float = 5.0
    reaim_threshold: float = 0.05 * math.pi
    max_moves: int = 4

    def __post_init__(self) -> None:
        """Check the ranges."""
        for name in ("sample_rate_hz", "settle_time", "persist_time", "calm_time"):
            positive(name, getattr(self, name))
        within("arrival_tolerance", positive("arrival_tolerance", self.arrival_tolerance), 0.0, MAX_SHIFT)
        within("reaim_threshold", positive("reaim_threshold", self.reaim_threshold), 0.0, math.pi)
        for phase in (self.target_phase, *self.fallback_phases):
            if not 0.0 < finite("target_phase and fallback_phases", phase) < 2 * math.pi:
                raise ValueError(f"target_phase and fallback_phases must be in (0, 2 pi) rad, got {phase}")
        within("dwell", self.dwell, 1.0, 3600.0)
        within("arrive_time", self.arrive_time, self.dwell, 3600.0)
        whole("max_order", self.max_order, whole("order", self.order, 0))
        whole("max_moves", self.max_moves, 1)
        within("min_shift", self.min_shift, -MAX_SHIFT, 0.0)
        within("max_shift", positive("max_shift", self.max_shift), 0.0, MAX_SHIFT)
        for name in ("x1_travel", "y1_travel"):
            low, high = getattr(self, name)
            if not finite(name, low) <= 0.0 <= finite(name, high):
                raise ValueError(f"{name} must be (low <= 0, high >= 0), got ({low}, {high})")
        slide_set_points(0.0, 1.0, self.axis_angle)


def candidates(config: PlannerConfig, frequency_hz: float, spindle_hz: float) -> list[Candidate]:
    """Shifts that should silence a frequency, the preferred first, whether or not they fit.

    Parameters
    ----------
    config : PlannerConfig
        Phases and orders.
    frequency_hz, spindle_hz : float
        Chatter frequency and spindle speed (Hz).

    Returns
    -------
    list of Candidate
        The preferred order with all phases, then the other orders with the first phase, the nearest order first.
    """
    others = sorted(set(range(config.max_order + 1)) - {config.order}, key=lambda m: (abs(m - config.order), m))
    aims = [(config.order, phase) for phase in (config.target_phase, *config.fallback_phases)]
    aims += [(order, config.target_phase) for order in others]
    phases = [(order, 2 * math.pi * order + phase) for order, phase in aims]
    return [Candidate(pitch_difference_for_phase(frequency_hz, spindle_hz, p) / 2, m, p) for m, p in phases]


def fitting(config: PlannerConfig, wanted: Sequence[Candidate], diameter: float) -> list[Candidate]:
    """Those of the wanted shifts that turret 1 can reach, mirrored where only that fits.

    Parameters
    ----------
    config : PlannerConfig
        Limits of shift and slides.
    wanted : sequence of Candidate
        In order of preference.
    diameter : float
        Diameter at the cutting point (m).

    Returns
    -------
    list of Candidate
        In the same order.
    """
    found = []
    for one in wanted:
        mirrored = Candidate(-one.shift, one.order, -one.phase)
        found += [way for way in (one, mirrored) if reachable(config, way.shift, diameter)][:1]
    return found


def reachable(config: PlannerConfig, shift: float, diameter: float) -> bool:
    """Whether turret 1 stays within its limits on the whole way to a shift.

    Parameters
    ----------
    config : PlannerConfig
        Limits of shift and slides.
    shift : float
        Shift (rad).
    diameter : float
        Diameter at the cutting point (m).

    Returns
    -------
    bool
        True if shift and both slides stay within their limits.
    """
    if not config.min_shift <= shift <= config.max_shift:
        return False
    way = [slide_set_points(shift * part, diameter, config.axis_angle) for part in (0.25, 0.5, 0.75, 1.0)]
    (x_low, x_high), (y_low, y_high) = config.x1_travel, config.y1_travel
    return all(x_low <= x1 <= x_high and y_low <= y1 <= y_high for x1, y1 in way)
