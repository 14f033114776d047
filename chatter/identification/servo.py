"""Mass and friction of a feed axis from what its servo recorded: position and thrust.

The inverse model, thrust = M a + F_v v + F_c sign(v) + offset, is linear in its parameters. Velocity and acceleration
come from the position by a low-pass without phase and central differences; the thrust goes through the same low-pass
(Janot, Gautier, Brunot, Data Set and Reference Models of EMPS, 2019, eqs. (1) to (6)). The edge of the low-pass is the
one that determines the mass best while the counts of the encoder weigh nothing in the acceleration: noise in it would
make the mass too small.

A position that is late beside the thrust (dead times, current loop) adds F_v times the delay to the mass. The delay
that fits best is taken where the record tells it; where it does not and would matter, that is said.
"""

from dataclasses import dataclass, replace
from math import inf, isfinite, nan
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import shift
from scipy.optimize import minimize_scalar
from scipy.signal import butter, sosfiltfilt

from chatter.identification.jackknife import Fit, fitted

Floats = NDArray[np.float64]

ORDER = 4
CANDIDATES = 10
LEAST_SAMPLES = 200
STILL = 0.01
"""Part of the largest speed below which an axis counts as standing: its friction is then not known."""
NOISE_SHARE = 0.005
"""Part of the variance of the acceleration that may be noise of the encoder."""
_NOISE_INTEGRAL = 0.1594
"""Integral of x^4/(1 + x^8)^2: what the low-pass, passed twice, leaves of white noise differentiated twice."""
MOST_LATE, TELLS = 5e-3, 0.97
"""Longest delay that is looked for (s), and the part of the error that the best one may leave to be believed."""
_CLEAN_DIFFERENCE = 6
_UNKNOWN, _POOR = 0.5, 0.1
"""Standard deviation over value from which a parameter counts as unknown, and as poorly known."""
_DELAY_MATTERS = 0.01
_ONE_WAY = 0.02
_ONE_SPEED = 0.1
_STEADY = 0.02


@dataclass(frozen=True, slots=True, kw_only=True)
class Friction:
    """Friction of one direction.

    Parameters
    ----------
    viscous, coulomb : float
        (N s/m) and (N), NaN where the record does not tell.
    viscous_std, coulomb_std : float
        Their standard deviations.
    """

    viscous: float
    coulomb: float
    viscous_std: float
    coulomb_std: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Series:
    """What the fit saw, sample by sample.

    Parameters
    ----------
    time, velocity : ndarray, shape (n,)
        (s) and (m/s).
    friction : ndarray, shape (n,)
        Thrust less inertia (N).
    left : ndarray, shape (n,)
        What is left of the thrust with friction of each direction (N).
    """

    time: Floats
    velocity: Floats
    friction: Floats
    left: Floats


@dataclass(frozen=True, slots=True, kw_only=True)
class ServoFit:
    """What a record tells of an axis; NaN is what it does not tell.

    Parameters
    ----------
    mass, viscous, coulomb, offset : float
        (kg), (N s/m), (N), (N).
    std, half_width : tuple of float
        Standard deviations of these four, and half of their intervals of 95 %.
    relative_error : float
        Of the thrust.
    forward, backward : Friction
        Each direction with friction of its own.
    asymmetric_error : float
        Relative error of the thrust with these.
    steady_std, steady_peak : float
        What is left of the thrust at constant speed (N), standard deviation and largest; NaN without constant speed.
    cutoff_hz : float
        Edge of the low-pass (Hz).
    dead_time : float
        By which the position is late beside the thrust (s): given, found, or 0 where the record does not tell.
    series : Series
        Where the axis moves.
    flags : tuple of str
        What is poorly known, and why.
    """

    mass: float
    viscous: float
    coulomb: float
    offset: float
    std: tuple[float, float, float, float]
    half_width: tuple[float, float, float, float]
    relative_error: float
    forward: Friction
    backward: Friction
    asymmetric_error: float
    steady_std: float
    steady_peak: float
    cutoff_hz: float
    dead_time: float
    series: Series
    flags: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class _Motion:
    """Filtered motion and thrust, and which samples count."""

    time: Floats
    velocity: Floats
    acceleration: Floats
    thrust: Floats
    kept: NDArray[np.bool_]
    noise_share: float
    cutoff_hz: float
    late: float

    def every(self, step: int) -> NDArray[np.bool_]:
        return self.kept & (np.arange(self.kept.size) % step == 0)


