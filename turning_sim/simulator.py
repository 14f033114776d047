"""The plant as one object: it owns the state and advances it block by block."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from turning_sim import _kernels as kernels
from turning_sim import _plane_kernels as plane
from turning_sim._check import require
from turning_sim.cutting import Cutting
from turning_sim.feed_drive import AxisControl, BallScrewStage, TurretDrives
from turning_sim.finished import FinishedSurface
from turning_sim.linear import LinearParameters, linear_parameters
from turning_sim.plant_block import PlantBlock
from turning_sim.process import ProcessModel, columns_of, grid_of
from turning_sim.turrets import shift_of_tool, slides_of_shift, tool_of_slides
from turning_sim.workpiece import Workpiece

_Floats = np.ndarray
_TABLE_STEP = 0.5e-3
_LOWEST_SPINDLE_HZ = 5.0


class SimulationDiverged(RuntimeError):  # noqa: N818 (the name users know)
    """The plant left the range in which its equations mean anything."""

    def __init__(self, *, sample: int, hint: str) -> None:
        super().__init__(f"simulation stopped before sample {sample}: {hint}")
        self.sample = sample
        self.hint = hint


class Simulator:
    """Two opposed tools on one flexible bar, turret 1 on its drives.

    Parameters
    ----------
    workpiece : Workpiece
        The bar.
    cutting : Cutting
        The cut.
    drives : TurretDrives
        Turret 1.
    sample_rate_hz : float
        Servo rate (Hz).
    substeps : int
        Steps of bar, drives and surface for each servo sample.
    start_position : float
        Tools from the tip at entry (m).
    air_time : float
        Before both tools enter together (s), rounded to a servo sample.
    seed : int
        Of force and scale noise.
    initial_shift : float
        Where turret 1 stands at the start (rad).
    diameter : float or None
        At the cutting point, for the arc and the surface speed (m); None takes the workpiece's.
    end_position : float or None
        Where the tools leave the cut (m); None for the chuck.
    model : ProcessModel
        How much of the process is computed.

    Attributes
    ----------
    finished : FinishedSurface or None
        What the surface map has left behind for good; None with the linear cut.
    """

    def __init__(
        self,
        *,
        workpiece: Workpiece,
        cutting: Cutting,
        drives: TurretDrives,
        sample_rate_hz: float = 9000.0,
        substeps: int = 6,
        start_position: float,
        air_time: float,
        seed: int,
        initial_shift: float = 0.0,
        diameter: float | None = None,
        end_position: float | None = None,
        model: ProcessModel | None = None,
    ) -> None:
        end = workpiece.length if end_position is None else end_position
        require(sample_rate_hz > 0.0, "sample_rate_hz", "positive", sample_rate_hz)
        require(substeps >= 1, "substeps", "at least 1", substeps)
        require(0.0 <= start_position < end, "start_position", "in [0, end_position)", start_position)
        require(end <= workpiece.length, "end_position", "at most the length of the bar", end)
        require(
            cutting.spindle_hz >= _LOWEST_SPINDLE_HZ, "spindle_hz", f"at least {_LOWEST_SPINDLE_HZ}", cutting.spindle_hz
        )
        require(seed >= 0, "seed", "at least 0", seed)
        require(air_time >= 0.0, "air_time", "at least 0", air_time)
        require(abs(initial_shift) <= math.radians(20.0), "initial_shift", "within 20 deg", initial_shift)
        self.workpiece, self.cutting, self.drives = workpiece, cutting, drives
        self.sample_rate_hz, self.substeps = sample_rate_hz, substeps
        self.diameter = workpiece.cutting_diameter if diameter is None else diameter
        require(self.diameter > 0.0, "diameter", "positive", self.diameter)
        self.model = ProcessModel() if model is None else model
        self.sample = 0
        self.step = 1.0 / (sample_rate_hz * substeps)
        grid = np.arange(0.0, workpiece.length + 0.5 * _TABLE_STEP, _TABLE_STEP)
        self._table = workpiece.table(np.minimum(grid, workpiece.length))
        self._drive = np.pad(drives.transition(self.step), ((0, 0), (0, 6)))
        self._controls = tuple(
            control_numbers(axis, gains, sample_rate_hz)
            for axis, gains in ((drives.x1, drives.x1_control), (drives.y1, drives.y1_control))
        )
        self._grid = grid_of(cutting, self.model)
        self._plant = self._plant_numbers(start_position, end, round(air_time * sample_rate_hz))
        self._scale_noise = np.array([drives.x1.scale_noise, drives.y1.scale_noise])
        self._noise = np.random.Generator(np.random.Philox(key=[seed, 0]))
        self._scale = np.random.Generator(np.random.Philox(key=[seed, 1]))
        self._state = self._rest(initial_shift)
        self._mapped = self.model.cut == "surface"
        self.finished = FinishedSurface(self._grid.dz, -self._grid.tip * self._grid.dz) if self._mapped else None

    def prepare(self) -> None:
        """Compile by running one dummy sample; the state is untouched."""
        before = self.snapshot()
        self.advance(self._state["servo_x"][6:7].copy(), self._state["servo_y"][6:7].copy())
        self.restore(before)

    def advance(
        self,
        x1_ref: np.ndarray,
        y1_ref: np.ndarray,
        spindle_hz: float | np.ndarray | None = None,
        knock: np.ndarray | None = None,
    ) -> PlantBlock:
        """Advance the plant by as many servo samples as there are references.

        Parameters
        ----------
        x1_ref, y1_ref : ndarray
            Absolute slide references (m), shape (n,).
        spindle_hz : float or ndarray or None
            Spindle speed (Hz), one or shape (n,); None for the nominal one.
        knock : ndarray or None
            Force from outside on the two tools, out of the cut, felt while each has contact (N), shape (n, 2).

        Returns
        -------
        PlantBlock
            Measured signals and truth at the samples.
        """
        refs = np.array([x1_ref, y1_ref], dtype=np.float64)
        require(refs.ndim == 2 and bool(np.isfinite(refs).all()), "x1_ref, y1_ref", "finite, shape (n,)", refs.shape)
        n = refs.shape[1]
        speed = np.broadcast_to(np.asarray(self.cutting.spindle_hz if spindle_hz is None else spindle_hz, float), (n,))
        slowest = float(speed.min(initial=np.inf))
        require(slowest >= _LOWEST_SPINDLE_HZ, "spindle_hz", f"at least {_LOWEST_SPINDLE_HZ}", slowest)
        noise = self._force_noise() * self._noise.standard_normal((n * self.substeps, 2))
        if knock is not None:
            fits = knock.shape == (n, 2) and bool(np.isfinite(knock).all())
            require(fits, "knock", f"finite, shape {(n, 2)}", knock.shape)
            noise += np.repeat(knock, self.substeps, axis=0)
        scale = self._scale.standard_normal((n, 2)) * self._scale_noise
        omega = 2.0 * np.pi * speed
        status, out = (self._line if self.model.directions == 1 else self._plane)(refs, omega, noise, scale)
        first = self.sample
        self.sample += n
        if status != kernels.Status.OK:
            raise SimulationDiverged(sample=self.sample, hint=_HINTS[kernels.Status(status)])
        return self._block(first, out)

    def resume(self, *, air_time: float = 0.0, position: float | None = None, cutting: Cutting | None = None) -> None:
        """Go on from the next sample after a pause in air, at another place or with another cutting condition.

        Parameters
        ----------
        air_time : float
            Both tools are out of the cut for so long and enter again together (s); the surface starts anew.
        position : float or None
            Tools from the tip when they enter (m); None for where they are.
        cutting : Cutting or None
            Condition of the cut from now on; None for the present one, which the surface map needs.
        """
        require(air_time >= 0.0, "air_time", "at least 0", air_time)
        require(cutting is None or not self._mapped, "cutting", "None with the surface map", cutting)
        here = self._here() if position is None else position
        require(0.0 <= here <= self._plant.stop, "position", "in [0, end_position]", here)
        self.cutting = self.cutting if cutting is None else cutting
        entry = self.sample + round(air_time * self.sample_rate_hz)
        self._plant = self._plant_numbers(here, self._plant.stop, entry)
        self._state["k"][kernels.WAS_IN_CUT] = 0

    def _here(self) -> float:
        """Return how far the tools are from the tip (m)."""
        f, plant = self._state["f"], self._plant
        turned = f[kernels.THETA] - f[kernels.THETA_ENTRY] if self._state["k"][kernels.WAS_IN_CUT] else 0.0
        return min(plant.start + plant.feed * float(turned) / (2.0 * math.pi), plant.stop)

    def _force_noise(self) -> float:
        """Return the force noise of a tool in one step (N rms)."""
        return self.cutting.force_noise * math.sqrt(0.5 / self.step)

    def _line(self, refs: _Floats, omega: _Floats, noise: _Floats, scale: _Floats) -> tuple[int, _Floats]:
        st, out = self._state, np.zeros((plane.CHANNELS, refs.shape[1]))
        status = kernels.advance(
            self._plant, self._controls[0], self._controls[1], self._drive, self._table, refs, omega, noise, scale,
            st["z"], st["bar"], st["servo_x"], st["servo_y"], st["ring"], st["phase"], st["left"], st["f"], st["k"],
            out,
        )  # fmt: skip
        return status, out

    def _plane(self, refs: _Floats, omega: _Floats, noise: _Floats, scale: _Floats) -> tuple[int, _Floats]:
        st, out = self._state, np.empty((plane.CHANNELS, refs.shape[1]))
        tails = np.empty((refs.shape[1], 2 * self._grid.half_feed if self._mapped else 0))
        status = plane.advance(
            self._plant, self._grid, self._mapped, self._controls[0], self._controls[1], self._drive, self._table, refs,
            omega, noise, scale, st["z"], st["bar"], st["servo_x"], st["servo_y"], st["ring"], st["phase"], st["left"],
            st["columns"], st["rest"], st["f"], st["k"], out, tails,
        )  # fmt: skip
        if self.finished is not None and status == kernels.Status.OK:
            inside = out[kernels.IN_CUT] != 0.0
            self.finished.add(out[kernels.PHASE2][inside], out[kernels.POSITION][inside], tails[inside])
        return status, out

    def linear_parameters(self, tool_position: float) -> LinearParameters:
        """Return the one-mode numbers with the tools at `tool_position` (m from the tip)."""
        return linear_parameters(self.workpiece, self.cutting, tool_position)

    def snapshot(self) -> dict[str, Any]:
        """Return a copy of the whole state, generators included."""
        return {
            "sample": self.sample,
            "condition": (self.cutting, self._plant),
            "state": {name: value.copy() for name, value in self._state.items()},
            "noise": self._noise.bit_generator.state,
            "scale": self._scale.bit_generator.state,
            "finished": None if self.finished is None else self.finished.copy(),
        }

    def restore(self, snapshot: dict[str, Any]) -> None:
        """Go back to a state from `snapshot`."""
        self.sample = snapshot["sample"]
        self.cutting, self._plant = snapshot["condition"]
        self._state = {name: value.copy() for name, value in snapshot["state"].items()}
        self._noise.bit_generator.state = snapshot["noise"]
        self._scale.bit_generator.state = snapshot["scale"]
        self.finished = None if snapshot["finished"] is None else snapshot["finished"].copy()

    def _plant_numbers(self, start: float, end: float, entry_sample: int) -> kernels.Plant:
        cut, drives = self.cutting, self.drives
        radial, tangential = cut.steady_forces
        return kernels.Plant(
            h=self.step,
            substeps=self.substeps,
            entry_step=entry_sample * self.substeps,
            start=start,
            stop=end,
            feed=cut.feed_per_rev,
            radius=self.diameter / 2.0,
            stiffness=cut.cutting_stiffness,
            tangential_ratio=cut.tangential_ratio,
            mu=cut.overlap,
            cp=cut.process_damping,
            flank_factor=cut.flank_factor,
            tan_clearance=math.tan(cut.flank_clearance),
            rake=cut.rake_gain,
            force=radial,
            tangential_force=tangential,
            setting=cut.setting_difference,
            cos_psi=math.cos(drives.axis_angle),
            sin_psi=math.sin(drives.axis_angle),
            thrust_delay=drives.x1.thrust_delay / self.step,
            motor_delay=drives.x1.motor_delay / self.step,
            stage_delay=drives.x1.stage_delay / self.step,
            friction_x=drives.x1.motor_friction,
            friction_y=drives.y1.motor_friction,
            presliding_x=drives.x1.presliding_stiffness,
            presliding_y=drives.y1.presliding_stiffness,
            table_step=_TABLE_STEP,
            max_amplitude=1e-3,
        )

    def _rest(self, shift: float) -> dict[str, np.ndarray]:
        """Return the state at rest."""
        slides = [float(s) for s in slides_of_shift(shift, self.diameter, self.drives.axis_angle)]
        z, ring = np.zeros(10), np.zeros((kernels.RING, 6))
        servos = np.zeros((2, 8))
        for i, (position, axis) in enumerate(zip(slides, (self.drives.x1, self.drives.y1), strict=True)):
            z[[5 * i, 5 * i + 2]] = position
            ring[:, [2 + i, 4 + i]] = position
            servos[i, 0] = kernels.quantise(position, axis.motor_resolution)
            servos[i, 1] = kernels.quantise(position, axis.stage_resolution)
            servos[i, 6:] = position
        memory = kernels.SURFACE if self.model.cut == "linear" else self._memory()
        past = np.arange(memory, dtype=np.float64) - memory
        phase = 2.0 * np.pi * self.cutting.spindle_hz * self.step * (past + 1.0)
        half = math.ceil(0.5 / (self.cutting.spindle_hz * self.step))
        rest = self._rest_columns(shift)
        return {
            "z": z,
            "bar": np.zeros((len(self.workpiece.damping_ratios), 2 * self.model.directions)),
            "servo_x": servos[0],
            "servo_y": servos[1],
            "ring": ring,
            "phase": np.array([phase - shift, phase]),
            "left": np.zeros((2, memory)),
            "columns": np.repeat(rest[:, None, :], memory if self.model.cut == "surface" else 1, axis=1),
            "rest": rest,
            "f": np.zeros(plane.FORCES),
            "k": np.array([0, -half, -half, 0]),
        }

    def _memory(self) -> int:
        """Return how many columns each tool keeps: half a turn at half the nominal speed, and the widest shift."""
        turn = 1.0 / (self.cutting.spindle_hz * self.step)
        return 2 ** math.ceil(math.log2(2.0 * (0.5 + 20.0 / 360.0) * turn + 2 * plane.GUARD))

    def _rest_columns(self, shift: float) -> _Floats:
        """Return the steady surface under each tool, in air and before the cut."""
        if self.model.cut == "linear":
            return np.zeros((2, 0))
        ahead, still = self.cutting.feed_per_rev * shift / (2.0 * math.pi), np.zeros((12, 1))
        return np.stack([columns_of(self._grid, still, pair)[0] for pair in ((ahead, 0.0), (0.0, ahead))])

    def _block(self, first: int, out: np.ndarray) -> PlantBlock:
        dx1, dy1p = tool_of_slides(out[kernels.X1_STAGE], out[kernels.Y1_STAGE], self.drives.axis_angle)
        return PlantBlock(
            first_sample=first,
            sample_rate_hz=self.sample_rate_hz,
            x1_thrust=out[kernels.X1_THRUST],
            x1_motor_position=out[kernels.X1_MOTOR],
            x1_stage_position=out[kernels.X1_STAGE],
            y1_thrust=out[kernels.Y1_THRUST],
            y1_motor_position=out[kernels.Y1_MOTOR],
            y1_stage_position=out[kernels.Y1_STAGE],
            dx1=dx1,
            dy1p=dy1p,
            shift=shift_of_tool(dx1, dy1p, self.diameter),
            bar_displacement=out[kernels.BAR],
            bar_displacement_y=out[plane.BAR_Y],
            vibration=out[kernels.VIBRATION],
            force_x1=out[kernels.FORCE_X1],
            force_y1p=out[kernels.FORCE_Y1P],
            force_x2=out[kernels.FORCE_X2],
            contact1=out[kernels.CONTACT1] != 0.0,
            contact2=out[kernels.CONTACT2] != 0.0,
            spindle_angle=out[kernels.ANGLE],
            tool_position=out[kernels.POSITION],
            left1=out[kernels.LEFT1],
            left2=out[kernels.LEFT2],
            phase1=out[kernels.PHASE1],
            phase2=out[kernels.PHASE2],
            in_cut=out[kernels.IN_CUT] != 0.0,
        )


_HINTS = {
    kernels.Status.DIVERGED: "the bar moved more than a millimetre; check the cutting stiffness and the damping",
    kernels.Status.BEYOND_MAP: "a tool went more than 0.15 mm deeper than nominal, beyond the surface map",
    kernels.Status.SURFACE_MEMORY: "the spindle is too slow for the stored surface",
}


def control_numbers(axis: BallScrewStage, gains: AxisControl, rate: float) -> kernels.Control:
    """Return the numbers of one axis' control law at a servo rate (Hz)."""
    g, step = gains.derivative_bandwidth, 1.0 / rate
    return kernels.Control(
        inertia=axis.motor_mass + axis.stage_mass,
        motor_mass=axis.motor_mass,
        stage_mass=axis.stage_mass,
        motor_damping=axis.motor_viscosity,
        stage_damping=axis.stage_damping,
        kp=gains.position_gain,
        kv=gains.velocity_gain,
        dis_gain=1.0 - math.exp(-gains.disturbance_bandwidth * step),
        g_dis=gains.disturbance_bandwidth,
        der_b=2.0 * g / (2.0 + g * step),
        der_a=(2.0 - g * step) / (2.0 + g * step),
        rate=rate,
        motor_step=axis.motor_resolution,
        stage_step=axis.stage_resolution,
    )
