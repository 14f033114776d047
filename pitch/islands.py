"""Every stretch of cutting stiffness in which the process is stable.

More stiffness can stabilise: between two unstable stretches may lie an island, so the limit is a set. With all
stiffness in proportion to the radial K, the characteristic determinant over the one without a cut is

    1 + K t(s) + K^2 d(s),    t and d trace and determinant of the 2 x 2 matrix see (s^2 + C s + W)^-1 push(s)^T,

`push` being what each tool does per unit of K and of what it or, a delay later, the other one sees. On the border,
where s = i w, both parts vanish for a real K only where R(w) = 0, R the resultant of them. Each zero is a crossing; the
sign of d Re(s)/dK says whether a pair of roots becomes unstable there or stable. Counting starts at K = 0, where the
bar is damped.
"""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pitch._checks import positive
from pitch.modes import DelayEquation, Mode, TurningProcess, delay_equation
from pitch.stability import OneModeProcess, StabilityUnresolved

_PER_TURN = 96  # samples of the resultant per turn of the spindle
_PER_WIDTH = 6  # samples per half width of the sharpest resonance
_MAX_SAMPLES = 4_000_000
_HALVINGS = 60
_REAL = 1e-6  # an eigenvalue with a smaller imaginary part, in units of its size, is real
_WIDEST = 10.0  # stiffness searched by default, in units of the softest mode's

Numbers = NDArray[np.float64]


def stable_intervals(
    process: OneModeProcess | TurningProcess, spindle_hz: float, pitch_difference: float, highest: float | None = None
) -> list[tuple[float, float]]:
    """Stretches of radial cutting stiffness in which every characteristic root decays.

    Parameters
    ----------
    process : OneModeProcess or TurningProcess
        Bar and cut. Of a `TurningProcess` only the ratio of tangential to radial stiffness counts.
    spindle_hz : float
        Spindle speed (Hz).
    pitch_difference : float
        Pitch difference (rad), in (-2 pi, 2 pi).
    highest : float or None
        End of the search (N/m); None for ten times the stiffness of the softest mode.

    Returns
    -------
    list of tuple of float
        Start and end of each stretch (N/m), rising; the first starts at 0, the last may end where the search does.
    """
    per_unit = _per_unit(process)
    softest = min(mode.modal_mass * (2 * math.pi * mode.natural_frequency_hz) ** 2 for mode in per_unit.modes)
    limit = _WIDEST * softest if highest is None else positive("highest", highest)
    equation = delay_equation(per_unit, spindle_hz, pitch_difference)
    intervals: list[tuple[float, float]] = []
    unstable, start = 0, 0.0
    for stiffness, change in _crossings(equation, limit):
        if unstable == 0:
            intervals.append((start, stiffness))
        unstable += change
        if unstable < 0:
            raise StabilityUnresolved(f"a border was missed below {stiffness:.4g} N/m")
        start = stiffness
    return intervals if unstable else [*intervals, (start, limit)]


def _per_unit(process: OneModeProcess | TurningProcess) -> TurningProcess:
    """Return the process with a radial stiffness of 1 N/m."""
    if isinstance(process, TurningProcess):
        stiffness = positive("cutting_stiffness", process.cutting_stiffness)
        return replace(process, cutting_stiffness=1.0, tangential_stiffness=process.tangential_stiffness / stiffness)
    mode = Mode(
        modal_mass=process.modal_mass,
        natural_frequency_hz=process.natural_frequency_hz,
        damping_ratio=process.damping_ratio,
    )
    return TurningProcess(
        modes=(mode,),
        cutting_stiffness=1.0,
        overlap=process.overlap,
        process_damping=process.process_damping,
        tool_turns=False,
    )


def _crossings(equation: DelayEquation, limit: float) -> list[tuple[float, int]]:
    """Return stiffness (N/m) and change of the number of unstable pairs at each crossing below `limit`, rising."""
    trace, determinant = _invariants(equation, np.linspace(*_band(equation, limit), 1000))
    flat = bool(np.abs(determinant).max() <= 1e-12 * (np.abs(trace) ** 2).max())

    def resultant(w: Numbers) -> Numbers:
        t, d = _invariants(equation, w)
        return t.imag if flat else d.imag**2 - t.real * t.imag * d.imag + d.real * t.imag**2

    border = _zeros(resultant, _grid(equation, limit))
    t, d = _invariants(equation, border)
    root = np.sqrt(t**2 / 4 - (0.0 if flat else d))
    larger = t / 2 + np.where((t * root.conj()).real < 0.0, -root, root)
    found: list[tuple[float, int]] = []
    # K = -1/eigenvalue where that is real; zeros of R at which the smaller one vanishes belong to infinite stiffness
    for values in (larger,) if flat else (larger, d / larger):
        real = (np.abs(values.imag) < _REAL * np.abs(values)) & (values.real * limit < -1.0)
        for value, w in zip(values[real].real.tolist(), border[real].tolist(), strict=True):
            found.append((-1.0 / value, _direction(equation, w, -1.0 / value)))
    return sorted(found)


