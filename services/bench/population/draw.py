"""Processes drawn at random that chatter at equal pitch and have a stable pitch within the travel of turret 1."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pitch import ProcessBelief
from pitch.choice import reachable
from pitch.foresight import growth_at
from services.config import Case, load_case, replaced
from services.messages import Floats
from turning_sim import Cutting, Workpiece, linear_parameters

BASE = "thesis-652"
DIAMETER, SLENDERNESS, START = (18e-3, 40e-3), (4.5, 8.0), (2e-3, 10e-3)
SPEED_HZ, CHATTER_HZ = (10.0, 50.0), (300.0, 1500.0)
DAMPING, OVERLAP, FLANK = (0.02, 0.12), (0.6, 0.95), (15.0, 60.0)
STIFFNESS = (0.3e6, 3e6)
GROWTH = (5.0, 60.0)
"""Of the strongest root at equal pitch where the tools enter (1/s)."""
DECAY = 2.0
"""The best pitch must decay so fast (1/s), at the entry and where the trial ends."""
TRAVEL, SHIFT, ORDER = 6e-3, math.radians(20.0), 1
"""Of each slide either way (m), shift of turret 1 (rad), whole turns beside the first half turn."""
WRONG = {"modal_mass": 0.1, "natural_frequency_hz": 0.03, "damping_ratio": 0.25, "cutting_stiffness": 0.25,
         "overlap": 0.08, "process_damping": 0.3}  # fmt: skip
"""Largest relative error of each number that the controller believes in."""
TRIAL_S = 6.0
_PITCHES = 0.02


@dataclass(frozen=True, slots=True, kw_only=True)
class Process:
    """One process of the population.

    Attributes
    ----------
    case
        Bar, cut, limits, and what the controller believes.
    seed
        Of the noise.
    growth, chatter_hz
        Of the strongest root at equal pitch (1/s, Hz).
    best_decay
        Of the best pitch over the stretch of the trial (1/s).
    share
        Of the pitches within reach that are stable over the stretch.
    """

    case: Case
    seed: int
    growth: float
    chatter_hz: float
    best_decay: float
    share: float


def population_process(seed: int, number: int) -> Process:
    """Return one process; each is drawn anew until it chatters at equal pitch and has a stable pitch.

    Parameters
    ----------
    seed
        Of the population.
    number
        Of the process in it.
    """
    rng = np.random.default_rng([seed, 4, number])
    base = load_case(BASE)
    while True:
        found = _judged(rng, _drawn(rng, base))
        if found is not None:
            return found


def _drawn(rng: np.random.Generator, base: Case) -> Case:
    diameter = rng.uniform(*DIAMETER)
    length, size = diameter * rng.uniform(*SLENDERNESS), diameter / base.workpiece.diameter
    chuck = base.workpiece.chuck
    workpiece = replace(
        base.workpiece, diameter=diameter, length=length, turned_length=0.6 * length,
        damping_ratios=(rng.uniform(*DAMPING),),
        chuck=replace(
            chuck, lateral_stiffness=chuck.lateral_stiffness * size, tilt_stiffness=chuck.tilt_stiffness * size**3
        ),
    )  # fmt: skip
    cutting = replace(
        base.cutting, spindle_hz=rng.uniform(*SPEED_HZ), overlap=rng.uniform(*OVERLAP),
        process_damping=rng.uniform(*FLANK),
        cutting_stiffness=math.exp(rng.uniform(math.log(STIFFNESS[0]), math.log(STIFFNESS[1]))),
    )  # fmt: skip
    settings = replace(base.settings, start_position=rng.uniform(*START), seed=int(rng.integers(2**31)))
    return replaced(base, name="drawn", workpiece=workpiece, cutting=cutting, settings=settings)


def _judged(rng: np.random.Generator, drawn: Case) -> Process | None:
    """Return the process if it belongs to the population."""
    entry = true_process(drawn.workpiece, drawn.cutting, drawn.settings.start_position)
    growth, line_hz = (float(found[0]) for found in growth_at(entry, np.zeros(1), drawn.cutting.spindle_hz))
    if not (GROWTH[0] <= growth <= GROWTH[1] and CHATTER_HZ[0] <= line_hz <= CHATTER_HZ[1]):
        return None
    case = _prepared(drawn, line_hz)
    worst = _worst(case, entry, line_hz)
    if not worst.size or worst.min() > -DECAY:
        return None
    return Process(
        case=replaced(case, foresight=_believed(rng, entry)), seed=case.settings.seed, growth=growth,
        chatter_hz=line_hz, best_decay=-float(worst.min()), share=float((worst < 0.0).mean()),
    )  # fmt: skip


def _worst(case: Case, entry: ProcessBelief, line_hz: float) -> Floats:
    """Return the larger growth (1/s) of the two ends of the trial, for every shift within reach."""
    speed, start = case.cutting.spindle_hz, case.settings.start_position
    end = min(start + TRIAL_S * case.cutting.feed_per_rev * speed, 0.5 * case.workpiece.length)
    step = 0.5 * math.pi * _PITCHES * speed / line_hz
    shifts = np.arange(step, min(SHIFT, (ORDER + 1) * math.pi * speed / line_hz), step)
    shifts = np.array([h for h in shifts.tolist() if reachable(case.planner, h, case.workpiece.diameter)])
    ends = (entry, true_process(case.workpiece, case.cutting, end))
    return np.max([growth_at(one, shifts, speed)[0] for one in ends], axis=0) if shifts.size else shifts


def _prepared(drawn: Case, line_hz: float) -> Case:
    """Return the case with the travel of the population, and what the detector needs to hear it."""
    base = load_case(BASE)
    reference, stiffer = round(line_hz, -1), drawn.cutting.cutting_stiffness / base.cutting.cutting_stiffness
    return replaced(
        drawn,
        planner=replace(
            base.planner, max_shift=SHIFT, x1_travel=(-TRAVEL, TRAVEL), y1_travel=(-TRAVEL, TRAVEL), max_order=ORDER
        ),
        limits=_roomy(base.limits),
        monitor=replace(
            base.monitor, band_hz=(0.7 * reference, 1.4 * reference),
            expected_limit=stiffer * base.monitor.expected_limit,
        ),
        settings=replace(drawn.settings, reference_chatter_hz=reference, air_time=1.0, cut_time=TRIAL_S),
    )  # fmt: skip


def true_process(workpiece: Workpiece, cutting: Cutting, position: float) -> ProcessBelief:
    """Return what a controller would believe that knew bar and cut exactly, with the tools at a place (m)."""
    linear = linear_parameters(workpiece, cutting, position)
    return ProcessBelief(
        modal_mass=linear.mass_at_tools,
        natural_frequency_hz=linear.natural_frequency_hz,
        damping_ratio=linear.damping_ratio,
        cutting_stiffness=linear.cutting_stiffness,
        overlap=linear.overlap,
        process_damping=linear.process_damping,
    )


def _believed(rng: np.random.Generator, true: ProcessBelief) -> ProcessBelief:
    wrong: dict[str, Any] = {
        name: getattr(true, name) * (1.0 + most * rng.uniform(-1.0, 1.0)) for name, most in WRONG.items()
    }
    return replace(true, **wrong | {"overlap": min(wrong["overlap"], 1.0)})


def _roomy(limits: Any) -> Any:
    """Return limits of the guard that leave turret 1 the travel of the population."""
    wide = 1.05 * TRAVEL
    return replace(
        limits, shift=1.05 * SHIFT, dx=wide, dy=wide, x1=wide, y1=wide, shift_step=1.05 * SHIFT, slide_step=2 * wide,
        shift_travel=20.0 * SHIFT, slide_travel=20.0 * wide, target=SHIFT, target_step=2.0 * SHIFT,
    )  # fmt: skip
