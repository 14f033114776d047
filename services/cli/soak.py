"""The verb `soak`."""

from __future__ import annotations

import math
from typing import Annotated

import typer
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

from services.cli.app import JsonFlag, OutDir, Seed, app, console, emit, positive, require, writable_folder
from services.cli.services import say
from services.clock import WallClock
from services.config import load_case
from services.process import StopSignal


@app.command()
def soak(
    case: Annotated[str, typer.Argument(help="Name of a shipped case, or path of a TOML file.")] = "thesis-652",
    duration_s: Annotated[float, typer.Option("--duration-s", help="How long (s).")] = 60.0,
    load: Annotated[float, typer.Option("--load", help="Busy processes for each core besides the services.")] = 0.0,
    cut_every_s: Annotated[
        float, typer.Option("--cut-every-s", help="How often the link is cut for a second (s); 0: never.")
    ] = 20.0,
    dashboards: Annotated[int, typer.Option("--dashboards", help="How many are attached.", min=0, max=16)] = 3,
    seed: Seed = None,
    out: OutDir = None,
    as_json: JsonFlag = False,
) -> int:
    """Run the services under load and link cuts, and say what became of every block and of memory.

    Exit code 1 if a block vanished, or if a process surely grows faster than the limit (in ten minutes or more).
    """
    from services.soak.soak import Wishes
    from services.soak.soak import soak as run
    from services.supervisor import Plan

    config = load_case(case)
    positive("duration-s", duration_s, "s")
    require("load", load, "0 to 16 for each core", 0.0 <= load <= 16.0)
    require("cut-every-s", cut_every_s, "0, or at least 4 s", cut_every_s == 0.0 or cut_every_s >= 4.0)
    wishes = Wishes(duration_s=duration_s, load=load, cut_every_s=cut_every_s or math.inf, dashboards=dashboards)
    used = config.settings.seed if seed is None else seed
    plan = Plan(case=case, machine=config.settings.machine, seed=used)
    folder = writable_folder(out)
    columns = (TextColumn("soak"), BarColumn(), TextColumn("{task.description}"), TimeRemainingColumn())
    with StopSignal() as stop, Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task("", total=duration_s)

        def show(done: float, blocks: int) -> None:
            bar.update(task, completed=done, description=f"{blocks} blocks")

        answer = run(plan, wishes, stop=stop, clock=WallClock(), say=say, show=show, out=folder)
    text = "\n".join(f"{name}: {value}" for name, value in answer.items())
    emit(answer | ({"out": str(folder)} if folder else {}), text, as_json)
    return 1 if answer["blocks_lost_silently"] or answer["memory_grows"] else 0
