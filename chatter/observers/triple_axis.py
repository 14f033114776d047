"""A drive of three inertias, encoders on motor, nut and stage: what is believed of it, and its modes.

Yamada, PhD thesis, Keio University, 2017, section 2.6, with M_r for M_m in eq. (2-57) and C_t for C_c in eq. (2-51);
the modes come from the symmetric generalised eigenproblem of stiffness and mass.
"""

from dataclasses import dataclass, fields
from math import inf, isfinite, pi

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import eigh

from chatter.observers.nominal import Sensors

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class TripleAxis:
    """One axis whose motor turns against its nut and whose nut moves against its stage.

    Parameters
    ----------
    lead : float
        Lead of the screw (m per revolution).
    rotor_inertia, rotor_damping : float
        Of the motor (kg m^2), (N m s).
    nut_mass, nut_damping : float
        Nut with the inertia of the screw, as felt at the stage (kg), (N s/m).
    stage_mass, stage_damping : float
        (kg), (N s/m)
    torsion_stiffness, torsion_damping : float
        K_omega and C_omega between motor and nut, as felt at the stage (N/m), (N s/m).
    screw_stiffness, screw_damping : float
        K_r and C_k between nut and stage (N/m), (N s/m).
    motor_resolution, nut_resolution, stage_resolution : float
        One count of each encoder (m); 0 if the signal is not quantised.
    motor_delay, nut_delay, stage_delay, thrust_delay : float
        Ages of the positions and dead time of the thrust (s).
    omega_current : float
        Bandwidth of the current loop (rad/s), may be infinite.
    """

    lead: float
    rotor_inertia: float
    rotor_damping: float
    nut_mass: float
    nut_damping: float
    stage_mass: float
    stage_damping: float
    torsion_stiffness: float
    torsion_damping: float
    screw_stiffness: float
    screw_damping: float
    motor_resolution: float = 0.0
    nut_resolution: float = 0.0
    stage_resolution: float = 0.0
    motor_delay: float = 0.0
    nut_delay: float = 0.0
    stage_delay: float = 0.0
    thrust_delay: float = 0.0
    omega_current: float = inf

    def __post_init__(self) -> None:
        """Check every value once."""
        for field in fields(self):
            value = getattr(self, field.name)
            positive = field.name.endswith(("lead", "inertia", "mass", "stiffness", "omega_current"))
            known = isfinite(value) or (field.name == "omega_current" and value == inf)
            if not known or value < 0.0 or (positive and value == 0.0):
                raise ValueError(f"{field.name} must be {'positive' if positive else 'at least 0'}, got {value}")

    @property
    def rotor_mass(self) -> float:
        """Inertia of the motor as felt at the stage (kg)."""
        return self.rotor_inertia * (2.0 * pi / self.lead) ** 2

    @property
    def rotor_viscosity(self) -> float:
        """Damping of the motor as felt at the stage (N s/m)."""
        return self.rotor_damping * (2.0 * pi / self.lead) ** 2

    @property
    def sensors(self) -> Sensors:
        """Ages and counts of its signals."""
        return Sensors(
            motor_delays=(self.motor_delay, self.nut_delay),
            stage_delays=(self.stage_delay,),
            thrust_delays=(self.thrust_delay,),
            resolutions=(self.motor_resolution, self.nut_resolution, self.stage_resolution),
            omega_currents=(self.omega_current,),
        )

    def force_from_loads(self) -> Floats:
        """Return the matrix from load to force, shape (1, 1)."""
        return np.ones((1, 1))

    def matrices(self) -> tuple[Floats, Floats, Floats]:
        """Return mass, damping and stiffness over motor, nut and stage; eq. (2-51), each shape (3, 3)."""
        mass = np.diag([self.rotor_mass, self.nut_mass, self.stage_mass])
        spring = np.array([[1.0, -1.0, 0.0], [-1.0, 1.0, 0.0], [0.0, 0.0, 0.0]])
        stiffness = self.torsion_stiffness * spring + self.screw_stiffness * spring[::-1, ::-1]
        damping = self.torsion_damping * spring + self.screw_damping * spring[::-1, ::-1]
        return mass, damping + np.diag([self.rotor_viscosity, self.nut_damping, self.stage_damping]), stiffness

    def modes(self) -> tuple[Floats, Floats]:
        """Return natural frequencies (Hz), rigid body first, and modal matrix with the motor at 1, shape (3, 3)."""
        mass, _, stiffness = self.matrices()
        square, shapes = eigh(stiffness, mass)
        return np.sqrt(np.maximum(square, 0.0)) / (2.0 * pi), np.asarray(shapes / shapes[0], dtype=np.float64)

    def sensed(self, frequency_hz: ArrayLike) -> NDArray[np.complex128]:
        """Return what motor, nut and stage encoder show per unit force when nothing drives the axis, shape (k, 3).

        Parameters
        ----------
        frequency_hz : array_like, shape (k,)
            Frequencies (Hz), above 0.
        """
        s = 2j * np.pi * np.atleast_1d(np.asarray(frequency_hz, dtype=np.float64))[:, None, None]
        mass, damping, stiffness = self.matrices()
        push = np.broadcast_to(np.array([0.0, 0.0, -1.0]), (len(s), 3))[..., None]
        moved = np.linalg.solve(mass * s**2 + damping * s + stiffness, push)[..., 0]
        ages = np.array([self.motor_delay, self.nut_delay, self.stage_delay])
        return np.asarray(moved * np.exp(-s[:, 0] * ages), dtype=np.complex128)