def identify_servo(
    position: ArrayLike, thrust: ArrayLike, sample_rate_hz: float, *, cutoff_hz: float | None = None,
    dead_time: float | None = None,
) -> ServoFit:  # fmt: skip
    """Return mass and friction of an axis on which nothing pushes.

    Parameters
    ----------
    position : array_like, shape (n,)
        Measured (m); NaN where samples are missing.
    thrust : array_like, shape (n,)
        Commanded or measured (N), positive in the direction of the position.
    sample_rate_hz : float
        Sampling rate (Hz).
    cutoff_hz : float or None
        Edge of the low-pass (Hz); None for the one that determines the mass best.
    dead_time : float or None
        By which the position is late beside the thrust (s); None to find it.
    """
    x, u = (np.asarray(values, dtype=np.float64) for values in (position, thrust))
    if x.shape != u.shape or x.ndim != 1:
        raise ValueError(f"thrust must be of the shape of position {x.shape}, got {u.shape}")
    if not (isfinite(sample_rate_hz) and sample_rate_hz > 0.0):
        raise ValueError(f"sample_rate_hz must be positive and finite, got {sample_rate_hz}")
    if cutoff_hz is not None and not 0.0 < cutoff_hz < 0.45 * sample_rate_hz:
        raise ValueError(f"cutoff_hz must be in (0, {0.45 * sample_rate_hz:g}), got {cutoff_hz}")
    pieces = [piece for piece in stretches(np.isfinite(x) & np.isfinite(u)) if piece.stop - piece.start >= 64]
    if sum(piece.stop - piece.start for piece in pieces) < LEAST_SAMPLES:
        raise ValueError(f"position must have at least {LEAST_SAMPLES} samples in a row with thrust, got {x.size}")
    if float(np.ptp(x[np.isfinite(x)])) == 0.0:
        raise ValueError(f"position must move, got {x[np.isfinite(x)][0]:g} m all the time")
    if dead_time is not None and not 0.0 <= dead_time <= 0.05:
        raise ValueError(f"dead_time must be in [0, 0.05] s, got {dead_time}")
    cutoff = _chosen(x, u, pieces, sample_rate_hz).cutoff_hz if cutoff_hz is None else cutoff_hz
    motion = _motion(x, u, pieces, sample_rate_hz, cutoff, dead_time or 0.0)
    if dead_time is None:
        motion = _in_time(motion, x, u, pieces, sample_rate_hz)
    return _judged(motion, _fit(motion, sample_rate_hz), sample_rate_hz)


