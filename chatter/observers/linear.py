"""What all observers share that weigh three taps of every signal: alignment, kernel, low-pass, frame of the force."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chatter.blocks import as_block, reject_non_finite
from chatter.filters import BiquadFilterState, butterworth, group_delay, response, steady_state
from chatter.observers import _kernels
from chatter.observers.delays import align
from chatter.observers.motor_motion import MotorMotion
from chatter.observers.nominal import NominalFeedDrive, NominalTurret, SingleAxis
from chatter.observers.triple_axis import TripleAxis

Floats = NDArray[np.float64]
Drives = NominalTurret | SingleAxis
System = Drives | TripleAxis

NO_THRUST: Floats = np.zeros((0, 0))


def single_or_turret(drives: NominalFeedDrive | Drives) -> Drives:
    """Return a single drive as a system of one axis, a system as it is.

    Parameters
    ----------
    drives : NominalFeedDrive, SingleAxis or NominalTurret
        What is believed about the drives.
    """
    return SingleAxis(drive=drives) if isinstance(drives, NominalFeedDrive) else drives


@dataclass(frozen=True, slots=True, kw_only=True)
class ObserverState:
    """Copy of the whole state of a `LinearObserver`."""

    seen: int
    origin: Floats
    held: Floats
    motion: tuple[BiquadFilterState, ...]
    history: Floats
    slow: Floats
    delays: Floats
    idling: Floats


class LinearObserver:
    """Cutting force as a weighted sum of level, slope and curvature of thrust and both positions, low-passed.

    Positions count from the first sample: a constant load (gravity) is left out and nothing rings at the start.

    Parameters
    ----------
    name : str
        Of the estimator.
    drives : NominalFeedDrive, SingleAxis, NominalTurret or TripleAxis
        Nominal drives, with the angle and the cross mass of the slides where there are two.
    sample_rate_hz : float
        Sampling rate (Hz).
    gains : ndarray, shape (signals, rows, 3)
        What level, first and second difference of all motor positions, all stage positions and all thrusts (m, m, N)
        add to each balance (N); as many rows as axes, or twice as many: stage balances, then motor balances to blend.
    cutoff_hz : float
        Edge of the low-pass that all terms share (Hz).
    order : int
        Order of that Butterworth filter.
    compensation : {"full", "thrust", "none", "raw"}
        `full`: signals of different age are aligned, and the thrust passes the lag of the current loop; `thrust`: as
        if both encoders were as old as the older; `none`: lag alone; `raw`: nothing.
    blend_hz : float or None
        Edge below which the motor balance is added to the stage balance (Hz); None without rows to blend.
    sections : ndarray, shape (k, 5), optional
        Filter that takes the place of the low-pass.
    smoothing : ndarray, shape (2 n + 1,), optional
        Symmetric weights over which the positions are smoothed; the thrust is delayed by n samples beside them.
    centre_hz : float
        Where the latency is told (Hz).
    weight : float or None
        lambda of a member of the two-encoder family of one axis, to be told.
    motion : MotorMotion or None
        What to take for the motor positions instead of what their encoders count.
    """

    def __init__(
        self,
        name: str,
        drives: NominalFeedDrive | System,
        sample_rate_hz: float,
        gains: Floats,
        *,
        cutoff_hz: float = 1000.0,
        order: int = 4,
        compensation: str = "full",
        blend_hz: float | None = None,
        sections: Floats | None = None,
        smoothing: Floats | None = None,
        centre_hz: float = 0.0,
        weight: float | None = None,
        motion: MotorMotion | None = None,
    ) -> None:
        if compensation not in ("full", "thrust", "none", "raw"):
            raise ValueError(f"compensation must be full, thrust, none or raw, got {compensation!r}")
        if not (np.isfinite(sample_rate_hz) and sample_rate_hz > 0.0):
            raise ValueError(f"sample_rate_hz must be positive, got {sample_rate_hz}")
        self.name = name
        self.drives: System = SingleAxis(drive=drives) if isinstance(drives, NominalFeedDrive) else drives
        sensors = self.drives.sensors
        self.axes, self.motors = len(sensors.thrust_delays), len(sensors.motor_delays)
        self._positions = self.motors + len(sensors.stage_delays)
        self.sample_rate_hz = float(sample_rate_hz)
        self.bandwidth_hz = float(cutoff_hz)
        self.sections = butterworth(order, cutoff_hz, sample_rate_hz) if sections is None else sections
        self.gains = gains
        self.weight = weight
        self.motion = motion
        self._weighs_thrust = bool(gains[self._positions :].any())
        self.needs_thrust = self._weighs_thrust or motion is not None
        used = slice(None) if self._weighs_thrust else slice(self._positions)
        self._alignment = align(self._ages(compensation)[used] * self.sample_rate_hz)
        if smoothing is not None:
            self._alignment = self._alignment.smoothed(smoothing, self._positions)
        self._centre_hz = centre_hz
        self._resolution = np.array(sensors.resolutions)
        if motion is not None:
            self._resolution[: self.motors] = 0.0  # no longer whole counts
        unit = np.where(self._resolution > 0.0, self._resolution, 1.0)
        self._scaled = gains[used].copy()
        self._scaled[: self._positions] *= unit[:, None, None]
        omega = np.array(sensors.omega_currents)
        self._lag = np.exp(-omega / self.sample_rate_hz) if compensation != "raw" else np.full(self.axes, -1.0)
        self.blends = blend_hz is not None
        pole = np.pi * (blend_hz or 0.0) / self.sample_rate_hz
        self._blend = np.full(self.axes, (1.0 - np.tan(pole)) / (1.0 + np.tan(pole)))
        self._steady = steady_state(self.sections)
        self._turn = self.drives.force_from_loads()
        self._allocate()

    def _ages(self, compensation: str) -> Floats:
        sensors = self.drives.sensors
        positions = np.array([*sensors.motor_delays, *sensors.stage_delays])
        if compensation == "thrust":
            positions[:] = positions.max()
        ages = np.concatenate([positions, -np.array(sensors.thrust_delays)])
        return ages if compensation in ("full", "thrust") else np.zeros(len(ages))

    def _allocate(self) -> None:
        signals = len(self._scaled)
        self._origin = np.zeros(self._positions)
        self._held = np.zeros((self.axes, 2))
        self._history = np.zeros((signals, self._alignment.reach + 2))
        self._slow = np.zeros((self.axes, 2))
        self._delays = np.zeros((self.axes, len(self.sections), 2))
        self._idling = np.zeros(self.axes)
        self._seen = 0

    def update(self, motor_position: ArrayLike, stage_position: ArrayLike, thrust: ArrayLike | None = None) -> Floats:
        """Take a block of signals and return the force (N), of the shape of the positions.

        One axis: the force that opposes the motion of the stage. A turret: F_x against +X1, F_y' along +Y1'.

        Parameters
        ----------
        motor_position : array_like, shape (n,) or (n, motors)
            Positions by the motor encoders (m), as slide travel.
        stage_position : array_like, shape (n,) or (n, axes)
            Positions by the linear scales (m).
        thrust : array_like, shape (n,) or (n, axes), optional
            Commanded thrust (N); must be given where `needs_thrust` says so.
        """
        motor, stage = as_block(motor_position, self.motors), as_block(stage_position, self.axes)
        push = NO_THRUST
        if self.needs_thrust:
            if thrust is None:
                raise ValueError(f"thrust must be given for the estimator {self.name}, got None")
            push = as_block(thrust, self.axes)
            if push.shape != stage.shape:
                raise ValueError(f"thrust must be of the shape of stage_position {stage.shape}, got {push.shape}")
        if len(motor) != len(stage):
            raise ValueError(f"stage_position must be of the shape of motor_position {motor.shape}, got {stage.shape}")
        if self.motion is not None and len(stage):
            motor = self.motion.update(motor, push)
        out = np.empty_like(stage)
        residual = np.empty((len(motor), self._scaled.shape[1]))
        buffer = np.empty((2, self.first_valid_sample + len(motor)))
        first, weights, _ = self._alignment
        bad = _kernels.residuals(
            motor, stage, push if self._weighs_thrust else NO_THRUST, self._seen, self._resolution, first, weights,
            self._scaled, self._lag, self._origin, self._held, self._history, buffer, residual,
        )  # fmt: skip
        if bad >= 0:
            reject_non_finite(np.hstack([motor, stage, push] if push.size else [motor, stage]), bad, self._seen)
        start = self._seen == 0
        if self.blends and len(motor):
            blended = np.empty_like(stage)
            _kernels.blend(residual, self._blend, start, self._slow, blended)
            residual = blended
        _kernels.smooth_and_turn(
            residual, start, self.sections, self._steady, self._delays, self._turn, self._idling, out
        )
        self._seen += len(motor)
        return out if np.ndim(stage_position) == 2 else out[:, 0]

    @property
    def first_valid_sample(self) -> int:
        """Index of the first sample whose balance rests on measured samples only; before it the springs alone speak."""
        return self._history.shape[1]

    @property
    def age(self) -> float:
        """Time (s) by which the balances lag: age of the signals and one sample of the kernel."""
        return (self._alignment.age + 1.0) / self.sample_rate_hz

    @property
    def latency(self) -> float:
        """Time (s) by which the force lags: age of the balances, filter at low frequency."""
        return self.age + group_delay(self.sections, self._centre_hz, self.sample_rate_hz)

    def taps(self, signal: int) -> Floats:
        """Return the weights of the last samples of one signal in the load of one axis before the filter, newest first.

        Parameters
        ----------
        signal : int
            Motors first, then stage, then thrust.
        """
        if self.axes != 1 or self.blends or self.motion:
            raise ValueError(f"taps are of one axis without blending or motion, got {self.name} of {self.axes} axes")
        level, slope, curve = self.gains[signal, 0]
        kernel = np.array([slope + curve, level - 2.0 * curve, curve - slope])
        first, weights, _ = self._alignment
        if signal >= len(first):
            return np.zeros(1)
        return np.convolve(np.concatenate([np.zeros(first[signal]), weights[signal]]), kernel)

    def weights(self, frequency_hz: ArrayLike) -> NDArray[np.complex128]:
        """Return the gain from every measured signal to every load, shape (frequencies, axes, signals), (N/m or 1).

        Signals in the order motors, stages, thrusts as sampled; loads of the slides before they are turned into the
        frame of the tool.

        Parameters
        ----------
        frequency_hz : array_like, shape (k,)
            Frequencies (Hz).
        """
        frequency = np.atleast_1d(np.asarray(frequency_hz, dtype=np.float64))
        back = np.exp(-2j * np.pi * frequency / self.sample_rate_hz)
        tap = np.array([0, 1, 2])
        powers = back[:, None] ** tap
        kernel = np.stack([powers[:, 1], powers[:, 0] - powers[:, 2], powers @ [1.0, -2.0, 1.0]], axis=1)
        first, taps, _ = self._alignment
        delay = np.stack(
            [(back[:, None] ** (f + np.arange(w.size))) @ w for f, w in zip(first, taps, strict=True)], axis=1
        )
        lag = np.ones((len(frequency), self.axes), dtype=np.complex128)
        e = self._lag[None, :]
        delay[:, self._positions :] *= np.where(e < 0.0, lag, (1.0 - e) * back[:, None] / (1.0 - e * back[:, None]))[
            :, : delay.shape[1] - self._positions
        ]
        rows = np.einsum("kt,srt,ks->krs", kernel, self.gains[: delay.shape[1]], delay)
        if self.blends:
            e = self._blend[None, :]
            low = 0.5 * (1.0 - e) * (1.0 + back[:, None]) / (1.0 - e * back[:, None])
            rows = rows[:, : self.axes] + low[:, :, None] * rows[:, self.axes :]
        rows = rows * response(self.sections, frequency, self.sample_rate_hz)[:, None, None]
        missing = np.zeros((*rows.shape[:2], self._positions + self.axes - rows.shape[2]))
        found = np.concatenate([rows, missing], axis=2).astype(np.complex128)
        if self.motion is not None:
            low, pushed = self.motion.response(frequency)
            found[:, :, self._positions :] += found[:, :, : self.motors] * pushed[:, None, :]
            found[:, :, : self.motors] *= low[:, None, None]
        return found

    def set_idling(self, force: ArrayLike) -> None:
        """Take a constant force off the estimate from now on.

        Parameters
        ----------
        force : array_like, shape (axes,)
            Mean estimate (N) while the axes idle, in the frame of `update`, counted from zero idling.
        """
        idling = np.atleast_1d(np.asarray(force, dtype=np.float64))
        if idling.shape != (self.axes,) or not np.isfinite(idling).all():
            word = {1: "one finite value", 2: "two finite values"}[self.axes]
            raise ValueError(f"force must be {word}, got {force}")
        self._idling[:] = idling

    def prepare(self) -> None:
        """Compile the kernels; the state stays as it is."""
        before = self.snapshot()
        still = np.zeros((2, self.axes))
        self.reset()
        self.update(np.zeros((2, self.motors)), still, still)
        self.restore(before)

    def reset(self) -> None:
        """Forget every sample; the idling force stays."""
        self._seen = 0
        if self.motion is not None:
            self.motion.reset()

    def snapshot(self) -> ObserverState:
        """Return a copy of the whole state."""
        return ObserverState(
            seen=self._seen,
            origin=self._origin.copy(),
            held=self._held.copy(),
            motion=() if self.motion is None else self.motion.snapshot(),
            history=self._history.copy(),
            slow=self._slow.copy(),
            delays=self._delays.copy(),
            idling=self._idling.copy(),
        )

    def restore(self, state: ObserverState) -> None:
        """Continue from a copy of the state.

        Parameters
        ----------
        state : ObserverState
            What `snapshot` of an observer of the same kind, drives and rate returned.
        """
        if state.history.shape != self._history.shape or state.delays.shape != self._delays.shape:
            raise ValueError(f"state must be of history {self._history.shape}, got {state.history.shape}")
        self._seen = state.seen
        self._origin[:], self._held[:], self._history[:] = state.origin, state.held, state.history
        if self.motion is not None:
            self.motion.restore(state.motion)
        self._slow[:], self._delays[:], self._idling[:] = state.slow, state.delays, state.idling
