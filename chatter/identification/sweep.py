"""A drive from a swept sine: inertias, dampings, stiffness and the sums of dead times that a sweep can tell.

The sweep repeats; it rides on a constant feed, so that friction keeps its sign, and the position loop is open. The
response is the mean of the outputs over the mean of the thrust, over whole periods: in a closed loop a cross spectrum
would be biased by what the loop feeds back. The thrust is held between the samples, and so is that of the model:

    X[k]/U[k] = sum_m G(j w_m) (1 - exp(-j w_m T))/(j w_m T),   w_m = w + 2 pi m/T

with G from stage_model (Yamada, PhD thesis, Keio University, 2017, eq. (2-4) as corrected). Only T_s + T_m and
T_s + T_t show in it.
"""

from dataclasses import dataclass
from math import inf, isfinite
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import least_squares

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

ALIASES = 2
NAMES = ("rotor_mass", "stage_mass", "rotor_viscosity", "stage_damping", "screw_damping", "screw_stiffness",
         "motor_dead_time", "stage_dead_time")  # fmt: skip
"""M_r, M_t (kg), C_r, C_t, C_k (N s/m), K (N/m), T_s + T_m, T_s + T_t (s)."""
_BANDS = (0.1, 0.3, 0.6, 1.0)
_RATIOS, _DAMPINGS = (0.05, 0.15, 0.5, 1.5), (0.02, 0.2)
_LINES, _SLOW, _DRAG = 150, 30.0, 1e3
_LEAST_STD = 1e-4
_MOST_STD = 0.3
_PERIODS = 2
_CLEANINGS, _OUTLIER, _SCALE = 2, 8.0, 3e-3


@dataclass(frozen=True, slots=True, kw_only=True)
class SweepFrf:
    """Responses of both encoders to the thrust.

    Parameters
    ----------
    frequency_hz : ndarray, shape (lines,)
        (Hz)
    response : ndarray, shape (2, lines)
        Motor and stage (m/N).
    std : ndarray, shape (2, lines)
        Of the mean over the periods, relative.
    sample_rate_hz : float
        Of the servo (Hz).
    """

    frequency_hz: Floats
    response: Complexes
    std: Floats
    sample_rate_hz: float


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveFit:
    """Parameters of a drive.

    Parameters
    ----------
    value, std : dict of str to float
        By `NAMES`.
    resonance_hz, damping_ratio : float
        Of the axis free at both ends, undamped (Hz), and its damping ratio.
    relative_error : float
        Root mean square of the relative error of the responses.
    flags : tuple of str
        What is poorly known.
    """

    value: dict[str, float]
    std: dict[str, float]
    resonance_hz: float
    damping_ratio: float
    relative_error: float
    flags: tuple[str, ...] = ()


def sweep_frf(
    thrust: ArrayLike, motor: ArrayLike, stage: ArrayLike, sample_rate_hz: float, period: int,
    band_hz: tuple[float, float],
) -> SweepFrf:  # fmt: skip
    """Return the responses over whole periods of a sweep.

    Parameters
    ----------
    thrust : array_like, shape (n,)
        Commanded (N), from where the axis has settled into the sweep.
    motor, stage : array_like, shape (n,)
        Measured positions (m).
    sample_rate_hz : float
        Sampling rate (Hz).
    period : int
        Samples in a period of the sweep.
    band_hz : (float, float)
        Of the sweep (Hz).
    """
    u, *positions = (np.asarray(values, dtype=np.float64) for values in (thrust, motor, stage))
    periods = (u.size - 1) // period
    if periods < _PERIODS or any(x.shape != u.shape for x in positions):
        raise ValueError(f"thrust must be {_PERIODS} periods of {period} samples with both positions, got {u.size}")
    whole = slice(0, periods * period)
    ramps = [_level(x, period, periods) for x in positions]
    spectra = [np.fft.rfft(x[whole].reshape(periods, period), axis=1) for x in (u, *ramps)]
    hz = np.arange(spectra[0].shape[1]) * sample_rate_hz / period
    inside = (hz >= max(band_hz[0], 0.5 * hz[1])) & (hz <= min(band_hz[1], 0.45 * sample_rate_hz))
    into, *out = (found[:, inside] for found in spectra)
    mean = into.mean(axis=0)
    response = np.array([y.mean(axis=0) / mean for y in out])
    left = [(y - h * into) / (h * mean) for y, h in zip(out, response, strict=True)]
    std = np.sqrt(np.array([(np.abs(e) ** 2).sum(axis=0) for e in left]) / (periods * max(periods - 1, 1)))
    return SweepFrf(frequency_hz=hz[inside], response=response, std=std, sample_rate_hz=float(sample_rate_hz))