def stretches(good: NDArray[np.bool_]) -> list[slice]:
    """Return where samples are good without a break.

    Parameters
    ----------
    good : ndarray of bool, shape (n,)
        Which samples are.
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[False], good, [False]]).astype(np.int8)))
    return [slice(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def motion_noise(position: ArrayLike) -> float:
    """Return the standard deviation of white noise in a smooth position (m), counts among it.

    A sixth difference leaves nothing of the motion and 924 times the variance of the noise.

    Parameters
    ----------
    position : array_like, shape (n,)
        Measured (m).
    """
    left = np.diff(np.asarray(position, dtype=np.float64), _CLEAN_DIFFERENCE)
    return float(1.4826 * np.median(np.abs(left)) / np.sqrt(924.0)) if left.size else 0.0


def _in_time(motion: _Motion, x: Floats, u: Floats, pieces: list[slice], rate: float) -> _Motion:
    """Return the motion with the thrust as late as the position, if the record tells how late that is."""

    def left(late: float) -> float:
        moved = _motion(x, u, pieces, rate, motion.cutoff_hz, late)
        return _fit(moved, rate).relative_error if moved.kept.any() else inf

    if not motion.kept.any():
        return motion
    found: Any = minimize_scalar(left, bounds=(0.0, MOST_LATE), method="bounded", options={"xatol": 1e-5})
    if found.fun > TELLS * left(0.0) or found.x > 0.95 * MOST_LATE:
        return motion
    return _motion(x, u, pieces, rate, motion.cutoff_hz, float(found.x))


def _motion(x: Floats, u: Floats, pieces: list[slice], rate: float, cutoff: float, late: float = 0.0) -> _Motion:
    """Return velocity, acceleration and thrust, delayed, through one low-pass, stretch by stretch."""
    sections = butter(ORDER, cutoff, fs=rate, output="sos")
    edge = int(np.ceil(2.0 * rate / cutoff + late * rate))
    columns: list[tuple[Floats, ...]] = []
    for piece in pieces:
        if piece.stop - piece.start <= 4 * edge:
            continue
        low = sosfiltfilt(sections, x[piece] - x[piece][0])
        speed = np.gradient(low) * rate
        inner = slice(edge, -edge)
        when = np.arange(piece.start, piece.stop)[inner] / rate
        force = sosfiltfilt(sections, u[piece])
        force = shift(force, late * rate, mode="nearest") if late else force
        columns.append((when, speed[inner], (np.gradient(speed) * rate)[inner], force[inner]))
    if not columns:
        nothing = np.zeros(0)
        return _Motion(nothing, nothing, nothing, nothing, np.zeros(0, dtype=np.bool_), inf, cutoff, late)
    time, velocity, acceleration, thrust = (np.concatenate(parts) for parts in zip(*columns, strict=True))
    noise = max(motion_noise(x[piece]) for piece in pieces)
    of_speed = noise * np.sqrt(2.0 / rate * (2.0 * np.pi) ** 2 * cutoff**3 / 3.0)
    of_acceleration = noise**2 * 2.0 / rate * (2.0 * np.pi) ** 4 * cutoff**5 * _NOISE_INTEGRAL
    still = max(STILL * float(np.abs(velocity).max()), 4.0 * of_speed)
    share = of_acceleration / max(float(np.var(acceleration)), 1e-300)
    return _Motion(time, velocity, acceleration, thrust, np.abs(velocity) > still, share, cutoff, late)


def _chosen(x: Floats, u: Floats, pieces: list[slice], rate: float) -> _Motion:
    """Return the motion through the low-pass that determines the mass best."""
    longest = max(piece.stop - piece.start for piece in pieces)
    lowest = min(max(rate / 400.0, 40.0 * rate / longest), rate / 10.0)
    found: list[tuple[float, float, _Motion]] = []
    for cutoff in np.geomspace(lowest, rate / 5.0, CANDIDATES):
        motion = _motion(x, u, pieces, rate, float(cutoff))
        if np.count_nonzero(motion.every(_step(motion, rate))) < 2 * LEAST_SAMPLES // 10:
            continue
        fit = _fit(motion, rate)
        found.append((fit.std[0] / abs(fit.value[0]) if fit.value[0] else inf, motion.noise_share, motion))
    if not found:
        raise ValueError(f"position must move in most of its samples, got {x.size} samples that hardly do")
    clean = [one for one in found if one[1] <= NOISE_SHARE] or [min(found, key=lambda one: one[1])]
    return min(clean, key=lambda one: one[0] if isfinite(one[0]) else inf)[2]


def _step(motion: _Motion, rate: float) -> int:
    """Return how many samples one that is new stands for."""
    return max(1, int(rate / (2.5 * motion.cutoff_hz)))


def _fit(motion: _Motion, rate: float) -> Fit:
    kept = motion.every(_step(motion, rate))
    v, a = motion.velocity[kept], motion.acceleration[kept]
    return fitted(np.column_stack([a, v, np.sign(v), np.ones_like(v)]), motion.thrust[kept])


def _judged(motion: _Motion, fit: Fit, rate: float) -> ServoFit:
    kept = motion.every(_step(motion, rate))
    v, a, u = motion.velocity[kept], motion.acceleration[kept], motion.thrust[kept]
    up = (v > 0.0).astype(np.float64)
    both = fitted(np.column_stack([a, v * up, up, v * (1.0 - up), up - 1.0]), u)
    forward, backward = (
        Friction(viscous=both.value[k], coulomb=both.value[k + 1], viscous_std=both.std[k], coulomb_std=both.std[k + 1])
        for k in (1, 3)
    )
    model = np.column_stack([a, v * up, up, v * (1.0 - up), up - 1.0]) @ np.nan_to_num(both.value)
    series = Series(time=motion.time[kept], velocity=v, friction=u - np.nan_to_num(fit.value[0]) * a, left=u - model)
    steady = _left_at_constant_speed(motion, both)
    made = ServoFit(
        mass=fit.value[0], viscous=fit.value[1], coulomb=fit.value[2], offset=fit.value[3],
        std=_four(fit.std), half_width=_four(fit.half_width), relative_error=fit.relative_error,
        forward=forward, backward=backward, asymmetric_error=both.relative_error,
        steady_std=steady[0], steady_peak=steady[1], cutoff_hz=motion.cutoff_hz, dead_time=motion.late, series=series,
    )  # fmt: skip
    return _flagged(made, motion, v)


def _four(values: Floats) -> tuple[float, float, float, float]:
    first, second, third, fourth = (float(value) for value in values)
    return first, second, third, fourth


def _left_at_constant_speed(motion: _Motion, both: Fit) -> tuple[float, float]:
    """Return standard deviation and size of the thrust that the model leaves where the speed is constant (N)."""
    v, a = motion.velocity, motion.acceleration
    still = motion.kept & (np.abs(a) < _STEADY * float(np.abs(a).max()))
    if np.count_nonzero(still) < LEAST_SAMPLES:
        return nan, nan
    up = (v > 0.0).astype(np.float64)
    model = np.column_stack([a, v * up, up, v * (1.0 - up), up - 1.0])[still] @ np.nan_to_num(both.value)
    left = motion.thrust[still] - model
    return float(np.std(left)), float(np.abs(left).max())


def _flagged(made: ServoFit, motion: _Motion, v: Floats) -> ServoFit:
    """Put NaN for what the record does not determine, and say why."""
    flags: list[str] = []
    ahead = float((v > 0.0).mean())
    if min(ahead, 1.0 - ahead) < _ONE_WAY:
        flags.append("the axis moves one way only: Coulomb friction and offset cannot be told apart")
        made = replace(made, coulomb=nan, offset=nan)
    spread = [float(np.std(part) / np.abs(part).mean()) for part in (v[v > 0], v[v < 0]) if part.size > 1]
    if max(spread, default=0.0) < _ONE_SPEED:
        flags.append("the axis moves at one speed only: viscous and Coulomb friction cannot be told apart")
        made = replace(made, viscous=nan)
    for k, name in enumerate(("mass", "viscous", "coulomb")):
        value, std = getattr(made, name), made.std[k]
        if not isfinite(value):
            continue
        share = std / abs(value) if value else inf
        if share > _UNKNOWN:
            flags.append(f"{name} is not determined: {value:.4g} +- {std:.2g}")
            made = replace(made, **{name: nan})
        elif value < 0.0:
            flags.append(f"{name} is negative: thrust and position point opposite ways, or the channels are swapped")
        elif share > _POOR:
            flags.append(f"{name} is poorly determined: {100.0 * share:.0f} % standard deviation")
    per_ms = 1e-3 * abs(made.viscous) / abs(made.mass) if made.mass and isfinite(made.mass * made.viscous) else 0.0
    if motion.late == 0.0 and per_ms > _DELAY_MATTERS:
        flags.append(f"a dead time is not seen; each ms of it makes the mass {100.0 * per_ms:.0f} % too large")
    if motion.noise_share > NOISE_SHARE:
        share = 100.0 * motion.noise_share
        flags.append(f"noise makes {share:.2g} % of the acceleration: the mass comes out too small")
    if made.relative_error > 0.3:
        left = f"{100.0 * made.relative_error:.0f} % of the thrust"
        flags.append(f"the model leaves {left} unexplained: channels swapped, or something pushes on the axis")
    return replace(made, flags=tuple(flags))
