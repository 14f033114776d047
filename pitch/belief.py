"""What the controller believes of bar and cut, and how far it may be wrong."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pitch._checks import finite, positive, within

Floats = NDArray[np.float64]

FREQUENCIES, STIFFNESSES, DAMPINGS, OVERLAPS = 5, 9, 3, 2


@dataclass(frozen=True, slots=True, kw_only=True)
class ProcessBelief:
    """One bending mode and its cut, as a hammer test and a trial cut would tell them.

    Attributes
    ----------
    modal_mass : float
        At the tools where they enter (kg).
    natural_frequency_hz : float
        Of the bar alone, undamped (Hz).
    damping_ratio : float
        Of the bar, in (0, 1).
    cutting_stiffness : float
        Radial, of each tool (N/m).
    overlap : float
        Share of the other tool's wave that a tool meets again, in [0, 1].
    process_damping : float
        Of the flank of one tool (N s/m).
    frequency_error, stiffness_error, damping_error, overlap_error : float
        Largest relative error to either side of natural frequency, cutting stiffness over mass, all damping, overlap.
    mass_ratio : float
        Modal mass at the tools at the end of the pass over that at the entry, at least 1.
    """

    modal_mass: float
    natural_frequency_hz: float
    damping_ratio: float
    cutting_stiffness: float
    overlap: float
    process_damping: float
    frequency_error: float = 0.03
    stiffness_error: float = 0.3
    damping_error: float = 0.3
    overlap_error: float = 0.1
    mass_ratio: float = 1.3

    def __post_init__(self) -> None:
        """Check the ranges."""
        for name in ("modal_mass", "natural_frequency_hz", "cutting_stiffness"):
            positive(name, getattr(self, name))
        if not 0.0 < finite("damping_ratio", self.damping_ratio) < 1.0:
            raise ValueError(f"damping_ratio must be in (0, 1), got {self.damping_ratio}")
        within("overlap", self.overlap, 0.0, 1.0)
        if finite("process_damping", self.process_damping) < 0.0:
            raise ValueError(f"process_damping must be >= 0, got {self.process_damping}")
        for name in ("frequency_error", "stiffness_error", "damping_error", "overlap_error"):
            within(name, getattr(self, name), 0.0, 0.9)
        within("mass_ratio", self.mass_ratio, 1.0, 100.0)

    def nominal(self) -> Floats:
        """Return m, C, k, mu, K as believed, shape (5,)."""
        omega, m = 2.0 * math.pi * self.natural_frequency_hz, self.modal_mass
        damping = 2.0 * self.damping_ratio * m * omega + 2.0 * self.process_damping
        return np.array([m, damping, m * omega**2, self.overlap, self.cutting_stiffness])

    def hypotheses(self) -> Floats:
        """Return processes that may be the true one: m, C, k, mu, K in each row, shape (n, 5).

        The modal mass is kept and the cutting stiffness takes its rise, which is the same but for the damping.
        """
        low = (1.0 - self.stiffness_error) / self.mass_ratio
        frequency = self.natural_frequency_hz * (1.0 + self.frequency_error * np.linspace(-1.0, 1.0, FREQUENCIES))
        stiffness = self.cutting_stiffness * np.geomspace(low, 1.0 + self.stiffness_error, STIFFNESSES)
        damping = 1.0 + self.damping_error * np.linspace(-1.0, 1.0, DAMPINGS)
        overlap = np.minimum(1.0, self.overlap * (1.0 + self.overlap_error * np.linspace(-1.0, 1.0, OVERLAPS)))
        f, cut, c, mu = (axis.ravel() for axis in np.meshgrid(frequency, stiffness, damping, overlap, indexing="ij"))
        omega, m = 2.0 * math.pi * f, self.modal_mass
        flanks = 2.0 * self.process_damping * np.minimum(1.0, cut / self.cutting_stiffness)
        return np.column_stack(
            [np.full_like(f, m), c * (2.0 * self.damping_ratio * m * omega + flanks), m * omega**2, mu, cut]
        )
