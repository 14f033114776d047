"""Ball-screw drives of turret 1 and their exact step."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm

from turning_sim._check import require


@dataclass(frozen=True, slots=True, kw_only=True)
class BallScrewStage:
    """Motor and screw, spring, stage, current loop, encoders of one axis.

    Attributes
    ----------
    lead : float
        Travel per turn of the screw (m).
    motor_inertia : float
        Motor, coupling and screw (kg m2).
    motor_damping : float
        Viscous (N m s/rad).
    stage_mass : float
        What the nut moves, a slide riding on it included (kg).
    stage_damping : float
        Viscous, of the guide (N s/m).
    drive_stiffness, drive_damping : float
        Between nut and stage (N/m), (N s/m).
    current_bandwidth : float
        Of the current loop (rad/s).
    thrust_delay, motor_delay, stage_delay : float
        Dead times of the command and of the two encoders (s).
    motor_resolution, stage_resolution : float
        Encoder steps at the stage (m); 0 for none.
    """

    lead: float
    motor_inertia: float
    motor_damping: float
    stage_mass: float
    stage_damping: float
    drive_stiffness: float
    drive_damping: float
    current_bandwidth: float
    thrust_delay: float
    motor_delay: float
    stage_delay: float
    motor_resolution: float
    stage_resolution: float

    def __post_init__(self) -> None:
        for name in ("lead", "motor_inertia", "stage_mass", "drive_stiffness", "current_bandwidth"):
            require(getattr(self, name) > 0.0, name, "positive", getattr(self, name))
        for name in ("motor_damping", "stage_damping", "drive_damping", "motor_resolution", "stage_resolution"):
            require(getattr(self, name) >= 0.0, name, "at least 0", getattr(self, name))

    @property
    def ratio(self) -> float:
        """Travel per radian of the screw (m/rad)."""
        return self.lead / (2.0 * math.pi)

    @property
    def motor_mass(self) -> float:
        """Rotating inertia felt at the stage (kg)."""
        return self.motor_inertia / self.ratio**2

    @property
    def motor_viscosity(self) -> float:
        """Motor damping felt at the stage (N s/m)."""
        return self.motor_damping / self.ratio**2


@dataclass(frozen=True, slots=True, kw_only=True)
class FeedDrive(BallScrewStage):
    """One axis of the turret as it is: a ball-screw stage, the noise of its scale, and dry friction at its motor.

    Attributes
    ----------
    scale_noise : float
        Interpolation noise of the linear scale (m rms).
    motor_friction : float
        Dry friction of screw and bearings, felt at the stage (N).
    presliding_stiffness : float
        Of that friction before it slides (N/m).
    """

    scale_noise: float = 0.0
    motor_friction: float = 0.0
    presliding_stiffness: float = 5e7

    def __post_init__(self) -> None:
        BallScrewStage.__post_init__(self)
        for name in ("scale_noise", "motor_friction"):
            require(getattr(self, name) >= 0.0, name, "at least 0", getattr(self, name))
        require(self.presliding_stiffness > 0.0, "presliding_stiffness", "positive", self.presliding_stiffness)
        for name in ("thrust_delay", "motor_delay", "stage_delay"):
            require(0.0 <= getattr(self, name) < 2e-3, name, "in [0, 2 ms)", getattr(self, name))


@dataclass(frozen=True, slots=True, kw_only=True)
class AxisControl:
    """Gains of one axis: position and velocity loop with disturbance observer.

    Attributes
    ----------
    position_gain, velocity_gain : float
        (1/s); a position gain of 0 leaves the velocity loop alone.
    disturbance_bandwidth : float
        Of the observer (rad/s); 0 for none.
    derivative_bandwidth : float
        Of the differentiated encoders (rad/s).
    """

    position_gain: float
    velocity_gain: float
    disturbance_bandwidth: float
    derivative_bandwidth: float

    def __post_init__(self) -> None:
        for name in ("velocity_gain", "derivative_bandwidth"):
            require(getattr(self, name) > 0.0, name, "positive", getattr(self, name))
        for name in ("position_gain", "disturbance_bandwidth"):
            require(getattr(self, name) >= 0.0, name, "at least 0", getattr(self, name))


@dataclass(frozen=True, slots=True, kw_only=True)
class TurretDrives:
    """X1 with Y1 riding on it.

    Attributes
    ----------
    x1, y1 : FeedDrive
        X1 carries the slide of Y1, its mass included.
    x1_control, y1_control : AxisControl
        Their loops.
    upper_mass : float
        Mass of the slide of Y1 (kg).
    axis_angle : float
        Between the two slides (rad).
    """

    x1: FeedDrive
    y1: FeedDrive
    x1_control: AxisControl
    y1_control: AxisControl
    upper_mass: float
    axis_angle: float = math.pi / 4.0

    def __post_init__(self) -> None:
        require(0.1 < self.axis_angle <= math.pi / 2.0, "axis_angle", "in (0.1, pi/2]", self.axis_angle)
        limit = min(self.x1.stage_mass, self.y1.stage_mass)
        require(0.0 <= self.upper_mass <= limit, "upper_mass", "in [0, the lighter stage]", self.upper_mass)
        for name in ("x1", "y1"):
            gain, bandwidth = getattr(self, f"{name}_control").position_gain, getattr(self, name).current_bandwidth
            require(gain > 0.0, f"{name}_control.position_gain", "positive", gain)
            require(bandwidth < math.inf, f"{name}.current_bandwidth", "finite", bandwidth)
        for name in ("thrust_delay", "motor_delay", "stage_delay"):
            same = getattr(self.x1, name) == getattr(self.y1, name)
            require(same, f"y1.{name}", f"equal to x1.{name}", getattr(self.y1, name))

    def transition(self, step: float) -> np.ndarray:
        """Return the exact step of both axes, thrust held and load linear over it.

        Parameters
        ----------
        step : float
            (s)

        Returns
        -------
        ndarray
            Shape (18, 10): one row of responses for each state (motor position and velocity, stage position and
            velocity, thrust, of X1 then Y1), then for the two thrust commands, the two loads at the start and the two
            at the end of the step, and the two motor frictions (held). Loads and frictions oppose their slides.
        """
        a, b_thrust, b_load = self._continuous()
        # inputs as states: thrust (2), load (2) and its slope (2), friction (2)
        big = np.zeros((18, 18))
        big[:10, :10], big[:10, 10:12], big[:10, 12:14] = a, b_thrust, b_load
        big[12:14, 14:16] = np.eye(2) / step
        big[1, 16], big[6, 17] = -1.0 / self.x1.motor_mass, -1.0 / self.y1.motor_mass
        full = expm(big * step)[:10]
        full[:, 12:14] -= full[:, 14:16]
        return np.ascontiguousarray(full.T)

    def _continuous(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        a, b_thrust, b_load = np.zeros((10, 10)), np.zeros((10, 2)), np.zeros((10, 2))
        coupling = self.upper_mass * math.cos(self.axis_angle)
        inverse = np.linalg.inv(np.array([[self.x1.stage_mass, coupling], [coupling, self.y1.stage_mass]]))
        for i, axis in enumerate((self.x1, self.y1)):
            o, k, c = 5 * i, axis.drive_stiffness, axis.drive_damping
            a[o, o + 1] = a[o + 2, o + 3] = 1.0
            spring = np.array([k, c, -k, -c])
            a[o + 1, o : o + 4] = -spring / axis.motor_mass
            a[o + 1, o + 1] -= axis.motor_viscosity / axis.motor_mass
            a[o + 1, o + 4] = 1.0 / axis.motor_mass
            a[o + 4, o + 4] = -axis.current_bandwidth
            b_thrust[o + 4, i] = axis.current_bandwidth
            for j in range(2):
                a[5 * j + 3, o : o + 4] += inverse[j, i] * spring
                a[5 * j + 3, o + 3] -= inverse[j, i] * axis.stage_damping
                b_load[5 * j + 3, i] = -inverse[j, i]
        return a, b_thrust, b_load
