"""A whole sweep: cells over axes, kept as they come, and what they say together."""

from __future__ import annotations

import itertools
import math
import pathlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

import services
from services.clock import Clock
from services.config import Case
from services.messages import Floats
from services.sweep.axes import Axis, cells_of, grid
from services.sweep.cell import QUANTITIES, Job, Mode, Result, Task
from services.sweep.run import run_jobs
from services.sweep.store import Store

UNITS = {"chatter_hz": "Hz", "growth_rate_1_s": "1/s", "amplitude_um": "um", "ra_um": "um", "ra_before_um": "um",
         "ra_after_um": "um", "marked_length_mm": "mm", "detection_latency_s": "s", "shift_deg": "deg"}  # fmt: skip
NOT_RUN, DONE, FAILED = 0, 1, 2
MOST_TOLD = 5
Progress = Callable[[int, int], None]


@dataclass(frozen=True, slots=True, kw_only=True)
class Sweep:
    """Results over the axes.

    Attributes
    ----------
    task, axes
        What was asked.
    results
        By the number of the cell; cells that are not in it were not run.
    wall_s
        Time that this call took.
    resumed, damaged
        Cells taken from an earlier call, and lines of it that could not be read.
    """

    task: Task
    axes: tuple[Axis, ...]
    results: dict[int, Result]
    wall_s: float
    resumed: int
    damaged: int

    @property
    def shape(self) -> tuple[int, ...]:
        """Cells along each axis."""
        return tuple(len(axis.values) for axis in self.axes)

    @property
    def failed(self) -> int:
        """Cells that failed."""
        return sum("failed" in result for result in self.results.values())

    @property
    def doubts(self) -> list[str]:
        """What lies outside the range of the model in any of the cells, in words."""
        return sorted({doubt for result in self.results.values() for doubt in result.get("doubts", ())})

    def values(self, quantity: str) -> Floats:
        """Return one quantity over the axes, NaN where there is none."""
        out = np.full(math.prod(self.shape), np.nan)
        for number, result in self.results.items():
            value = result.get(quantity)
            out[number] = np.nan if value is None else float(value)
        return out.reshape(self.shape)

    @property
    def state(self) -> np.ndarray:
        """0 where a cell was not run, 1 where it was, 2 where it failed, over the axes."""
        out = np.zeros(math.prod(self.shape), dtype=np.int8)
        for number, result in self.results.items():
            out[number] = FAILED if "failed" in result else DONE
        return out.reshape(self.shape)

    def stable_band(self) -> tuple[float, float] | None:
        """Return first and last phase (pi) of the run of stable phases that holds pi or lies nearest to it.

        A phase counts as stable where it is so in every cell of the other axes.
        """
        place = [k for k, axis in enumerate(self.axes) if axis.kind.name == "phase_pi"]
        if not place:
            return None
        phases = np.array([float(value) for value in self.axes[place[0]].values])
        others = tuple(k for k in range(len(self.axes)) if k != place[0])
        stable = (self.values("stable") == 1.0).all(axis=others)
        order = np.argsort(phases)
        runs: list[tuple[float, float]] = []
        for good, run in itertools.groupby(order, key=lambda k: bool(stable[k])):
            members = [float(phases[k]) for k in run]
            runs += [(members[0], members[-1])] if good else []
        return min(runs, key=lambda run: max(run[0] - 1.0, 1.0 - run[1], 0.0)) if runs else None

    def as_dict(self) -> dict[str, Any]:
        """Return the keys of the command line."""
        band = self.stable_band()
        return {
            "runs": len(self.results),
            "failed": self.failed,
            "not_run": math.prod(self.shape) - len(self.results),
            "resumed": self.resumed,
            "damaged_lines": self.damaged,
            "wall_s": self.wall_s,
            "stable_band_pi": None if band is None else list(band),
            "stable_share": float(np.nanmean(self.values("stable"))) if len(self.results) > self.failed else None,
            "doubted": sum("doubts" in result for result in self.results.values()),
            "doubts": self.doubts[:MOST_TOLD],
            "reasons": sorted({result["failed"] for result in self.results.values() if "failed" in result})[:MOST_TOLD],
        }


