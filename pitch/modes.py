"""Characteristic roots of the process of unequal pitch with several modes of the bar, in any directions.

The bar moves by q in the plane of X1 and Y1'. Tool i has the radial direction e_i, the direction w_i of the surface
motion, and the delay tau_i from the other tool's cut to its own; tool 1 has gone round the bar by h:

    e_1 = (cos h, sin h), w_1 = (-sin h, cos h), e_2 = (-1, 0), w_2 = (0, -1),
    tau_1 = (pi + h)/Omega, tau_2 = (pi - h)/Omega,
    F_i = -K_i e_i (e_i . q - mu e_j . q(t - tau_i)) - Kt_i w_i (e_i . q - mu_t e_j . q(t - tau_i)) - cp e_i (e_i . q')

A mode moves the bar by r in one direction d: q = sum d r, and m (r'' + 2 zeta w r' + w^2 r) = d . F.
"""

import math
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pitch._checks import finite, positive, whole, within
from pitch.collocation import delay_eigenvalues
from pitch.polish import distinct, polished
from pitch.stability import StabilityUnresolved

_MAX_STATES = 2000  # eigenvalues of 2000 x 2000 take several seconds; beyond, refuse


@dataclass(frozen=True, slots=True, kw_only=True)
class Mode:
    """One bending mode, with the displacement of the bar at the tools as its coordinate.

    Attributes
    ----------
    modal_mass : float
        At the tools (kg).
    natural_frequency_hz : float
        Undamped (Hz).
    damping_ratio : float
        Of the structure (-), in (0, 1).
    direction : float
        In which the bar moves (rad), from tool 1's radius at equal pitch towards the surface motion there.
    """

    modal_mass: float
    natural_frequency_hz: float
    damping_ratio: float
    direction: float = 0.0

    def __post_init__(self) -> None:
        """Check the ranges."""
        positive("modal_mass", self.modal_mass)
        positive("natural_frequency_hz", self.natural_frequency_hz)
        if not 0.0 < finite("damping_ratio", self.damping_ratio) < 1.0:
            raise ValueError(f"damping_ratio must be in (0, 1), got {self.damping_ratio}")
        finite("direction", self.direction)


@dataclass(frozen=True, slots=True, kw_only=True)
class TurningProcess:
    """Two opposed tools on a bar with several modes.

    Attributes
    ----------
    modes : tuple of Mode
        Of the bar, at least one.
    cutting_stiffness : float
        Radial, of each tool (N/m).
    tangential_stiffness : float
        Rise of the tangential force of each tool with its depth (N/m).
    overlap : float
        Share of the other tool's wave that the radial force of a tool meets again (-), in [-1, 1].
    tangential_overlap : float or None
        The same of the tangential force; None for the one of the radial force.
    process_damping : float
        Of the flank of one tool (N s/m).
    rake_gain : float
        Relative rise of both stiffnesses of tool 1 per radian of its shift.
    tool_turns : bool
        Whether the directions of tool 1 turn with its shift; False keeps those of equal pitch.
    """

    modes: tuple[Mode, ...]
    cutting_stiffness: float
    tangential_stiffness: float = 0.0
    overlap: float = 1.0
    tangential_overlap: float | None = None
    process_damping: float = 0.0
    rake_gain: float = 0.0
    tool_turns: bool = True

    def __post_init__(self) -> None:
        """Check the ranges."""
        if not self.modes:
            raise ValueError(f"modes must be at least one, got {self.modes!r}")
        for name in ("cutting_stiffness", "tangential_stiffness", "process_damping"):
            if finite(name, getattr(self, name)) < 0.0:
                raise ValueError(f"{name} must be >= 0, got {getattr(self, name)}")
        within("overlap", self.overlap, -1.0, 1.0)
        if self.tangential_overlap is not None:
            within("tangential_overlap", self.tangential_overlap, -1.0, 1.0)
        finite("rake_gain", self.rake_gain)


def process_roots(
    process: TurningProcess, spindle_hz: float, pitch_difference: float, count: int = 6
) -> NDArray[np.complex128]:
    """Rightmost characteristic roots, the one that grows fastest first.

    Roots of the collocated generator, each polished by Newton's method on the characteristic determinant.

    Parameters
    ----------
    process : TurningProcess
        Bar and cut.
    spindle_hz : float
        Spindle speed (Hz).
    pitch_difference : float
        Pitch difference (rad), twice the shift of turret 1, in (-2 pi, 2 pi).
    count : int
        How many at most.

    Returns
    -------
    ndarray
        Growth rate (1/s) and angular frequency (rad/s) >= 0 of each, shape (n,), n <= count.
    """
    whole("count", count, 1)
    equation = delay_equation(process, spindle_hz, pitch_difference)
    longest = float(equation.delays.max())
    f_max = 1.5 * math.sqrt(equation.strength()) / (2 * math.pi)
    nodes = math.ceil(math.pi * f_max * longest) + 40
    present, delayed, read = equation.state_space()
    if len(present) + read * nodes > _MAX_STATES:
        size = f"{f_max * longest:.0f} waves in one delay need {len(present) + read * nodes} states"
        raise StabilityUnresolved(f"{size}, at most {_MAX_STATES}")
    rough = delay_eigenvalues(present, delayed, nodes)
    rough = rough[(rough.imag >= 0.0) & (rough.imag <= 2 * math.pi * f_max)]
    rough = rough[np.argsort(-rough.real)][: 4 * count + 8]
    return distinct(polished(partial(determinant, equation), rough, float(equation.delays.mean()), longest))[:count]


