"""The stability chart beside a Nyquist count of every cell and semi-discretisation, a sweep on dask beside the pool."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Generator
from contextlib import contextmanager
from functools import partial
from typing import Any

import numpy as np

from pitch import OneModeProcess, pitch_difference_for_phase, stability_chart
from services.bench.rounds import Row, Say, interleaved, row, silent
from services.bench.stability_peers import nyquist_column, semi_discretised
from services.clock import CpuClock, WallClock
from services.config import Case, load_case
from services.messages import Floats
from services.sweep.axes import parse_axis
from services.sweep.sweep import Sweep, run_sweep
from turning_sim import linear_parameters

CASE = "thesis-652"
HIGHEST = 2.0
PICKED = 12
"""Cells that semi-discretisation does."""
AXES = ("phase", "0.5:1.5:0.02"), ("seed", "1,2,3,4")
WORKERS = 2


def measure(*, cells: int = 200, rounds: int = 5, sweep_mm: float = 6.0, say: Say = silent) -> list[Row]:
    """Return the rows of the table.

    Parameters
    ----------
    cells
        Rows and columns of the chart.
    rounds
        How often each way is timed.
    sweep_mm
        Feed in each cut of the sweep (mm); 0 leaves the sweep out.
    say
        Told what is being measured.
    """
    say(f"chart of {cells} x {cells}")
    rows = chart_rows(load_case(CASE), cells, rounds)
    if sweep_mm > 0.0:
        say("sweep, local pool and dask")
        rows += sweep_rows(sweep_mm)
    return rows


def chart_rows(case: Case, cells: int, rounds: int) -> list[Row]:
    """Return how long each way takes for one chart, and how many cells differ."""
    linear = linear_parameters(case.workpiece, case.cutting, case.settings.start_position)
    process = OneModeProcess(
        linear.mass_at_tools, linear.natural_frequency_hz, linear.damping_ratio, linear.overlap, linear.process_damping
    )
    speed, reference = case.cutting.spindle_hz, case.settings.reference_chatter_hz
    difference = np.array([pitch_difference_for_phase(reference, speed, p) for p in np.linspace(0.0, 2 * np.pi, cells)])
    stiffness = linear.cutting_stiffness * HIGHEST * np.arange(1, cells + 1) / cells
    rng = np.random.default_rng(1)
    picked = rng.integers(cells, size=(PICKED, 2))

    def ours() -> Any:
        return stability_chart(process, speed, difference, stiffness).unstable

    def nyquist() -> Floats:
        return np.column_stack([nyquist_column(process, speed, float(d), stiffness) for d in difference])

    def semi() -> list[bool]:
        return [semi_discretised(process, speed, float(difference[j]), float(stiffness[i])) for i, j in picked.tolist()]

    ways: dict[str, Any] = {"ours": ours, "semi": semi}
    clock = CpuClock()
    taken, found = interleaved(ways, rounds, clock)
    begin = clock.now()
    found["nyquist"] = nyquist()  # takes so long that once will do
    taken["nyquist"] = clock.now() - begin
    semi_s = taken["semi"] * cells**2 / PICKED
    other = float((found["ours"] != found["nyquist"]).sum())
    wrong = [
        stable != (found["ours"][i, j] == 0) for stable, (i, j) in zip(found["semi"], picked.tolist(), strict=True)
    ]
    what = f"stability chart {cells} x {cells}"
    return [
        row(f"{what} beside a Nyquist count of every cell", taken["ours"], taken["nyquist"], "s (less is faster)"),
        row(f"{what}: cells that differ from the Nyquist count", other, 0.0, f"of {cells**2}"),
        row(f"{what} beside dense semi-discretisation, 100 steps, from {PICKED} cells", taken["ours"], semi_s, "s"),
        row(f"semi-discretisation: cells of {PICKED} that differ", float(sum(wrong)), 0.0, f"of {PICKED}"),
    ]


def sweep_rows(length_mm: float) -> list[Row]:
    """Return how long one sweep takes on dask and on the local pool, and in how many cells they differ."""
    axes = tuple(parse_axis(*axis) for axis in AXES)
    run = partial(
        run_sweep, load_case(CASE), axes, mode="open", seed=1, length_mm=length_mm, folder=None, workers=WORKERS,
        fresh=False, clock=WallClock(), progress=lambda done, total: None,
    )  # fmt: skip
    with _dask() as address:
        run(scheduler=address, most=4 * WORKERS)  # compiles on the workers
        there, here = run(scheduler=address), run(scheduler=None)
    return [
        row(f"sweep of {len(here.results)} cuts, {WORKERS} workers: dask beside the local pool", there.wall_s,
            here.wall_s, "s (the pool starts its workers, those of dask stand)"),
        row("the same: cells that differ", float(_differing(here, there)), 0.0, f"of {len(here.results)}"),
    ]  # fmt: skip


def _differing(one: Sweep, other: Sweep) -> int:
    return sum(other.results.get(number) != result for number, result in one.results.items())


@contextmanager
def _dask() -> Generator[str]:
    """Start a scheduler and workers of one thread each on this machine."""
    import socket
    import tempfile

    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    address = f"tcp://127.0.0.1:{port}"
    with tempfile.TemporaryDirectory() as folder:
        lines = [["dask_scheduler", "--host", "127.0.0.1", "--port", str(port), "--no-dashboard"]]
        worker = ["dask_worker", address, "--no-nanny", "--nthreads", "1", "--no-dashboard", "--local-directory"]
        lines += [[*worker, f"{folder}/{number}"] for number in range(WORKERS)]
        running = [
            subprocess.Popen(
                [sys.executable, "-m", f"distributed.cli.{line[0]}", *line[1:]], stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
            )
            for line in lines
        ]  # fmt: skip
        try:
            yield address
        finally:
            for process in running:
                process.kill()
                process.wait()
