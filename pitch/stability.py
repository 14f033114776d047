"""Linear stability of one bar mode between two tools that cut each other's surface.

Characteristic equation (s in 1/s; the sign of mu is that of opposed tools, `overlap` = -1 for tools on one side):

    D(s) = m s^2 + C s + k + 2 K [1 + mu exp(-s pi/Omega) cosh(s h/Omega)] = 0

====== ========================== ======= =======================================================
symbol API name                   unit    equation
====== ========================== ======= =======================================================
m      modal_mass                 kg      at the tools
k      natural_frequency_hz       N/m     m (2 pi f)^2
C      damping_ratio,             N s/m   2 zeta sqrt(k m) + 2 cp
       process_damping (cp)
mu     overlap                    -       share of the other tool's wave met again, -1 ... 1
K      cutting_stiffness          N/m     radial, of each tool
Omega  spindle_hz                 rad/s   2 pi spindle_hz
h      pitch_difference           rad     half of it; the delays are (pi + h)/Omega, (pi - h)/Omega
====== ========================== ======= =======================================================

For overlap -1 and h = 0 this is the classical turning equation of one tool with 2 K at twice the speed.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from pitch._checks import finite, positive, within
from pitch.collocation import delay_eigenvalues
from pitch.polish import distinct, polished

_MAX_NODES = 2000  # eigenvalues of 2000 x 2000 take several seconds; beyond, refuse
_MAX_SAMPLES = 20_000_000
_PER_TURN = 48  # samples of the crossing condition per turn of its fastest phase


class StabilityUnresolved(ArithmeticError):
    """The stability of this process can not be computed with reasonable effort; the message says why."""


@dataclass(frozen=True, slots=True)
class OneModeProcess:
    """One bending mode of the bar, seen by both tools.

    Attributes
    ----------
    modal_mass : float
        At the tools (kg).
    natural_frequency_hz : float
        Undamped (Hz).
    damping_ratio : float
        Of the structure (-), in (0, 1).
    overlap : float
        Share of the other tool's wave that a tool meets again (-), in [-1, 1]; positive for opposed tools.
    process_damping : float
        Damping of the flank of one tool (N s/m).
    """

    modal_mass: float
    natural_frequency_hz: float
    damping_ratio: float
    overlap: float = 1.0
    process_damping: float = 0.0

    def __post_init__(self) -> None:
        """Check the ranges."""
        positive("modal_mass", self.modal_mass)
        positive("natural_frequency_hz", self.natural_frequency_hz)
        if not 0.0 < finite("damping_ratio", self.damping_ratio) < 1.0:
            raise ValueError(f"damping_ratio must be in (0, 1), got {self.damping_ratio}")
        within("overlap", self.overlap, -1.0, 1.0)
        if finite("process_damping", self.process_damping) < 0.0:
            raise ValueError(f"process_damping must be >= 0, got {self.process_damping}")


def critical_stiffness(process: OneModeProcess, spindle_hz: float, pitch_difference: float) -> tuple[float, float]:
    """Smallest cutting stiffness at which stability is lost; islands of stability may follow above it.

    On the border a root is i w. The imaginary part of D(i w) = 0 gives K(w); put into the real part it leaves one
    condition for w, all zeros of which are found in order. Yamada, PhD thesis, Keio University, 2017, chapter 6.

    Parameters
    ----------
    process : OneModeProcess
        Bar and cut.
    spindle_hz : float
        Spindle speed (Hz).
    pitch_difference : float
        Pitch difference (rad), in (-2 pi, 2 pi).

    Returns
    -------
    stiffness : float
        Radial stiffness of one tool (N/m); infinity without regeneration.
    frequency_hz : float
        Frequency of the border (Hz); nan without regeneration.
    """
    p = _symbols(process, spindle_hz, pitch_difference)
    if p.mu == 0.0:
        return math.inf, math.nan
    best, best_w = math.inf, math.nan
    low = math.sqrt(p.k / p.m)
    step = 2 * math.pi / (_PER_TURN * (p.tau_1 + p.tau_2))
    for chunk in _chunks(step):
        w = low + step * np.arange(chunk + 1)
        for zero in _zeros(p, w.astype(np.float64)):
            K = p.C * zero / (2 * p.mu * math.cos(zero * p.h) * math.sin(zero * p.half_turn) or math.nan)
            if 0.0 < K < best:
                best, best_w = K, zero
        low = float(w[-1])
        if max(p.C * low / (2 * abs(p.mu)), (p.m * low**2 - p.k) / (2 * (1 + abs(p.mu)))) > best:
            return best, best_w / (2 * math.pi)
    raise StabilityUnresolved(f"no border found below {low / (2 * math.pi):.4g} Hz at {spindle_hz:g} turns per second")


def rightmost_root(
    process: OneModeProcess, cutting_stiffness: float, spindle_hz: float, pitch_difference: float
) -> complex:
    """Characteristic root with the largest real part: growth rate (1/s) and angular frequency (rad/s) >= 0.

    Parameters
    ----------
    process : OneModeProcess
        Bar and cut.
    cutting_stiffness : float
        Radial stiffness of one tool (N/m).
    spindle_hz : float
        Spindle speed (Hz).
    pitch_difference : float
        Pitch difference (rad).

    Returns
    -------
    complex
        Root (1/s); the cut is stable if its real part is negative.
    """
    found = roots(process, cutting_stiffness, spindle_hz, pitch_difference, count=1)
    if not len(found):
        raise StabilityUnresolved(f"no root settled at {spindle_hz:g} turns per second, K {cutting_stiffness:g} N/m")
    return complex(found[0])


def roots(
    process: OneModeProcess, cutting_stiffness: float, spindle_hz: float, pitch_difference: float, count: int = 6
) -> NDArray[np.complex128]:
    """Rightmost characteristic roots, the one that grows fastest first.

    Roots of the collocated generator, each polished by Newton's method on D(s). At equal pitch neighbours lie two
    spindle frequencies apart and are often nearly as strong.

    Parameters
    ----------
    process : OneModeProcess
        Bar and cut.
    cutting_stiffness : float
        Radial stiffness of one tool (N/m).
    spindle_hz : float
        Spindle speed (Hz).
    pitch_difference : float
        Pitch difference (rad).
    count : int
        How many at most.

    Returns
    -------
    ndarray
        Roots (1/s) with imaginary part >= 0, shape (n,), n <= count.
    """
    p = _symbols(process, spindle_hz, pitch_difference)
    K = finite("cutting_stiffness", cutting_stiffness)
    if K < 0.0:
        raise ValueError(f"cutting_stiffness must be >= 0, got {K}")
    longest = max(p.tau_1, p.tau_2)
    f_max = 1.5 * math.sqrt((p.k + 2 * K * (1 + abs(p.mu))) / p.m) / (2 * math.pi)
    nodes = math.ceil(math.pi * f_max * longest) + 40
    if nodes > _MAX_NODES:
        raise StabilityUnresolved(f"{f_max * longest:.0f} waves in one delay need {nodes} nodes, at most {_MAX_NODES}")
    present = np.array([[0.0, 1.0], [-(p.k + 2 * K) / p.m, -p.C / p.m]])
    back = np.array([[0.0, 0.0], [-K * p.mu / p.m, 0.0]])
    rough = delay_eigenvalues(present, [(back, p.tau_1), (back, p.tau_2)], nodes)
    rough = rough[(rough.imag >= 0.0) & (rough.imag <= 2 * math.pi * f_max)]
    rough = rough[np.argsort(-rough.real)][: 4 * count + 8]
    return distinct(polished(partial(_characteristic, p, K), rough, p.half_turn, longest))[:count]


class _Symbols(NamedTuple):
    m: float
    C: float
    k: float
    mu: float
    half_turn: float  # pi / Omega (s)
    h: float  # h / Omega (s)

    @property
    def tau_1(self) -> float:
        return self.half_turn + self.h

    @property
    def tau_2(self) -> float:
        return self.half_turn - self.h


def _symbols(process: OneModeProcess, spindle_hz: float, pitch_difference: float) -> _Symbols:
    Omega = 2 * math.pi * positive("spindle_hz", spindle_hz)
    h = finite("pitch_difference", pitch_difference) / 2
    if abs(h) >= math.pi:
        raise ValueError(f"pitch_difference must be in (-2 pi, 2 pi) rad, got {pitch_difference}")
    m, w_n = float(process.modal_mass), 2 * math.pi * process.natural_frequency_hz
    C = 2 * process.damping_ratio * m * w_n + 2 * process.process_damping
    return _Symbols(m, C, m * w_n**2, float(process.overlap), math.pi / Omega, h / Omega)


def _chunks(step: float) -> list[int]:
    sizes, total = [], 0
    while total < _MAX_SAMPLES:
        sizes.append(min(max(1024, total), 1_000_000))
        total += sizes[-1]
    return sizes if step > 0.0 else []


def _crossing(p: _Symbols, w: Any) -> Any:
    """Real part of D(i w) after K has been eliminated; zero on the border of stability."""
    c, phase = np.cos(w * p.h), w * p.half_turn
    return (p.k - p.m * w**2) * p.mu * c * np.sin(phase) + p.C * w * (1 + p.mu * c * np.cos(phase))


def _crossing_slope(p: _Symbols, w: Any) -> Any:
    """Return the derivative of `_crossing` with respect to w."""
    c, dc, phase, T = np.cos(w * p.h), -p.h * np.sin(w * p.h), w * p.half_turn, p.half_turn
    stiffness, sine, cosine = p.k - p.m * w**2, np.sin(phase), np.cos(phase)
    return p.mu * (
        -2 * p.m * w * c * sine + stiffness * (dc * sine + c * T * cosine) + p.C * w * (dc * cosine - c * T * sine)
    ) + p.C * (1 + p.mu * c * cosine)


def _zeros(p: _Symbols, w: NDArray[np.float64]) -> list[float]:
    """All zeros of the crossing condition; extrema are added to the grid, so that close pairs are not missed."""
    slope = _crossing_slope(p, w)
    turns = [_bracketed(partial(_crossing_slope, p), w, i) for i in np.flatnonzero(slope[:-1] * slope[1:] < 0)]
    grid = np.sort(np.concatenate((w, turns)))
    value = _crossing(p, grid)
    found = [_bracketed(partial(_crossing, p), grid, i) for i in np.flatnonzero(value[:-1] * value[1:] < 0)]
    return sorted([*found, *grid[value == 0.0].tolist()])


def _bracketed(function: Callable[[float], Any], grid: NDArray[np.float64], i: Any) -> float:
    low, high = float(grid[i]), float(grid[i + 1])
    return float(brentq(function, low, high, xtol=1e-13 * low, rtol=1e-14))  # type: ignore[arg-type]


def _characteristic(
    p: _Symbols, K: float, s: NDArray[np.complex128]
) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
    """D(s) and its derivative."""
    one, two = np.exp(-s * p.tau_1), np.exp(-s * p.tau_2)
    value = p.m * s**2 + p.C * s + p.k + K * (2 + p.mu * (one + two))
    return value, 2 * p.m * s + p.C - K * p.mu * (p.tau_1 * one + p.tau_2 * two)