class DelayEquation(NamedTuple):
    """r'' + C r' + W r + sum_i now_i (see_i . r) - late_i (see_j . r(t - tau_i)) = 0, per unit of modal mass.

    Shapes: `damping` and `spring` (n, n); `see`, `now`, `late` (2, n), one row for each tool; `delays` (2,), s.
    """

    damping: NDArray[np.float64]
    spring: NDArray[np.float64]
    see: NDArray[np.float64]
    now: NDArray[np.float64]
    late: NDArray[np.float64]
    delays: NDArray[np.float64]

    def strength(self) -> float:
        """Return a bound on the square of any angular frequency that spring and cut can give (rad2/s2)."""
        see, now, late = (np.linalg.norm(rows, axis=1) for rows in (self.see, self.now, self.late))
        return float(np.diag(self.spring).max() + now @ see + late @ see[::-1])

    def state_space(self) -> tuple[NDArray[np.float64], list[tuple[NDArray[np.float64], float]], int]:
        """Return the matrices of the present and of each past state, and how many states are read from the past.

        Only what a tool sees is remembered; coordinates along it come first, so the rest has no past.
        """
        n = len(self.spring)
        _, size, turn = np.linalg.svd(self.see)
        read = int(np.count_nonzero(size > 1e-12 * max(size[0], 1e-300)))
        see = self.see @ turn.T
        see[:, read:] = 0.0
        now, late = self.now @ turn.T, self.late @ turn.T
        present = np.zeros((2 * n, 2 * n))
        present[:n, n:] = np.eye(n)
        present[n:, :n] = -turn @ self.spring @ turn.T - now.T @ see
        present[n:, n:] = -turn @ self.damping @ turn.T
        delayed: list[tuple[NDArray[np.float64], float]] = []
        for i in range(2):
            back = np.zeros((2 * n, 2 * n))
            back[n:, :n] = np.outer(late[i], see[1 - i])
            delayed.append((back, float(self.delays[i])))
        return present, delayed, read


def delay_equation(process: TurningProcess, spindle_hz: float, pitch_difference: float) -> DelayEquation:
    """Return the equation of the modes for one spindle speed (Hz) and pitch difference (rad)."""
    omega = 2 * math.pi * positive("spindle_hz", spindle_hz)
    h = finite("pitch_difference", pitch_difference) / 2
    if abs(h) >= math.pi:
        raise ValueError(f"pitch_difference must be in (-2 pi, 2 pi) rad, got {pitch_difference}")
    rise = 1.0 + process.rake_gain * h
    if rise <= 0.0:
        raise ValueError(f"rake_gain must leave tool 1 a force at this shift, got {process.rake_gain}")
    turn = h if process.tool_turns else 0.0
    mass = np.array([mode.modal_mass for mode in process.modes])
    natural = 2 * math.pi * np.array([mode.natural_frequency_hz for mode in process.modes])
    ratio = np.array([mode.damping_ratio for mode in process.modes])
    angle = np.array([mode.direction for mode in process.modes])
    see = _clean(np.array([np.cos(angle - turn), -np.cos(angle)]))
    along = _clean(np.array([np.sin(angle - turn), -np.sin(angle)]))
    raised = np.array([[rise], [1.0]])
    radial, tangential = process.cutting_stiffness, process.tangential_stiffness
    again = process.overlap if process.tangential_overlap is None else process.tangential_overlap
    return DelayEquation(
        damping=np.diag(2 * ratio * natural) + process.process_damping * see.T @ see / mass[:, None],
        spring=np.diag(natural**2),
        see=see,
        now=raised * (radial * see + tangential * along) / mass,
        late=raised * (process.overlap * radial * see + again * tangential * along) / mass,
        delays=np.array([math.pi + h, math.pi - h]) / omega,
    )


def _clean(rows: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return direction cosines without the rounding of right angles, which would make a mode seem to be seen."""
    return np.where(np.abs(rows) < 1e-15, 0.0, rows)


def determinant(
    equation: DelayEquation, s: NDArray[np.complex128]
) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
    """Return the characteristic determinant and its derivative at `s` (1/s), shape (k,) each."""
    n = len(equation.spring)
    at = s[:, None, None]
    value = at**2 * np.eye(n) + at * equation.damping + equation.spring + equation.now.T @ equation.see
    slope = 2 * at * np.eye(n) + equation.damping
    for i in range(2):
        tau, wave = equation.delays[i], np.outer(equation.late[i], equation.see[1 - i])
        value = value - np.exp(-at * tau) * wave
        slope = slope + tau * np.exp(-at * tau) * wave
    total = np.zeros(len(s), dtype=np.complex128)
    for column in range(n):
        changed = value.copy()
        changed[:, :, column] = slope[:, :, column]
        total += np.linalg.det(changed)
    return np.linalg.det(value).astype(np.complex128), total
