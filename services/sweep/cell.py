"""One cell: the case with its values replaced, cut once. Depends on its job alone, wherever it is computed."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

from services.clock import WallClock
from services.config import Case, case_from_text, replaced
from services.doubts import doubts_of
from services.errors import InputError, RefusalError
from services.sweep.axes import KINDS, Value

Mode = Literal["open", "closed", "linear"]
OPEN = ("stable", "chatter_hz", "growth_rate_1_s", "amplitude_um", "ra_um")
CLOSED = ("stable", "chatter_hz", "detection_latency_s", "shift_deg", "moves", "ra_before_um", "ra_after_um",
          "marked_length_mm")  # fmt: skip
LINEAR = ("stable", "chatter_hz", "growth_rate_1_s")
QUANTITIES: dict[Mode, tuple[str, ...]] = {"open": OPEN, "closed": CLOSED, "linear": LINEAR}
Result = dict[str, Any]
"""Quantities by name, or `failed` with a sentence; `doubts` where the cell lies outside the range of the model."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Job:
    """What one cell needs; plain enough to be sent to another machine.

    Attributes
    ----------
    number
        Of the cell.
    values
        By the names of the axes.
    """

    number: int
    values: dict[str, Value]


@dataclass(frozen=True, slots=True, kw_only=True)
class Task:
    """What all cells share.

    Attributes
    ----------
    name, text
        The case and its resolved tables as JSON.
    mode
        `open`: turret 1 stands at the phase; `closed`: the loop decides, aiming at the phase; `linear`: roots alone.
    seed
        Of the noise, where no axis says otherwise.
    length_mm
        Feed in the cut, for open cuts.
    """

    name: str
    text: str
    mode: Mode
    seed: int
    length_mm: float


def run_batch(task: Task, jobs: list[Job]) -> list[tuple[int, Result]]:
    """Return the result of every job; a cell that fails says why, and the others still run."""
    return [(job.number, run_cell(task, job)) for job in jobs]


def run_cell(task: Task, job: Job) -> Result:
    """Return what one cell showed."""
    try:
        case, phase, seed = case_of(task, job)
        if task.mode == "closed":
            return _closed(case, seed)
        shift = 0.0 if phase is None else shift_of(case, phase)
        if task.mode == "linear":
            return _linear(case, shift) | _doubted(doubts_of(case, shift, 0.0))
        return _open(case, shift, seed, task.length_mm)
    except (ValueError, ArithmeticError, RefusalError) as error:
        return {"failed": str(error) or type(error).__name__}


def _doubted(doubts: Sequence[str]) -> Result:
    return {"doubts": list(doubts)} if doubts else {}


def case_of(task: Task, job: Job) -> tuple[Case, float | None, int]:
    """Return the case of a cell, its phase (rad) if it has one, and its seed."""
    keys = {kind.name: kind.key for kind in KINDS}
    changes = {keys[name]: value for name, value in job.values.items() if keys[name]}
    phase = job.values.get("phase_pi")
    if phase is not None and task.mode == "closed":
        changes["planner.target_phase_pi"] = float(phase)
    case = case_from_text(task.name, task.text, changes)
    if phase is not None:
        case = replaced(case, foresight=None)  # the phase is given: nothing is to be foreseen
    if "depth_mm" in job.values:
        case = _deeper(case, 1e-3 * float(job.values["depth_mm"]))
    if "stiffness_ratio" in job.values:
        stiffness = case.cutting.cutting_stiffness * float(job.values["stiffness_ratio"])
        case = replaced(case, cutting=dataclasses.replace(case.cutting, cutting_stiffness=stiffness))
    seed = int(job.values.get("seed", task.seed))
    return case, None if phase is None else math.pi * float(phase), seed


def _deeper(case: Case, depth: float) -> Case:
    """Return the case at another depth: stiffness, overlap and process damping follow the chip."""
    from turning_sim import cut_derivatives

    before = case.cutting
    after = dataclasses.replace(before, depth_of_cut=depth)
    old, new = (cut_derivatives(cutting, case.process) for cutting in (before, after))
    return replaced(
        case,
        cutting=dataclasses.replace(
            after,
            cutting_stiffness=before.cutting_stiffness * new.stiffness / old.stiffness,
            overlap=min(before.overlap * new.overlap / old.overlap, 1.0),
            process_damping=before.process_damping * after.chip.edge_length / before.chip.edge_length,
        ),
    )


def shift_of(case: Case, phase: float) -> float:
    """Return the shift (rad) that gives a phase (rad) at the case's reference frequency."""
    from pitch import pitch_difference_for_phase

    if not 0.0 <= phase <= 20.0 * math.pi:
        raise InputError("phase", phase / math.pi, "in 0..20 pi")
    difference = pitch_difference_for_phase(case.settings.reference_chatter_hz, case.cutting.spindle_hz, phase)
    if abs(difference / 2.0) > math.radians(20.0):
        degrees = math.degrees(difference / 2.0)
        raise InputError("phase", phase / math.pi, f"within a shift of 20 deg (here {degrees:.1f})")
    return difference / 2.0


def _open(case: Case, shift: float, seed: int, length_mm: float) -> Result:
    from services.open_cut import cut_open

    cut = cut_open(case, seed, shift, 1e-3 * length_mm)
    return {
        "stable": not cut.chatter,
        "chatter_hz": cut.chatter_hz,
        "growth_rate_1_s": cut.growth_rate_1_s,
        "amplitude_um": cut.amplitude_um,
        "ra_um": cut.ra_um,
    } | _doubted(cut.doubts)


def _linear(case: Case, shift: float) -> Result:
    from pitch import OneModeProcess, growth_rates
    from pitch.many_roots import numbers_of
    from turning_sim import linear_parameters

    one = linear_parameters(case.workpiece, case.cutting, case.settings.start_position)
    process = OneModeProcess(
        one.mass_at_tools, one.natural_frequency_hz, one.damping_ratio, one.overlap, one.process_damping
    )
    numbers = numbers_of(process)
    root = complex(growth_rates(*numbers, one.cutting_stiffness, case.cutting.spindle_hz, 2.0 * shift))
    return {"stable": root.real < 0.0, "chatter_hz": root.imag / (2.0 * math.pi), "growth_rate_1_s": root.real}


def _closed(case: Case, seed: int) -> Result:
    from services.closed_loop import run_case

    summary: Result = run_case(case, seed, WallClock()).summary.as_dict()
    quiet = summary["outcome"] in ("stable", "suppressed", "prevented")
    shown = {name: quiet if name == "stable" else summary[name] for name in CLOSED}
    return shown | _doubted(summary["doubts"])