def _level(x: Floats, period: int, periods: int) -> Floats:
    """Return a position without the feed: every period ends where it began."""
    starts = x[: periods * period + 1 : period]
    travel = np.diff(starts)
    along = np.arange(period) / period
    out = x[: periods * period].reshape(periods, period) - starts[:-1, None] - travel[:, None] * along
    return out.ravel()


def drive_response(
    value: dict[str, float], frequency_hz: Floats, sample_rate_hz: float, omega_current: float
) -> Complexes:
    """Return motor and stage over a thrust that is held between the samples (m/N), shape (2, lines).

    Parameters
    ----------
    value : dict of str to float
        By `NAMES`.
    frequency_hz : ndarray, shape (lines,)
        (Hz)
    sample_rate_hz : float
        Of the servo (Hz).
    omega_current : float
        Bandwidth of the current loop (rad/s), infinite for none.
    """
    return _response(np.array([value[name] for name in NAMES]), frequency_hz, sample_rate_hz, omega_current)


def _response(p: Floats, hz: Floats, rate: float, omega_current: float, folds: int = ALIASES) -> Complexes:
    m_r, m_t, c_r, c_t, c_k, k, late_motor, late_stage = p
    total = np.zeros((2, hz.size), dtype=np.complex128)
    for fold in range(-folds, folds + 1):
        s = 2j * np.pi * (hz + fold * rate)
        a_r, a_t, b = (m_r * s + c_r) * s, (m_t * s + c_t) * s, c_k * s + k
        lag = 1.0 if omega_current == inf else omega_current / (s + omega_current)
        held = (1.0 - np.exp(-s / rate)) / (s / rate) * lag / (a_r * a_t + b * (a_r + a_t))
        total[0] += held * (a_t + b) * np.exp(-s * late_motor)
        total[1] += held * b * np.exp(-s * late_stage)
    return total