def _direction(equation: DelayEquation, w: float, stiffness: float) -> int:
    """Return 1 if a pair of roots moves to the right as stiffness rises, -1 if to the left."""
    step = 1e-6 * w
    t, d = _invariants(equation, np.array([w - step, w, w + step]))
    slope = stiffness * (t[2] - t[0]) + stiffness**2 * (d[2] - d[0])
    # ds/dK with s = i w: minus the derivative by K over that by s
    return 1 if (-(t[1] + 2 * stiffness * d[1]) / (slope / 2j / step)).real > 0.0 else -1


def _invariants(equation: DelayEquation, w: Numbers) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
    """Return trace and determinant of the receptance between the tools at `w` (rad/s), shape (k,) each."""
    s = 1j * w[:, None, None]
    dynamic = s**2 * np.eye(len(equation.spring)) + s * equation.damping + equation.spring
    late = np.exp(-s * equation.delays[None, :, None]) * equation.late
    push = equation.now - late[:, ::-1]
    answer = equation.see @ np.linalg.solve(dynamic, push.transpose(0, 2, 1))
    return np.trace(answer, axis1=1, axis2=2), np.linalg.det(answer)


def _band(equation: DelayEquation, limit: float) -> tuple[float, float]:
    """Return the frequencies (rad/s) between which a border can lie."""
    see, now, late = (np.linalg.norm(rows, axis=1) for rows in (equation.see, equation.now, equation.late))
    cut = limit * float(now @ see + late @ see[::-1])
    # w^2 - w_n^2 <= cut + |C| w, so beyond this nothing can balance the inertia
    damping, spring = float(np.linalg.norm(equation.damping, 2)), float(np.diag(equation.spring).max())
    top = damping / 2 + math.sqrt(damping**2 / 4 + spring + cut)
    return 1e-3 * math.sqrt(float(np.diag(equation.spring).min())), top


def _grid(equation: DelayEquation, limit: float) -> Numbers:
    low, high = _band(equation, limit)
    turn = float(equation.delays.sum())
    step = min(2 * math.pi / (_PER_TURN * turn), float(np.diag(equation.damping).min()) / 2 / _PER_WIDTH)
    count = math.ceil((high - low) / step)
    if count > _MAX_SAMPLES:
        raise StabilityUnresolved(f"{count} samples are needed up to {high / (2 * math.pi):.4g} Hz")
    return np.linspace(low, high, count + 1)


def _zeros(function: Callable[[Numbers], Numbers], grid: Numbers) -> Numbers:
    """Return all zeros, rising: between samples of different sign, and in pairs about a dip between equal signs."""
    value = function(grid)
    size = np.abs(value)
    dips = 1 + np.flatnonzero((size[1:-1] < size[:-2]) & (size[1:-1] <= size[2:]) & (value[:-2] * value[2:] > 0.0))
    left, right = grid[dips - 1], grid[dips + 1]
    for _ in range(_HALVINGS):
        third = (right - left) / 3
        fall = np.abs(function(left + third)) > np.abs(function(right - third))
        left, right = np.where(fall, left + third, left), np.where(fall, right, right - third)
    lowest = (left + right) / 2
    crossed = function(lowest) * value[dips] < 0.0
    points = np.union1d(grid, lowest[crossed])
    sign = np.sign(function(points))
    change = np.flatnonzero(sign[:-1] * sign[1:] < 0.0)
    left, right, before = points[change], points[change + 1], sign[change]
    for _ in range(_HALVINGS):
        middle = (left + right) / 2
        same = np.sign(function(middle)) == before
        left, right = np.where(same, middle, left), np.where(same, right, middle)
    return np.union1d((left + right) / 2, points[sign == 0.0])
