"""The linear process of a case: what stability theory takes from the bar, the cut and the plant that is used."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from pitch import Mode, StabilityUnresolved, TurningProcess, process_roots
from services.config import Case, replaced
from turning_sim import CutDerivatives, Cutting, ProcessModel, cut_derivatives

_FINE = 1000  # places along the pass between which growth is summed


def linear_process(case: Case, position: float) -> TurningProcess:
    """Return the process about the steady cut.

    Stiffness and overlap of the linear cut are those of the case, those of the surface map follow from the chip. A bar
    that bends in one direction feels tool 1 as if it had not turned, as the plant has it.

    Parameters
    ----------
    case
        The case.
    position
        Tools from the tip (m).
    """
    plane = case.process.directions == 2
    modes = tuple(
        Mode(
            modal_mass=mode.modal_mass / mode.shape**2,
            natural_frequency_hz=mode.natural_frequency_hz,
            damping_ratio=mode.damping_ratio,
            direction=direction,
        )
        for mode in case.workpiece.modes(position)
        for direction in ((0.0, math.pi / 2.0) if plane else (0.0,))
    )
    cut = derivatives(case.cutting, case.process)
    return TurningProcess(
        modes=modes,
        cutting_stiffness=cut.stiffness,
        tangential_stiffness=cut.tangential_stiffness,
        overlap=cut.overlap,
        tangential_overlap=cut.tangential_overlap,
        process_damping=case.cutting.process_damping,
        rake_gain=case.cutting.rake_gain,
        tool_turns=plane,
    )


@lru_cache(maxsize=64)
def derivatives(cutting: Cutting, model: ProcessModel) -> CutDerivatives:
    """Return how the force of one tool answers to its depth, given for the linear cut and computed for the map."""
    if model.cut == "surface":
        return cut_derivatives(cutting, model)
    return CutDerivatives(
        stiffness=cutting.cutting_stiffness,
        tangential_stiffness=cutting.tangential_ratio * cutting.cutting_stiffness,
        overlap=cutting.overlap,
        tangential_overlap=cutting.overlap,
        area_overlap=cutting.overlap,
    )


def strongest_root(case: Case, position: float, shift: float) -> complex:
    """Return growth (1/s) and angular frequency (rad/s) of the strongest root of the linear process.

    Parameters
    ----------
    case
        The case.
    position
        Tools from the tip (m).
    shift
        Of turret 1 (rad).
    """
    found = process_roots(linear_process(case, position), case.cutting.spindle_hz, 2.0 * shift, count=1)
    if not len(found):
        raise StabilityUnresolved(f"no root settled at {case.cutting.spindle_hz:g} turns per second")
    return complex(found[0])


def strongest_of_pass(case: Case, shift: float, positions: Sequence[float]) -> complex:
    """Return the strongest of the roots over several tool positions (m)."""
    return max(roots_of_pass(case, shift, positions), key=lambda root: root.real)


def roots_of_pass(case: Case, shift: float, positions: Sequence[float]) -> list[complex]:
    """Return the strongest root (1/s) at each of several tool positions (m), turret 1 at a shift (rad)."""
    return [strongest_root(case, position, shift) for position in positions]


def gain_of_pass(case: Case, roots: Sequence[complex], positions: Sequence[float]) -> float:
    """Return by how many nepers a small wave grows at most while the tools pass.

    Parameters
    ----------
    case
        The case.
    roots
        Strongest root at each position (1/s).
    positions
        Tools from the tip, rising (m).
    """
    fine = np.linspace(positions[0], positions[-1], _FINE)
    feed = case.cutting.feed_per_rev * case.cutting.spindle_hz
    steps = np.interp(fine, positions, [root.real for root in roots]) * (fine[1] - fine[0]) / feed
    level = np.concatenate([[0.0], np.cumsum(steps)])
    return float(np.max(level - np.minimum.accumulate(level)))


def with_stiffness(case: Case, factor: float) -> Case:
    """Return the case with a cut that is so many times as stiff, whichever plant cuts."""
    law = case.cutting.force_law
    cutting = dataclasses.replace(
        case.cutting,
        cutting_stiffness=factor * case.cutting.cutting_stiffness,
        force_law=dataclasses.replace(
            law,
            thrust_coefficient=factor * law.thrust_coefficient,
            tangential_coefficient=factor * law.tangential_coefficient,
        ),
    )
    return replaced(case, cutting=cutting)