def drive_of_sweep(frf: SweepFrf, omega_current: float = inf) -> DriveFit:
    """Return the parameters of a drive whose responses were measured.

    Least squares of the logarithm, size and phase; the band widens step by step, so that the phase of a dead time is
    never a turn away. Lines that stand out at the end are left out: a ripple whose wavelength the feed covers a whole
    number of times in a period lies on them in every period alike.

    Parameters
    ----------
    frf : SweepFrf
        From `sweep_frf`.
    omega_current : float
        Bandwidth of the current loop (rad/s), which a dead time can stand for in part; infinite for none.
    """
    if not omega_current > 0.0:
        raise ValueError(f"omega_current must be positive, got {omega_current}")
    hz, known = frf.frequency_hz, frf.std <= _MOST_STD
    if np.count_nonzero(known.all(axis=0)) < 5 * len(NAMES):
        raise ValueError(f"frf must have {5 * len(NAMES)} lines above the noise, got {known.all(axis=0).sum()}")

    def residual(x: Floats, inside: NDArray[np.bool_], weight: Floats, folds: int) -> Floats:
        model = _response(_unpacked(x), hz[inside], frf.sample_rate_hz, omega_current, folds)
        off = np.log(model / frf.response[:, inside]) * weight[:, inside]
        return np.concatenate([off.real.ravel(), off.imag.ravel()])

    def fit(x: Floats, inside: NDArray[np.bool_], weight: Floats, loss: str = "soft_l1", folds: int = 0) -> Any:
        return least_squares(
            residual, x, args=(inside, weight, folds), x_scale="jac", max_nfev=50, loss=loss, f_scale=_SCALE
        )

    everything, even = np.ones(hz.size, dtype=np.bool_), known.astype(np.float64)
    some = np.arange(hz.size) % max(1, hz.size // _LINES) == 0
    found: list[Any] = []
    for ratio, damping in ((ratio, damping) for ratio in _RATIOS for damping in _DAMPINGS):
        x = _start(frf, ratio, damping)
        for share in _BANDS:
            x = fit(x, some & (hz <= hz[0] + share * (hz[-1] - hz[0])), even).x
        found.append(fit(x, some, even))
    best = min(found, key=lambda made: made.cost)
    weight = even / np.clip(frf.std, _LEAST_STD, None)
    for _ in range(_CLEANINGS):
        off = np.abs(np.log(_response(_unpacked(best.x), hz, frf.sample_rate_hz, omega_current) / frf.response))
        weight[off > _OUTLIER * np.maximum(np.median(off, axis=1, keepdims=True), frf.std)] = 0.0
        scaled = weight / float(np.sqrt(np.mean(weight[weight > 0.0] ** 2)))
        best = fit(best.x, everything, scaled, "linear", ALIASES)
    return _told(frf, best, omega_current)


def _unpacked(x: Floats) -> Floats:
    m_r, m_t, k = np.exp(np.clip(x[[0, 1, 5]], -30.0, 60.0))
    return np.array([m_r, m_t, *(_DRAG * x[2:5]), k, *(1e-3 * x[6:])])


def _start(frf: SweepFrf, ratio: float, damping: float) -> Floats:
    """Return a start: all inertia from the slow lines, stiffness from where the encoders part."""
    hz, motor, stage = frf.frequency_hz, *frf.response
    slow = slice(0, max(4, hz.size // 50))
    mass = float(np.median(1.0 / (np.abs(motor[slow]) * (2.0 * np.pi * hz[slow]) ** 2)))
    turn = hz[int(np.argmax(np.abs(stage / motor)))]
    m_t = mass * ratio / (1.0 + ratio)
    k = m_t * (2.0 * np.pi * turn) ** 2
    spring = damping * np.sqrt(k * m_t)
    drags = np.array([mass * _SLOW, spring, spring]) / _DRAG
    return np.array([np.log(mass - m_t), np.log(m_t), *drags, np.log(k), 0.3, 0.3])


def _told(frf: SweepFrf, made: Any, omega_current: float) -> DriveFit:
    x, jacobian, left = (np.asarray(made[name], dtype=np.float64) for name in ("x", "jac", "fun"))
    p = _unpacked(x)
    spread = np.linalg.pinv(jacobian.T @ jacobian).diagonal() * float(left @ left) / max(left.size - x.size, 1)
    unit = np.array([p[0], p[1], _DRAG, _DRAG, _DRAG, p[5], 1e-3, 1e-3])
    std = np.sqrt(np.maximum(spread, 0.0)) * unit
    relative = std[:6] / np.maximum(np.abs(p[:6]), 1e-300)
    m_r, m_t, c_r, c_t, c_k, k = p[:6]
    alpha = m_t / m_r
    omega = np.sqrt((1.0 + alpha) * k / m_t)
    damping = (c_t + alpha**2 * c_r + (1.0 + alpha) ** 2 * c_k) / (2.0 * m_t * (1.0 + alpha) * omega)
    error = _response(p, frf.frequency_hz, frf.sample_rate_hz, omega_current) / frf.response - 1.0
    flags = [
        f"{name} is poorly determined: {100.0 * r:.0f} % standard deviation"
        for name, r in zip(NAMES[:6], relative, strict=True)
        if not isfinite(r) or r > 0.1
    ]
    if omega / (2.0 * np.pi) > frf.frequency_hz[-1]:
        flags.append("the resonance lies above the sweep: stiffness and the split of the mass rest on little")
    return DriveFit(
        value=dict(zip(NAMES, map(float, p), strict=True)), std=dict(zip(NAMES, map(float, std), strict=True)),
        resonance_hz=float(omega / (2.0 * np.pi)), damping_ratio=float(damping),
        relative_error=float(np.sqrt(np.mean(np.abs(error) ** 2))), flags=tuple(flags),
    )  # fmt: skip
