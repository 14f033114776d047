"""Other ways to solve the linear two-delay equation: Runge-Kutta, jitcdde, and DOP853 by the method of steps."""

from __future__ import annotations

import contextlib
import importlib
import importlib.util
import math
import shutil
import sys
from collections.abc import Callable, Generator
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from services.bench import _peer_kernels as kernels
from services.messages import Floats
from turning_sim import DelayEquation
from turning_sim.delay_growth import fitted


def numbers(
    equation: DelayEquation, rate: float, *, cut: float = 1.0, flank: float = 0.0, limit: float = math.inf
) -> kernels.Peer:
    """Return what the compiled peers need of an equation at a rate (Hz)."""
    e = equation
    return kernels.Peer(
        m=e.modal_mass, c=e.damping, k=e.stiffness, cp=e.process_damping, K=e.cutting_stiffness, mu=e.overlap,
        tau1=e.delay_1 * rate, tau2=e.delay_2 * rate, h=1.0 / rate, h0=cut, flank=flank, limit=limit,
    )  # fmt: skip


def history(equation: DelayEquation, rate: float, root: complex, size: float = 1.0) -> Floats:
    """Return the eigenfunction of a root at the samples up to time 0 that a cubic reads."""
    count = math.ceil(max(equation.delay_1, equation.delay_2) * rate) + 4
    return size * np.real(np.exp(root * np.arange(1 - count, 1) / rate))


def runge_kutta(equation: DelayEquation, rate: float, root: complex, seconds: float) -> Floats:
    """Return the displacement at every step from the eigenfunction on."""
    before = history(equation, rate, root)
    x = np.concatenate([before, np.empty(round(seconds * rate))])
    kernels.linear(numbers(equation, rate), x, before.size, root.real)
    return x[before.size :]


def remembering(
    equation: DelayEquation, rate: float, root: complex, size: float, seconds: float, **nonlinear: float
) -> Floats:
    """Return the displacement at every step, contact lost and found, from the eigenfunction on."""
    before = history(equation, rate, root, size)
    x = np.concatenate([before, np.empty(round(seconds * rate))])
    kernels.remembering(numbers(equation, rate, **nonlinear), x, x.copy(), -x, before.size, size * root.real)
    return x[before.size :]


def growth_by_runge_kutta(equations: list[DelayEquation], lasts: float, rate: float = 36e3, thinned: int = 6) -> Floats:
    """Return the growth (1/s) after a blow: steps as above, the end fitted like that of ours at every sixth step."""
    turn = math.ceil(max(e.delay_1 + e.delay_2 for e in equations) * rate / thinned)
    ends, highest = np.empty((len(equations), 4 * turn)), 0.0
    for e, end in zip(equations, ends, strict=True):
        first = math.ceil(max(e.delay_1, e.delay_2) * rate) + 4
        x = np.zeros(first + round(lasts * rate))
        kernels.linear(numbers(e, rate), x, first, 1.0)
        end[:] = x[::-thinned][: 4 * turn][::-1]
        highest = max(highest, math.sqrt((e.stiffness + 2.0 * e.cutting_stiffness) / e.modal_mass))
    return fitted(ends, highest * thinned / rate)[0] * rate / thinned


def why_no_jitcdde() -> str | None:
    """Return why jitcdde cannot be measured, None when it can."""
    if importlib.util.find_spec("jitcdde") is None:
        return "not installed"
    return None if shutil.which("gcc") or shutil.which("cc") else "no C compiler"


@contextlib.contextmanager
def jitcdde_solver(equation: DelayEquation, root: complex) -> Generator[Callable[[float, Floats], Floats]]:
    """Lend a compiled solver: called with a relative tolerance and times, it returns the displacement there."""
    jit: Any = importlib.import_module("jitcdde")
    e, y, t = equation, jit.y, jit.t
    regenerated = e.overlap * (y(0, t - e.delay_1) + y(0, t - e.delay_2))
    force = (e.damping + 2.0 * e.process_damping) * y(1) + e.stiffness * y(0)
    slope = [y(1), -(force + e.cutting_stiffness * (2.0 * y(0) + regenerated)) / e.modal_mass]
    longest = max(e.delay_1, e.delay_2)
    solver = jit.jitcdde(slope, delays=[0.0, e.delay_1, e.delay_2], max_delay=longest, verbose=False)
    with contextlib.redirect_stdout(sys.stderr):
        solver.compile_C(simplify=False, verbose=False)

    def solve(tolerance: float, times: Floats) -> Floats:
        solver.purge_past()
        for moment in np.arange(-math.ceil(longest * 36e3) - 3, 1) / 36e3:
            value = np.exp(root * moment)
            state, change = [value.real, (root * value).real], [(root * value).real, (root * root * value).real]
            solver.add_past_point(moment, state, change)
        solver.set_integration_parameters(rtol=tolerance, atol=tolerance, first_step=1e-5)
        solver.initial_discontinuities_handled = True
        return np.array([solver.integrate(moment)[0] for moment in times])

    try:
        yield solve
    finally:
        solver.__del__()  # what it has compiled, before the interpreter complains of it


def dop853(equation: DelayEquation, root: complex, times: Floats, tolerance: float = 1e-9) -> Floats:
    """Return the displacement at times, from delay to delay with dense output."""
    e, pieces = equation, [(0.0, lambda moment: [np.exp(root * moment).real])]
    state, begin, out = [1.0, root.real], 0.0, np.empty(times.size)
    shortest = min(e.delay_1, e.delay_2)

    def back(moment: float) -> float:
        return next(piece(moment)[0] for start, piece in reversed(pieces) if moment >= start or start == 0.0)

    def slope(moment: float, state: Any) -> list[float]:
        past = back(moment - e.delay_1) + back(moment - e.delay_2)
        force = e.cutting_stiffness * (2.0 * state[0] + e.overlap * past) + e.stiffness * state[0]
        return [state[1], -(force + (e.damping + 2.0 * e.process_damping) * state[1]) / e.modal_mass]

    while begin < times[-1]:
        end = min(begin + shortest, float(times[-1]))
        done: Any = solve_ivp(
            slope, (begin, end), state, method="DOP853", rtol=tolerance, atol=tolerance, dense_output=True
        )
        pieces.append((begin, done.sol))
        inside = (times > begin) & (times <= end)
        out[inside] = done.sol(times[inside])[0]
        state, begin = done.y[:, -1], end
    return out
