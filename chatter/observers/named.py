"""Every estimator by its name, all with one interface."""

from typing import Any, Protocol

from numpy.typing import ArrayLike, NDArray

from chatter.observers.choice import optimal_observer
from chatter.observers.damping import damping_observer
from chatter.observers.family import BLEND_HZ, linear_observer
from chatter.observers.fitted import fitted_observer
from chatter.observers.kalman import HARMONICS, KalmanObserver
from chatter.observers.loop_model import loop_model
from chatter.observers.nominal import NominalFeedDrive
from chatter.observers.prediction import Scene
from chatter.observers.stage_model import NominalControl

NAMES = (
    "thrust", "dob", "medob", "vibration", "load_side", "standing", "blended", "optimal", "fitted", "damping", "kalman",
)  # fmt: skip


class Observer(Protocol):
    """What every estimator of one axis has."""

    name: str
    sample_rate_hz: float
    bandwidth_hz: float
    needs_thrust: bool

    @property
    def latency(self) -> float:
        """Time by which the force lags (s)."""
        ...

    @property
    def first_valid_sample(self) -> int:
        """Index of the first sample that rests on measured samples only."""
        ...

    def update(self, motor_position: Any, stage_position: Any, thrust: ArrayLike | None = None) -> NDArray[Any]:
        """Take a block of signals (m, m, N) and return the force (N), shape (n,)."""
        ...

    def prepare(self) -> None:
        """Compile; the state stays as it is."""
        ...

    def reset(self) -> None:
        """Forget every sample."""
        ...

    def snapshot(self) -> Any:
        """Return a copy of the whole state."""
        ...

    def restore(self, state: Any) -> None:
        """Continue from a copy of the state."""
        ...


def observer(
    name: str,
    drive: NominalFeedDrive,
    sample_rate_hz: float,
    *,
    cutoff_hz: float = 1000.0,
    compensation: str = "full",
    control: NominalControl | None = None,
    scene: Scene | None = None,
    spindle_hz: float | None = None,
    tooth_pass_hz: float | None = None,
    blend_hz: float = BLEND_HZ,
    thrust_noise: float = 1.0,
) -> Observer:
    """Return an estimator of one axis.

    Parameters
    ----------
    name : str
        One of `NAMES`.
    drive : NominalFeedDrive
        Nominal drive.
    sample_rate_hz : float
        Sampling rate (Hz).
    cutoff_hz : float
        Edge of the low-pass (Hz).
    compensation : {"full", "thrust", "none", "raw"}
        See `LinearObserver`.
    control : NominalControl or None
        The position loop; needed by kalman.
    scene : Scene or None
        What the axis will have to do with; needed by optimal.
    spindle_hz : float or None
        Spindle speed (Hz); needed by fitted.
    tooth_pass_hz : float or None
        Frequency of tooth passing (Hz) for kalman; None for a force without lines.
    blend_hz : float
        Edge of blended (Hz).
    thrust_noise : float
        Thrust that no force explains (N), for kalman.
    """
    if name not in NAMES:
        raise ValueError(f"name must be one of {', '.join(NAMES)}, got {name!r}")
    if name == "optimal":
        known = _given("scene", scene, name)
        return optimal_observer(drive, sample_rate_hz, known, cutoff_hz=cutoff_hz, compensation=compensation)
    if name == "fitted":
        speed = _given("spindle_hz", spindle_hz, name)
        return fitted_observer(drive, sample_rate_hz, spindle_hz=speed, cutoff_hz=cutoff_hz, compensation=compensation)
    if name == "damping":
        return damping_observer(drive, sample_rate_hz)
    if name == "kalman":
        model = loop_model(drive, _given("control", control, name))
        lines = [] if tooth_pass_hz is None else [h * tooth_pass_hz for h in HARMONICS]
        return KalmanObserver(model, sample_rate_hz, lines_hz=lines, noise=thrust_noise)
    return linear_observer(
        name, drive, sample_rate_hz, cutoff_hz=cutoff_hz, compensation=compensation, blend_hz=blend_hz
    )


def _given(field: str, value: Any, name: str) -> Any:
    if value is None:
        raise ValueError(f"{field} must be given for the estimator {name}, got None")
    return value
