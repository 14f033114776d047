"""The cut: condition, force law about it, noise."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from turning_sim._check import require
from turning_sim.chip import Chip, ForceLaw, steady_chip


@dataclass(frozen=True, slots=True, kw_only=True)
class Cutting:
    """Condition of the parallel cut and the force law linearised about it.

    Attributes
    ----------
    spindle_hz : float
        Nominal spindle speed (Hz).
    feed_per_rev : float
        Feed per revolution; each tool advances half of it past the other's cut (m).
    depth_of_cut : float
        Depth of each tool (m).
    cutting_stiffness : float
        Radial dynamic stiffness of one tool (N/m).
    tangential_ratio : float
        Tangential over radial dynamic stiffness.
    overlap : float
        Weight of the wave left by the other tool.
    process_damping : float
        Of one tool (N s/m).
    nose_radius : float
        (m)
    approach_angle : float
        (rad)
    flank_clearance : float
        Clearance angle of the worn flank (rad).
    flank_factor : float
        Added damping slope over `process_damping` once the flank touches.
    rake_gain : float
        Relative rise of the force of tool 1 per radian of shift.
    setting_difference : float
        How much deeper tool 2 is set than tool 1 (m).
    force_noise : float
        One-sided density of the force noise of each tool, only in cut (N/sqrt(Hz)).
    force_law : ForceLaw
        For the steady forces.
    """

    spindle_hz: float
    feed_per_rev: float
    depth_of_cut: float
    cutting_stiffness: float
    tangential_ratio: float
    overlap: float
    process_damping: float
    nose_radius: float
    approach_angle: float = math.radians(95.0)
    flank_clearance: float = math.radians(3.0)
    flank_factor: float = 20.0
    rake_gain: float = 0.0
    setting_difference: float = 0.0
    force_noise: float = 0.0
    force_law: ForceLaw = field(default_factory=ForceLaw)

    def __post_init__(self) -> None:
        for name in ("spindle_hz", "feed_per_rev", "depth_of_cut", "cutting_stiffness", "nose_radius"):
            require(getattr(self, name) > 0.0, name, "positive", getattr(self, name))
        for name in ("tangential_ratio", "process_damping", "flank_factor", "force_noise", "rake_gain"):
            require(getattr(self, name) >= 0.0, name, "at least 0", getattr(self, name))
        require(-1.0 <= self.overlap <= 1.0, "overlap", "in [-1, 1]", self.overlap)
        require(math.isfinite(self.setting_difference), "setting_difference", "finite", self.setting_difference)
        require(
            abs(self.setting_difference) < self.depth_of_cut,
            "setting_difference",
            "smaller than the depth of cut",
            self.setting_difference,
        )
        limit = self.nose_radius
        require(self.feed_per_rev < limit, "feed_per_rev", "below the nose radius", self.feed_per_rev)
        require(0.0 < self.flank_clearance < math.pi / 4.0, "flank_clearance", "in (0, 45 deg)", self.flank_clearance)

    @property
    def chip(self) -> Chip:
        """Chip of the steady cut."""
        return steady_chip(self.depth_of_cut, self.feed_per_rev / 2.0, self.nose_radius, self.approach_angle)

    @property
    def steady_forces(self) -> tuple[float, float]:
        """Radial and tangential force of one tool in the steady cut (N)."""
        return self.force_law.forces(self.chip)
