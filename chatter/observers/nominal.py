"""What the monitor believes about the feed drives; never what they are."""

from dataclasses import dataclass, fields
from math import cos, inf, isfinite, pi, sin
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray


class Sensors(NamedTuple):
    """Ages and counts of what is sensed, and the lag of what is commanded."""

    motor_delays: tuple[float, ...]
    """Age of each position on the motor side (s)."""
    stage_delays: tuple[float, ...]
    """Age of each linear scale (s)."""
    thrust_delays: tuple[float, ...]
    """Dead time of each thrust (s)."""
    resolutions: tuple[float, ...]
    """One count of each position, motor side first (m)."""
    omega_currents: tuple[float, ...]
    """Bandwidth of each current loop (rad/s)."""


def sensors_of(drives: "tuple[NominalFeedDrive, ...]") -> Sensors:
    """Return the sensors of drives with an encoder on the motor and a scale on the stage.

    Parameters
    ----------
    drives : tuple of NominalFeedDrive
        The drives.
    """
    return Sensors(
        motor_delays=tuple(d.motor_delay for d in drives),
        stage_delays=tuple(d.stage_delay for d in drives),
        thrust_delays=tuple(d.thrust_delay for d in drives),
        resolutions=(*(d.motor_resolution for d in drives), *(d.stage_resolution for d in drives)),
        omega_currents=tuple(d.omega_current for d in drives),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class NominalFeedDrive:
    """Two-inertia model of a ball-screw drive, with its encoders (thesis chapter 2; the listed values are nominal).

    Parameters
    ----------
    lead : float
        Lead of the screw (m per revolution).
    rotor_inertia : float
        Inertia of motor and screw (kg m^2).
    rotor_damping : float
        Viscous damping of the motor side (N m s).
    stage_mass : float
        Everything that the slide carries (kg).
    stage_damping : float
        Viscous damping of the guide (N s/m).
    screw_stiffness : float
        Axial stiffness between motor and stage (N/m).
    screw_damping : float
        Damping in parallel with it (N s/m).
    motor_resolution : float
        One count of the motor encoder as slide travel (m); 0 if the signal is not quantised.
    stage_resolution : float
        One count of the linear scale (m); 0 if the signal is not quantised.
    motor_delay : float
        Age of a motor position when it is sampled (s).
    stage_delay : float
        Age of a stage position when it is sampled (s).
    thrust_delay : float
        Dead time from command to current (s).
    omega_current : float
        Bandwidth of the current loop (rad/s); infinite if the thrust follows its command at once.
    motor_period, stage_period : float or None
        Signal period of motor encoder and linear scale as slide travel (m), at which they err; None when not known.
    """

    lead: float
    rotor_inertia: float
    rotor_damping: float
    stage_mass: float
    stage_damping: float
    screw_stiffness: float
    screw_damping: float
    motor_resolution: float
    stage_resolution: float
    motor_delay: float
    stage_delay: float
    thrust_delay: float
    omega_current: float
    motor_period: float | None = None
    stage_period: float | None = None

    def __post_init__(self) -> None:
        """Check every value once."""
        positive = {
            "lead", "rotor_inertia", "stage_mass", "screw_stiffness", "omega_current", "motor_period", "stage_period",
        }  # fmt: skip
        for field in fields(self):
            if field.name.endswith("_period") and getattr(self, field.name) is None:
                continue
            value: Any = getattr(self, field.name)
            known = isfinite(value) or (field.name == "omega_current" and value == inf)
            if not known or value < 0.0 or (field.name in positive and value == 0.0):
                rule = "positive" if field.name in positive else "at least 0"
                raise ValueError(f"{field.name} must be {rule} and finite, got {value}")

    @property
    def travel_per_radian(self) -> float:
        """Slide travel per angle of the motor (m/rad)."""
        return self.lead / (2.0 * pi)

    @property
    def rotor_mass(self) -> float:
        """Inertia of the motor side as seen at the slide (kg)."""
        return self.rotor_inertia / self.travel_per_radian**2

    @property
    def rotor_viscosity(self) -> float:
        """Viscous damping of the motor side as seen at the slide (N s/m)."""
        return self.rotor_damping / self.travel_per_radian**2

    @property
    def mass_ratio(self) -> float:
        """Stage mass over rotor mass."""
        return self.stage_mass / self.rotor_mass


@dataclass(frozen=True, slots=True, kw_only=True)
class SingleAxis:
    """One slide whose load is the force.

    Parameters
    ----------
    drive : NominalFeedDrive
        The drive.
    """

    drive: NominalFeedDrive

    @property
    def drives(self) -> tuple[NominalFeedDrive, ...]:
        """The drive alone."""
        return (self.drive,)

    @property
    def sensors(self) -> Sensors:
        """Ages and counts of its signals."""
        return sensors_of(self.drives)

    @property
    def cross_mass(self) -> float:
        """No other slide, no mass (kg)."""
        return 0.0

    def force_from_loads(self) -> NDArray[np.float64]:
        """Return the matrix from load to force, shape (1, 1)."""
        return np.ones((1, 1))


@dataclass(frozen=True, slots=True, kw_only=True)
class NominalTurret:
    """Two skewed slides, Y1 riding on X1, and the frame in which their loads become a force on the tool.

    Parameters
    ----------
    x1, y1 : NominalFeedDrive
        The drives; the stage mass of the lower one includes the upper slide.
    upper_mass : float
        Mass of the upper slide (kg), which couples the two accelerations.
    axis_angle : float
        Angle between the slides (rad).
    """

    x1: NominalFeedDrive
    y1: NominalFeedDrive
    upper_mass: float
    axis_angle: float = 0.25 * pi

    def __post_init__(self) -> None:
        """Check every value once."""
        if not (isfinite(self.upper_mass) and self.upper_mass >= 0.0):
            raise ValueError(f"upper_mass must be at least 0 and finite, got {self.upper_mass}")
        if not 0.0 < self.axis_angle < pi:
            raise ValueError(f"axis_angle must be in (0, pi), got {self.axis_angle}")

    @property
    def drives(self) -> tuple[NominalFeedDrive, ...]:
        """Both drives, X1 first."""
        return self.x1, self.y1

    @property
    def sensors(self) -> Sensors:
        """Ages and counts of the signals of both."""
        return sensors_of(self.drives)

    @property
    def cross_mass(self) -> float:
        """Mass (kg) that the acceleration of one slide weighs in the balance of the other."""
        return self.upper_mass * cos(self.axis_angle)

    def force_from_loads(self) -> NDArray[np.float64]:
        """Return the matrix from slide loads (Q_x, Q_y) to the force on the tool (F_x, F_y'), shape (2, 2).

        F_x > 0 pushes the tool out, against +X1; F_y' > 0 pulls it along the surface motion, +Y1'. A load is positive
        when it opposes its slide, hence Q_x = F_x and Q_y = F_x cos(psi) - F_y' sin(psi).
        """
        return np.array([[1.0, 0.0], [cos(self.axis_angle) / sin(self.axis_angle), -1.0 / sin(self.axis_angle)]])
