"""Chapter 6 of the thesis: every observation beside what the model computes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from services.clock import Clock
from services.reproduce.depth import DepthCut, depth_rows, study_depth
from services.reproduce.directions import PlaneCut, direction_rows, study_directions
from services.reproduce.equal_pitch import PassStudy, pass_rows, study_pass
from services.reproduce.formulas import (
    error_of_the_shift,
    natural_frequencies,
    phase_and_difference,
    pitch_differences,
)
from services.reproduce.in_process import InProcess, in_process_rows, study_in_process
from services.reproduce.phases import PhaseCut, phase_rows, study_phases
from services.reproduce.plant import PlantName, Progress
from services.reproduce.rows import Row
from services.reproduce.sweep import Sweep, study_sweep, sweep_rows

_SHARES = {"pass": 0.55, "phases": 0.2, "sweep": 0.05, "depth": 0.02, "in process": 0.16, "directions": 0.02}
"""Of the whole time, for the progress."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Chapter6:
    """All rows, and what they and the figures are made of."""

    rows: tuple[Row, ...]
    equal_pitch: PassStudy
    phases: tuple[PhaseCut, ...]
    sweep: Sweep
    depth: tuple[DepthCut, ...]
    in_process: InProcess
    directions: tuple[PlaneCut, ...]


def reproduce_chapter6(
    *, clock: Clock, seed: int = 1, plant: PlantName = "lumped", progress: Progress | None = None
) -> Chapter6:
    """Compute every observation of chapter 6.

    Parameters
    ----------
    clock
        For the latency of the closed loop; no row depends on it.
    seed
        First of the seeds.
    plant
        Which plant cuts.
    progress
        Told the share that is done, 0...1.
    """
    share = _Shares(progress)
    equal_pitch = study_pass(plant, seed, share.of("pass"))
    phases = study_phases(plant, seed, share.of("phases"))
    sweep = study_sweep(plant, seed)
    share.of("sweep")(1.0)
    depth = study_depth(plant, seed)
    share.of("depth")(1.0)
    in_process = study_in_process(plant, seed, clock, share.of("in process"))
    directions = study_directions(plant, seed)
    share.of("directions")(1.0)
    rows = (
        *natural_frequencies(plant),
        *depth_rows(depth),
        *direction_rows(directions),
        *error_of_the_shift(),
        *pitch_differences(),
        *pass_rows(equal_pitch),
        *sweep_rows(sweep),
        *phase_rows(phases),
        *phase_and_difference(),
        *in_process_rows(in_process),
    )
    return Chapter6(
        rows=rows,
        equal_pitch=equal_pitch,
        phases=phases,
        sweep=sweep,
        depth=depth,
        in_process=in_process,
        directions=directions,
    )


class _Shares:
    """Turns the progress of each part into progress of the whole."""

    def __init__(self, progress: Progress | None) -> None:
        self._progress: Callable[[float], None] = progress or (lambda _: None)

    def of(self, part: str) -> Progress:
        names = list(_SHARES)
        before = sum(_SHARES[name] for name in names[: names.index(part)])
        return lambda done: self._progress(before + _SHARES[part] * done)
