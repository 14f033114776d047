"""One servo axis as an object: it owns the state of drive and control and advances it block by block."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from turning_sim import _axis_kernels as kernels
from turning_sim._check import require
from turning_sim.axis_drive import AxisDrive, Wave
from turning_sim.feed_drive import AxisControl
from turning_sim.friction import Friction
from turning_sim.simulator import SimulationDiverged, control_numbers

_FAR = 10.0


@dataclass(frozen=True, slots=True, kw_only=True)
class AxisBlock:
    """Signals of one block at the servo samples, each of shape (n,).

    Attributes
    ----------
    first_sample : int
        Index of the first sample.
    sample_rate_hz : float
        Servo rate (Hz).
    thrust : ndarray
        Commanded (N).
    motor_position, stage_position : ndarray
        As measured: aged, with the errors of the encoder, in its steps (m); the stage is nan without a linear scale.
    true_force : ndarray
        The force on the stage, as it was given (N), against its motion along + when positive.
    true_motor_position, true_stage_position : ndarray
        As they are (m).
    motor_friction, stage_friction : ndarray
        As they are (N), opposing the motion when positive.
    screw_position, true_screw_position : ndarray
        Of a screw behind its coupling, as measured and as it is (m); nan in a drive of two inertias.
    """

    first_sample: int
    sample_rate_hz: float
    thrust: np.ndarray
    motor_position: np.ndarray
    stage_position: np.ndarray
    true_force: np.ndarray
    true_motor_position: np.ndarray
    true_stage_position: np.ndarray
    motor_friction: np.ndarray
    stage_friction: np.ndarray
    screw_position: np.ndarray
    true_screw_position: np.ndarray


class ServoAxis:
    """A ball-screw axis under position control, or driven by a given thrust.

    The position is controlled in proportion, with that of the stage; the velocity too, with that of the motor; a
    first-order observer of motor and stage cancels disturbances (thesis, Yamada 2017, Fig. 3-4).

    Parameters
    ----------
    drive : AxisDrive
        The axis as it is.
    control : AxisControl or None
        Its loops; None to command the thrust.
    sample_rate_hz : float
        Servo rate (Hz).
    seed : int
        Of the noise of the encoders.
    substeps : int
        Exact steps of the drive for each servo sample.
    start_position : float
        Where motor and stage stand at the start (m).
    """

    def __init__(
        self,
        drive: AxisDrive,
        control: AxisControl | None,
        sample_rate_hz: float,
        *,
        seed: int = 0,
        substeps: int = 10,
        start_position: float = 0.0,
    ) -> None:
        require(0.0 < sample_rate_hz < math.inf, "sample_rate_hz", "finite and positive", sample_rate_hz)
        require(1 <= substeps <= 1000, "substeps", "in 1..1000", substeps)
        require(seed >= 0, "seed", "at least 0", seed)
        require(abs(start_position) < _FAR, "start_position", f"within {_FAR} m", start_position)
        self.drive, self.control = drive, control
        self.sample_rate_hz, self.substeps, self.sample = float(sample_rate_hz), substeps, 0
        self.step = 1.0 / (sample_rate_hz * substeps)
        self._transition = _exact_step(drive, self.step)
        self._motor_rub = _rub(drive.motor_friction, drive.motor_mass, self.step, self._transition[8, 1], "motor")
        self._stage_rub = _rub(drive.stage_friction, drive.stage_mass, self.step, self._transition[9, 5], "stage")
        self._ripple = _table(drive.ripple)
        self._errors = _table(drive.motor_error), _table(drive.stage_error)
        self._axis, self._law = self._numbers(), self._control_numbers()
        self._noise = np.random.Generator(np.random.Philox(key=[seed, 0]))
        self._noise_size = np.array([drive.motor_noise, drive.stage_noise])
        self._state = self._rest(start_position)

    def prepare(self) -> None:
        """Compile by running one dummy sample; the state is untouched."""
        before = self.snapshot()
        self.advance(np.array([self._state["law"][6]]), np.zeros(self.substeps))
        self.restore(before)

    def advance(self, command: np.ndarray, force: np.ndarray) -> AxisBlock:
        """Advance the axis by as many servo samples as there are commands.

        Parameters
        ----------
        command : ndarray
            Position reference (m), or thrust (N) where there is no control, shape (n,).
        force : ndarray
            On the stage, against its motion along + when positive, at the middles of the sub-steps, over which it is
            held (N), shape (n * substeps,).

        Returns
        -------
        AxisBlock
            Measured signals and truth at the samples.
        """
        reference, load = (np.ascontiguousarray(values, dtype=np.float64) for values in (command, force))
        require(reference.ndim == 1, "command", "of shape (n,)", reference.shape)
        shape = (reference.size * self.substeps,)
        require(load.shape == shape, "force", f"of shape {shape}, {self.substeps} for each command", load.shape)
        for name, values in (("command", reference), ("force", load)):
            bad = np.flatnonzero(~np.isfinite(values))
            require(bad.size == 0, name, "finite", f"{values[bad[:1]]} at {bad[:1]}")
        noise = self._noise.standard_normal((reference.size, 2)) * self._noise_size
        out, st = np.empty((kernels.CHANNELS, reference.size)), self._state
        status = kernels.advance(
            self._axis, self._law, self._motor_rub, self._stage_rub, self._transition, self._ripple, self._errors[0],
            self._errors[1], reference, load, noise, st["z"], st["rub"], st["law"], st["ring"], st["k"], st["last"],
            out,
        )  # fmt: skip
        first = self.sample
        self.sample += reference.size
        if status != kernels.Status.OK:
            hint = "the axis left its 10 m: its loop is unstable, or nothing holds it"
            raise SimulationDiverged(sample=self.sample, hint=hint)
        return AxisBlock(
            first_sample=first,
            sample_rate_hz=self.sample_rate_hz,
            thrust=out[kernels.THRUST],
            motor_position=out[kernels.MOTOR],
            stage_position=out[kernels.STAGE],
            true_force=out[kernels.FORCE],
            true_motor_position=out[kernels.TRUE_MOTOR],
            true_stage_position=out[kernels.TRUE_STAGE],
            motor_friction=out[kernels.MOTOR_FRICTION],
            stage_friction=out[kernels.STAGE_FRICTION],
            screw_position=out[kernels.SCREW],
            true_screw_position=out[kernels.TRUE_SCREW],
        )

    def force_times(self, samples: int) -> np.ndarray:
        """Return when the forces of the next samples act (s), shape (samples * substeps,).

        Parameters
        ----------
        samples : int
            Servo samples ahead.
        """
        first = self.sample * self.substeps
        return (np.arange(first, first + samples * self.substeps) + 0.5) / (self.sample_rate_hz * self.substeps)

    def snapshot(self) -> dict[str, Any]:
        """Return a copy of the whole state, generator included."""
        return {
            "sample": self.sample,
            "state": {name: value.copy() for name, value in self._state.items()},
            "noise": self._noise.bit_generator.state,
        }

    def restore(self, snapshot: dict[str, Any]) -> None:
        """Go back to a state from `snapshot`."""
        self.sample = snapshot["sample"]
        self._state = {name: value.copy() for name, value in snapshot["state"].items()}
        self._noise.bit_generator.state = snapshot["noise"]

    def _numbers(self) -> kernels.Axis:
        drive = self.drive
        return kernels.Axis(
            h=self.step,
            substeps=self.substeps,
            thrust_delay=int(_in_steps(drive.thrust_delay, self.step)),
            motor_delay=_in_steps(drive.motor_delay, self.step),
            stage_delay=_in_steps(drive.stage_delay, self.step),
            screw_delay=_in_steps(drive.screw_delay or 0.0, self.step),
            screw_step=drive.screw_resolution or 0.0,
            screw_encoder=drive.screw_inertia is not None,
            load=drive.load,
            closed=self.control is not None,
            stage_encoder=drive.stage_encoder,
            far=_FAR,
        )

    def _control_numbers(self) -> Any:
        idle = AxisControl(position_gain=0.0, velocity_gain=1.0, disturbance_bandwidth=0.0, derivative_bandwidth=1.0)
        law = control_numbers(self.drive, self.control or idle, self.sample_rate_hz)
        rotating = law.motor_mass + self.drive.screw_mass
        return law._replace(motor_mass=rotating, inertia=rotating + law.stage_mass)

    def _rest(self, position: float) -> dict[str, np.ndarray]:
        """Return the state at rest."""
        z, law, steps = np.zeros(8), np.zeros(8), self._axis
        z[[0, 2, 4]] = position
        oldest = max(steps.thrust_delay, steps.motor_delay, steps.stage_delay, steps.screw_delay)
        ring = np.zeros((2 ** math.ceil(math.log2(oldest + self.substeps + 2.0)), kernels.RING_CHANNELS))
        ring[:, [kernels.X_MOTOR, kernels.X_STAGE, kernels.X_SCREW]] = position
        resolutions = self.drive.motor_resolution, self.drive.stage_resolution
        motor, stage = (
            kernels.quantise(position + kernels.waves(error, position), resolution)
            for error, resolution in zip(self._errors, resolutions, strict=True)
        )
        law[:2] = motor, stage if self.drive.stage_encoder else motor
        law[6:] = position
        return {
            "z": z,
            "rub": np.zeros((2, 3)),
            "law": law,
            "ring": ring,
            "k": np.zeros(1, dtype=np.int64),
            "last": np.zeros(1),
        }


def _in_steps(delay: float, step: float) -> float:
    """Return a delay in sub-steps, whole where it is whole but for rounding."""
    steps = delay / step
    return float(round(steps)) if abs(steps - round(steps)) < 1e-9 * max(steps, 1.0) else steps


def _exact_step(drive: AxisDrive, step: float) -> np.ndarray:
    """Return the exact step, shape (11, 8): that of the drive, the command changing where its dead time ends within it.

    Row 7 is the newer command, row 10 the older; the last column is padding.
    """
    exact, part = drive.transition(step), _in_steps(drive.thrust_delay, step) % 1.0
    newer = drive.transition((1.0 - part) * step)[7]
    older = exact[7] - newer
    return np.pad(np.vstack([exact[:7], newer, exact[8:], older]), ((0, 0), (0, 1)))


def _table(waves: tuple[Wave, ...]) -> np.ndarray:
    """Return amplitude, wave number and phase of each wave, shape (waves, 3)."""
    rows = [(wave.amplitude, 2.0 * math.pi / wave.wavelength, wave.phase) for wave in waves]
    return np.array(rows, dtype=np.float64).reshape(-1, 3)


def _rub(friction: Friction | None, mass: float, step: float, grip: float, side: str) -> kernels.Rub:
    """Return the numbers of one side; a presliding spring must be slow against the sub-step."""
    if friction is None:
        friction = Friction(coulomb=0.0)
    stiffness = friction.bristle_stiffness or 0.0
    most = 0.1 * mass / step**2
    require(stiffness <= most, f"{side}_friction.bristle_stiffness", f"at most {most:g} with this sub-step", stiffness)
    most = 0.5 * mass / step
    damping = friction.bristle_damping
    require(damping <= most, f"{side}_friction.bristle_damping", f"at most {most:g} with this sub-step", damping)
    dry = kernels.BRISTLES if stiffness > 0.0 else kernels.STICKS
    return kernels.Rub(
        kind=dry if friction.coulomb > 0.0 else 0,
        coulomb=friction.coulomb,
        rise=friction.breakaway - friction.coulomb,
        stribeck_velocity=friction.stribeck_velocity,
        exponent=friction.stribeck_exponent,
        viscous=friction.viscous,
        stiffness=stiffness,
        damping=damping,
        grip=float(grip),
    )
