"""The verb `loss`."""

from __future__ import annotations

import json
from typing import Annotated, Any

import typer

from services.cli.app import JsonFlag, OutDir, Seed, app, emit, require, writable_folder
from services.cli.loop import progress_bar
from services.clock import WallClock
from services.config import load_case


@app.command()
def loss(
    case: Annotated[str, typer.Argument(help="Name of a shipped case, or path of a TOML file.")] = "thesis-652",
    lost_at_s: Annotated[float, typer.Option("--lost-at-s", help="When the controller falls silent (s).")] = 3.0,
    seed: Seed = None,
    out: OutDir = None,
    as_json: JsonFlag = False,
) -> None:
    """Lose the controller in mid-cut twice: for a job that wants the shift held, and for one that wants it back."""
    from services.loss import JOBS, lose

    config = load_case(case)
    require("lost-at-s", lost_at_s, "0.5 to 60", 0.5 <= lost_at_s <= 60.0)
    used = config.settings.seed if seed is None else seed
    folder = writable_folder(out)
    with progress_bar(config.name) as progress:
        cuts = [lose(config, used, lost_at_s, job, WallClock(), progress) for job in JOBS]
    found: dict[str, Any] = {"case": config.name, "seed": used, "lost_at_s": cuts[0].lost_at_s}
    found["jobs"] = [cut.answer() for cut in cuts]
    if folder is not None:
        from services.figures.loss import write_loss_figure

        (folder / "loss.json").write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
        found["files"] = [str(folder / "loss.json"), str(write_loss_figure(cuts, config.limits, folder))]
    emit(found, "\n".join([*map(_line, found["jobs"]), *found.get("files", ())]), as_json)


def _line(job: dict[str, Any]) -> str:
    states = ", ".join(f"{span['state']} from {span['from_s']:.2f} s" for span in job["states"])
    asked = job["feed_hold_from_s"]
    hold = "" if asked is None else f"; feed hold asked for from {asked:.2f} s"
    return (
        f"{job['on_loss']}: {states}{hold}; shift {job['shift_before_deg']:.2f} -> {job['shift_after_deg']:.2f} deg, "
        f"vibration {job['vibration_before_um']:.2f} -> {job['vibration_after_um']:.2f} um rms"
    )
