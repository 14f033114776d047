"""One ball-screw axis as it is, with all that an observer of its cutting force has to cope with."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace
from typing import Any, Self

import numpy as np
from scipy.linalg import expm

from turning_sim._check import require
from turning_sim.feed_drive import BallScrewStage, FeedDrive
from turning_sim.friction import Friction

_SCREW = ("screw_damping", "coupling_damping", "screw_resolution", "screw_delay")
STATES = 7
"""Position and velocity of motor, screw and stage, then thrust; without a coupling those of the screw stay put."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Wave:
    """A disturbance that repeats with position.

    Attributes
    ----------
    amplitude : float
        (N) of a force, (m) of an encoder error.
    wavelength : float
        (m)
    phase : float
        At position 0 (rad).
    """

    amplitude: float
    wavelength: float
    phase: float = 0.0

    def __post_init__(self) -> None:
        require(math.isfinite(self.amplitude), "amplitude", "finite", self.amplitude)
        require(0.0 < self.wavelength < math.inf, "wavelength", "finite and positive", self.wavelength)
        require(math.isfinite(self.phase), "phase", "finite", self.phase)


@dataclass(frozen=True, slots=True, kw_only=True)
class AxisDrive(BallScrewStage):
    """One axis as it is: two or three inertias, friction, ripple, and encoders with their errors.

    Besides what every `BallScrewStage` has; the current loop may be ideal here (`current_bandwidth` infinite).

    Attributes
    ----------
    screw_inertia : float or None
        Screw and nut behind a coupling that twists (kg m2), then no longer in `motor_inertia`; None for two inertias.
    screw_damping : float or None
        Viscous, of the screw (N m s/rad).
    coupling_stiffness, coupling_damping : float or None
        Between motor and screw, felt at the stage (N/m), (N s/m).
    screw_resolution, screw_delay : float or None
        Step at the stage (m), 0 for none, and dead time (s) of an encoder on the far end of the screw.
    motor_friction, stage_friction : Friction or None
        Of screw and bearings (rolling guide), and of the guide (sliding guide).
    ripple : tuple of Wave
        Forces on the motor that repeat with its position, opposing its motion when positive (N).
    load : float
        Constant force on the stage, against its motion along + when positive (N): gravity, seals.
    motor_error, stage_error : tuple of Wave
        Interpolation errors of the encoders (m).
    motor_noise, stage_noise : float
        White noise of the encoders (m rms).
    stage_encoder : bool
        Whether there is a linear scale; without one the loop closes on the motor.
    """

    screw_inertia: float | None = None
    screw_damping: float | None = None
    coupling_stiffness: float | None = None
    coupling_damping: float | None = None
    screw_resolution: float | None = None
    screw_delay: float | None = None
    motor_friction: Friction | None = None
    stage_friction: Friction | None = None
    ripple: tuple[Wave, ...] = ()
    load: float = 0.0
    motor_error: tuple[Wave, ...] = ()
    stage_error: tuple[Wave, ...] = ()
    motor_noise: float = 0.0
    stage_noise: float = 0.0
    stage_encoder: bool = True

    def __post_init__(self) -> None:
        for field in fields(BallScrewStage):
            number = getattr(self, field.name)
            ideal = field.name == "current_bandwidth" and number == math.inf
            require(math.isfinite(number) or ideal, field.name, "finite", number)
        BallScrewStage.__post_init__(self)
        for name in ("thrust_delay", "motor_delay", "stage_delay"):
            require(0.0 <= getattr(self, name) <= 0.05, name, "in [0, 50 ms]", getattr(self, name))
        for name in ("motor_noise", "stage_noise"):
            require(0.0 <= getattr(self, name) < math.inf, name, "finite and at least 0", getattr(self, name))
        require(math.isfinite(self.load), "load", "finite", self.load)
        self._check_screw()

    def _check_screw(self) -> None:
        inertia = self.screw_inertia
        if inertia is None:
            for name in ("coupling_stiffness", *_SCREW):
                require(getattr(self, name) is None, name, "absent without screw_inertia", getattr(self, name))
            return
        require(0.0 < inertia < math.inf, "screw_inertia", "finite and positive", inertia)
        stiffness = self.coupling_stiffness
        given = stiffness is not None and 0.0 < stiffness < math.inf
        require(given, "coupling_stiffness", "finite and positive with screw_inertia", stiffness)
        for name in _SCREW:
            value = getattr(self, name)
            given = value is not None and 0.0 <= value < math.inf
            require(given, name, "finite and at least 0 with screw_inertia", value)
        require((self.screw_delay or 0.0) <= 0.05, "screw_delay", "in [0, 50 ms]", self.screw_delay)

    @classmethod
    def of(cls, drive: FeedDrive, **changes: Any) -> Self:
        """Return an axis of the turret as a drive of its own, with the same friction and scale.

        Parameters
        ----------
        drive : FeedDrive
            X1 or Y1.
        **changes : Any
            Fields to set besides.
        """
        shared: dict[str, Any] = {field.name: getattr(drive, field.name) for field in fields(BallScrewStage)}
        friction = Friction(coulomb=drive.motor_friction, bristle_stiffness=drive.presliding_stiffness)
        own: dict[str, Any] = {"stage_noise": drive.scale_noise}
        own["motor_friction"] = friction if drive.motor_friction > 0.0 else None
        return cls(**shared | own | changes)

    def ideal(self) -> Self:
        """Return the drive without friction, ripple, load and errors of its encoders: linear; its lags stay."""
        nothing: dict[str, Any] = dict.fromkeys(("ripple", "motor_error", "stage_error"), ())
        nothing |= dict.fromkeys(("motor_resolution", "stage_resolution", "motor_noise", "stage_noise", "load"), 0.0)
        if self.screw_inertia is not None:
            nothing["screw_resolution"] = 0.0
        return replace(self, motor_friction=None, stage_friction=None, **nothing)

    def without_lags(self) -> Self:
        """Return the drive with an ideal current loop and no dead times."""
        screw = None if self.screw_inertia is None else 0.0
        none = {"thrust_delay": 0.0, "motor_delay": 0.0, "stage_delay": 0.0, "screw_delay": screw}
        return replace(self, current_bandwidth=math.inf, **none)

    @property
    def screw_mass(self) -> float:
        """Inertia of a screw behind its coupling, felt at the stage (kg)."""
        return 0.0 if self.screw_inertia is None else self.screw_inertia / self.ratio**2

    @property
    def mass_ratio(self) -> float:
        """Stage mass over all that rotates, alpha of the thesis."""
        return self.stage_mass / (self.motor_mass + self.screw_mass)

    def matrices(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return mass, damping and stiffness of motor, screw (if it is one of three inertias) and stage.

        Thesis (Yamada, 2017) eqs. (2-22) and (2-51), the latter with C_t for its C_c. The damping holds the viscous
        friction of both sides.

        Returns
        -------
        tuple of ndarray
            (kg), (N s/m), (N/m), each of shape (2, 2) or (3, 3).
        """
        inertia = [self.motor_mass, self.screw_mass, self.stage_mass]
        drag = [self.motor_viscosity, (self.screw_damping or 0.0) / self.ratio**2, self.stage_damping]
        for side, friction in ((0, self.motor_friction), (2, self.stage_friction)):
            drag[side] += friction.viscous if friction is not None else 0.0
        springs = [(self.coupling_stiffness, self.coupling_damping), (self.drive_stiffness, self.drive_damping)]
        if self.screw_inertia is None:
            del inertia[1], drag[1], springs[0]
        mass, damping, stiffness = np.diag(inertia), np.diag(drag), np.zeros((len(inertia), len(inertia)))
        for i, (k, c) in enumerate(springs):
            pair = np.array([[1.0, -1.0], [-1.0, 1.0]])
            stiffness[i : i + 2, i : i + 2] += (k or 0.0) * pair
            damping[i : i + 2, i : i + 2] += (c or 0.0) * pair
        return mass, damping, stiffness

    def transition(self, step: float) -> np.ndarray:
        """Return the exact step with thrust and loads held over it.

        Parameters
        ----------
        step : float
            (s)

        Returns
        -------
        ndarray
            Shape (10, 7): one row of responses for each of `STATES`, then for the thrust command, the load on the motor
            and the load on the stage; loads oppose the motion.
        """
        mass, damping, stiffness = self.matrices()
        count = len(mass)
        at = [0, 2, 4] if count == 3 else [0, 4]
        speed = [i + 1 for i in at]
        big = np.zeros((STATES + 3, STATES + 3))
        big[at, speed] = 1.0
        big[np.ix_(speed, at)] = -stiffness / mass.diagonal()[:, None]
        big[np.ix_(speed, speed)] = -damping / mass.diagonal()[:, None]
        big[1, 8], big[5, 9] = -1.0 / self.motor_mass, -1.0 / self.stage_mass
        ideal = self.current_bandwidth == math.inf
        big[1, 7 if ideal else 6] = 1.0 / self.motor_mass
        if not ideal:
            big[6, 6], big[6, 7] = -self.current_bandwidth, self.current_bandwidth
        full = expm(big * step)[:STATES]
        if ideal:
            full[6, 6], full[6, 7] = 0.0, 1.0
        return np.ascontiguousarray(full.T)