def run_sweep(
    case: Case,
    axes: Sequence[Axis],
    *,
    mode: Mode,
    seed: int,
    length_mm: float,
    folder: pathlib.Path | None,
    workers: int,
    scheduler: str | None,
    fresh: bool,
    clock: Clock,
    progress: Progress,
    most: int | None = None,
) -> Sweep:
    """Compute the cells that are not there yet.

    Parameters
    ----------
    case, axes, mode, seed, length_mm
        What to sweep; see `Task`.
    folder
        Where finished cells are kept, or None.
    workers, scheduler
        See `run_jobs`.
    fresh
        Forget what is in the folder.
    clock
        For the time it took.
    progress
        Told how many cells are done and how many there are.
    most
        Stop after so many cells, for a first look.
    """
    total = cells_of(axes)
    task = Task(name=case.name, text=case.text, mode=mode, seed=seed, length_mm=length_mm)
    header = {
        "version": services_version(), "case": case.name, "digest": case.digest, "mode": mode, "seed": seed,
        "length_mm": length_mm, "axes": [[axis.kind.name, list(axis.values)] for axis in axes],
    }  # fmt: skip
    store = Store(folder, header, fresh=fresh)
    resumed = len(store.results)
    begin = clock.now()

    def done(results: Any) -> None:
        store.add(results)
        progress(len(store.results), total)

    progress(resumed, total)
    jobs = [Job(number=number, values=values) for number, values in grid(axes) if number not in store.results]
    try:
        run_jobs(task, jobs[:most], workers=workers, scheduler=scheduler, done=done)
    finally:
        store.close()
    return Sweep(
        task=task, axes=tuple(axes), results=dict(sorted(store.results.items())), wall_s=clock.now() - begin,
        resumed=resumed, damaged=store.damaged,
    )  # fmt: skip


def services_version() -> str:
    """Return the version of the package: results of another one are not mixed in."""
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version("antiphase")
    except PackageNotFoundError:
        return services.__name__


def write_sweep(sweep: Sweep, folder: pathlib.Path) -> list[str]:
    """Write NetCDF and CSV, and list the files."""
    import xarray as xr

    dims = [axis.kind.name for axis in sweep.axes]
    data = {name: (dims, sweep.values(name), {"units": UNITS.get(name, "1")}) for name in QUANTITIES[sweep.task.mode]}
    flags = {"flag_values": [0, 1, 2], "flag_meanings": "not_run done failed"}
    table: Any = {**data, "state": (dims, sweep.state, flags)}
    attributes = {"case": sweep.task.name, "loop": sweep.task.mode, "base_seed": sweep.task.seed}
    coordinates = {axis.kind.name: list(axis.values) for axis in sweep.axes}
    file = xr.Dataset(table, coords=coordinates, attrs=attributes)
    netcdf, csv = folder / "sweep.nc", folder / "sweep.csv"
    file.to_netcdf(netcdf, engine="scipy")
    names = ["state", *QUANTITIES[sweep.task.mode]]
    words = {NOT_RUN: "not run", DONE: "done", FAILED: "failed"}
    with csv.open("w", encoding="utf-8") as out:
        out.write(",".join([*dims, *names, "reason"]) + "\n")
        for number, values in grid(sweep.axes):
            result = sweep.results.get(number, {})
            state = words[int(sweep.state.flat[number])]
            row = [*map(str, values.values()), state, *(_cell(result.get(name)) for name in names[1:])]
            said = result.get("failed") or "; ".join(result.get("doubts", ()))
            out.write(",".join([*row, '"' + str(said).replace('"', "'") + '"']) + "\n")
    return [str(netcdf), str(csv)]


def _cell(value: Any) -> str:
    return "" if value is None else str(int(value)) if isinstance(value, bool) else f"{value:.9g}"
