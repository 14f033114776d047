"""The two-delay equation: how fast, and how true, beside its peers in the same run.

The linear run stands on the eigenfunction of the rightmost root at equal pitch, so that the exact solution is known.
Loss of contact has no closed form; there the measure is our own solution at four times the rate.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from pitch import OneModeProcess, rightmost_root
from services.bench import delay_peers as peers
from services.bench.rounds import Row, Say, interleaved, row, silent
from services.clock import CpuClock
from services.config import load_case
from services.messages import Floats
from turning_sim import ContactVibration, DelayEquation, LinearVibration, growth_of, linear_parameters

CLOCK = CpuClock()
RATE, SIZE = 9000.0, 1e-6
DOP853_S = 0.05
JITCDDE = {"jitcdde rtol 1e-5": 1e-5, "jitcdde rtol 1e-7": 1e-7}
CONTACT_PEERS = (144e3, 1152e3)
PART = 20
"""A peer of the sweep does one run of so many."""
SPEED, ERROR = "s/s (more is faster)", "of max (less is truer)"
COST, GROWTH = "us (less is faster)", "1/s (less is truer)"


def measure(
    *, seconds: float = 10.0, contact_s: float = 1.0, runs: int = 1000, rounds: int = 5, say: Say = silent
) -> list[Row]:
    """Return the rows of the table.

    Parameters
    ----------
    seconds
        How long the linear run lasts (s).
    contact_s
        How long the run with loss of contact lasts (s).
    runs
        How many linear runs of 2 s the sweep has.
    rounds
        How often each way is timed.
    say
        Told what is being measured.
    """
    say("linear two-delay equation")
    rows = linear_rows(seconds, rounds)
    say("the same with loss of contact")
    rows += contact_rows(contact_s, rounds)
    say("sweep of linear runs")
    return rows + sweep_rows(runs, rounds)


def root_of(equation: DelayEquation) -> complex:
    """Return the rightmost root (1/s) of an equation."""
    e, turn = equation, equation.delay_1 + equation.delay_2
    process = OneModeProcess(e.modal_mass, e.natural_frequency_hz, e.damping_ratio, e.overlap, e.process_damping)
    return rightmost_root(process, e.cutting_stiffness, 1.0 / turn, 2.0 * math.pi * (e.delay_1 - e.delay_2) / turn)


def usual() -> DelayEquation:
    """Return the equation of `thesis-652` where the tools enter, at equal pitch."""
    case = load_case("thesis-652")
    linear = linear_parameters(case.workpiece, case.cutting, case.settings.start_position)
    return DelayEquation.of_cut(linear, case.cutting.spindle_hz, 0.0)


def linear_rows(seconds: float, rounds: int) -> list[Row]:
    """Return speed and error of the linear run beside each peer."""
    equation, grid = usual(), _grid
    root = root_of(equation)
    ours = partial(_linear, equation, root, round(seconds * RATE))
    ways: dict[str, tuple[Callable[[], Floats], Floats]] = {"ours": (ours, grid(RATE, seconds))}
    for rate in (36e3, 144e3):
        run = partial(peers.runge_kutta, equation, rate, root, seconds)
        ways[f"numba RK4 and cubic history at {rate / 1e3:.0f} kHz"] = run, grid(rate, seconds)
    short = grid(RATE, DOP853_S)
    name = f"scipy DOP853 by the method of steps (1e-9, {DOP853_S:g} s)"
    ways[name] = partial(peers.dop853, equation, root, short), short
    absent = peers.why_no_jitcdde()
    with contextlib.ExitStack() as stack:
        if absent is None:
            solve, times = stack.enter_context(peers.jitcdde_solver(equation, root)), grid(100.0, seconds)
            ways |= {name: (partial(solve, tolerance, times), times) for name, tolerance in JITCDDE.items()}
        taken, found = interleaved({name: way for name, (way, _) in ways.items()}, rounds, CLOCK)
    speed = {name: float(times[-1]) / taken[name] for name, (_, times) in ways.items()}
    error = {name: _misfit(found[name], _swing(root, times)) for name, (_, times) in ways.items()}
    what, others = f"linear, {seconds:g} s, beside", [name for name in ways if name != "ours"]
    rows = [row(f"{what} {name}", speed["ours"], speed[name], SPEED) for name in others]
    rows += [row(f"{what} {name}: error", error["ours"], error[name], ERROR) for name in others]
    if absent is not None:
        rows += [row(f"{what} {name} ({absent})", speed["ours"], None, SPEED) for name in JITCDDE]
    return rows


def contact_rows(seconds: float, rounds: int) -> list[Row]:
    """Return speed and error of runs that lose contact, without and with flank interference, beside Runge-Kutta."""
    equation, case = usual(), load_case("thesis-652")
    cutting, root = case.cutting, root_of(equation)
    nominal = cutting.steady_forces[0] / cutting.cutting_stiffness
    surface_speed = math.pi * cutting.spindle_hz * case.workpiece.cutting_diameter
    limit = surface_speed * math.tan(cutting.flank_clearance)
    rows: list[Row] = []
    for what, flank in (("surface memory", 0.0), ("surface memory and flank", cutting.flank_factor)):
        ours = partial(_contact, equation, root, seconds, nominal_cut=nominal, flank_factor=flank, flank_speed=limit)
        ways: dict[str, Callable[[], Floats]] = {"ours": partial(ours, RATE)}
        for rate in CONTACT_PEERS:
            peer = partial(peers.remembering, equation, rate, root, SIZE, seconds)
            ways[f"{rate / 1e3:.0f} kHz"] = partial(peer, cut=nominal, flank=flank, limit=limit)
        taken, found = interleaved(ways, rounds, CLOCK)
        converged = ours(4.0 * RATE)[3::4]
        error = {name: _misfit(x[x.size // converged.size - 1 :: x.size // converged.size], converged)
                 for name, x in found.items()}  # fmt: skip
        for name in ways:
            if name != "ours":
                beside = f"{what}, {seconds:g} s, beside numba RK4 at {name}"
                rows.append(row(beside, seconds / taken["ours"], seconds / taken[name], SPEED))
                rows.append(row(f"{beside}: error", error["ours"], error[name], ERROR))
    return rows


def sweep_rows(runs: int, rounds: int, lasts: float = 2.0) -> list[Row]:
    """Return what a run of a sweep over stiffness and shift costs, the fit of its growth included, and its error."""
    equation, rng = usual(), np.random.default_rng(1)
    shifts, factors = rng.uniform(0.0, math.radians(2.2), runs), rng.uniform(0.5, 1.5, runs)
    half = 0.5 * (equation.delay_1 + equation.delay_2)
    columns = {name: getattr(equation, name) for name in DelayEquation.__dataclass_fields__}
    columns |= {
        "cutting_stiffness": factors * equation.cutting_stiffness,
        "delay_1": half * (1.0 + shifts / math.pi), "delay_2": half * (1.0 - shifts / math.pi),
    }  # fmt: skip
    few = max(1, runs // PART)
    some = [DelayEquation(**{name: float(np.broadcast_to(values, runs)[i]) for name, values in columns.items()})
            for i in range(few)]  # fmt: skip
    ways = {"ours": partial(_growth, columns, lasts), "peer": partial(peers.growth_by_runge_kutta, some, lasts)}
    taken, found = interleaved(ways, rounds, CLOCK)
    exact = np.array([root_of(each).real for each in some])
    error = {name: float(np.median(np.abs(rate[:few] - exact))) for name, rate in found.items()}
    what = f"sweep of {runs} linear runs of {lasts:g} s, beside numba RK4 at 36 kHz"
    return [
        row(f"{what}: each run", 1e6 * taken["ours"] / runs, 1e6 * taken["peer"] / few, COST),
        row(f"{what}: median error of the growth", error["ours"], error["peer"], GROWTH),
    ]


def _grid(rate: float, lasts: float) -> Floats:
    return np.arange(1, round(lasts * rate) + 1) / rate


def _swing(root: complex, times: Floats) -> Floats:
    return np.real(np.exp(root * times))


def _linear(equation: DelayEquation, root: complex, samples: int) -> Floats:
    return LinearVibration(equation, past=lambda times: _swing(root, times)).advance(samples)


def _contact(equation: DelayEquation, root: complex, seconds: float, rate: float, **nonlinear: float) -> Floats:
    def past(times: Floats) -> Floats:
        return SIZE * _swing(root, times)

    return ContactVibration(equation, past=past, sample_rate_hz=rate, **nonlinear).advance(round(seconds * rate))


def _growth(columns: dict[str, Any], lasts: float) -> Floats:
    return growth_of(**columns, duration=lasts).rate


def _misfit(got: Floats, wanted: Floats) -> float:
    return float(np.abs(got - wanted).max() / np.abs(wanted).max())
