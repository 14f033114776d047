"""Dry and viscous friction of screw, bearings and guide."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from turning_sim._check import require


@dataclass(frozen=True, slots=True, kw_only=True)
class Friction:
    """Friction of one side of a drive, felt at the stage: Coulomb, Stribeck, or with bristles (LuGre).

    Without bristles the side sticks rigidly until the static friction is passed. With them it gives way by
    micrometres before it slides (presliding), as sliding guides and preloaded screws do.

    Attributes
    ----------
    coulomb : float
        Of fast sliding (N).
    static : float or None
        Of breakaway (N), at least the Coulomb friction; None for equal to it.
    stribeck_velocity : float
        Over which one passes into the other (m/s).
    stribeck_exponent : float
        Of that passage: 2 Gaussian, 1 exponential.
    viscous : float
        Rise with velocity (N s/m).
    bristle_stiffness : float or None
        Presliding stiffness (N/m); None for none, the side then sticks rigidly.
    bristle_damping : float
        Of the bristles while they bend (N s/m).
    """

    coulomb: float
    static: float | None = None
    stribeck_velocity: float = 1e-3
    stribeck_exponent: float = 2.0
    viscous: float = 0.0
    bristle_stiffness: float | None = None
    bristle_damping: float = 0.0

    def __post_init__(self) -> None:
        for name in ("coulomb", "viscous", "bristle_damping"):
            require(0.0 <= getattr(self, name) < math.inf, name, "finite and at least 0", getattr(self, name))
        for name in ("stribeck_velocity", "stribeck_exponent"):
            require(0.0 < getattr(self, name) < math.inf, name, "finite and positive", getattr(self, name))
        require(self.coulomb <= self.breakaway < math.inf, "static", "finite and at least coulomb", self.static)
        stiffness = self.bristle_stiffness
        require(stiffness is None or 0.0 < stiffness < math.inf, "bristle_stiffness", "finite and positive", stiffness)
        known = stiffness is not None or self.bristle_damping == 0.0
        require(known, "bristle_damping", "0 without bristle_stiffness", self.bristle_damping)

    @property
    def breakaway(self) -> float:
        """Friction that must be passed from rest (N)."""
        return self.coulomb if self.static is None else self.static

    def steady(self, velocity: float | np.ndarray) -> np.ndarray:
        """Return the friction of steady sliding, opposing the motion when positive (N).

        Servo-current thesis (Chalmers, 2020) eq. (3.7), with the signs that it lacks: + (F_s - F_c), and -|v/v_s|.

        Parameters
        ----------
        velocity : float or ndarray
            (m/s)
        """
        v = np.asarray(velocity, dtype=np.float64)
        fall = np.exp(-(np.abs(v / self.stribeck_velocity) ** self.stribeck_exponent))
        return (self.coulomb + (self.breakaway - self.coulomb) * fall) * np.sign(v) + self.viscous * v
