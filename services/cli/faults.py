"""The verb `faults`."""

from __future__ import annotations

import json
import os
from typing import Annotated

import typer
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from services.cli.app import JsonFlag, OutDir, app, console, emit, require, writable_folder
from services.config import load_case


@app.command()
def faults(
    case: Annotated[str, typer.Argument(help="Name of a shipped case, or path of a TOML file.")] = "thesis-652",
    runs: Annotated[int, typer.Option("--runs", help="Bad days, in turn of all kinds of fault.")] = 300,
    seed: Annotated[int, typer.Option("--seed", help="Of the first day; with --runs 1 one is had again.")] = 0,
    workers: Annotated[int | None, typer.Option("--workers", help="Processes (default: one for each core).")] = None,
    out: OutDir = None,
    as_json: JsonFlag = False,
) -> int:
    """Let things go wrong at random in the closed loop, and hold the guard to its limits; exit code 1 if it fails."""
    from services.faults.campaign import answer, campaign, words

    load_case(case)
    require("runs", runs, "1 to 1000000", 1 <= runs <= 1_000_000)
    require("seed", seed, "0 or more", seed >= 0)
    used = len(os.sched_getaffinity(0)) if workers is None else workers
    require("workers", used, "1 to 256", 1 <= used <= 256)
    folder = writable_folder(out)
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task("bad days", total=runs)

        def show(done: int, failed: int) -> None:
            bar.update(task, completed=done, description=f"bad days, {failed} failed" if failed else "bad days")

        found = answer(campaign(case, range(seed, seed + runs), min(used, runs), show))
    text = words(found)
    files: list[str] = []
    if folder is not None:
        (folder / "faults.json").write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
        (folder / "faults.md").write_text(text + "\n", encoding="utf-8")
        files = [str(folder / name) for name in ("faults.json", "faults.md")]
    emit(found | ({"files": files} if files else {}), "\n".join([text, *files]), as_json)
    return 1 if found["violations"] else 0
