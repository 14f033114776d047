"""The verb `advise`: what a shift would leave on the part, and what else could be done."""

from __future__ import annotations

import math
from typing import Annotated

import typer

from services.cli.app import JsonFlag, app, emit, require
from services.config import load_case
from services.doubts import doubts_of, notes

CaseName = Annotated[str, typer.Argument(help="Name of a shipped case, or path of a TOML file.")]


@app.command()
def advise(
    case: CaseName = "thesis-652",
    shift_deg: Annotated[
        float | None, typer.Option("--shift-deg", help="Shift to judge (deg); default: half a wave of the case.")
    ] = None,
    as_json: JsonFlag = False,
) -> None:
    """Say what a shift leaves on the part, and at which speed, feed or depth equal pitch would be stable."""
    from pitch import optimal_pitch_difference
    from services.alternatives import alternatives_of
    from services.effects import effect_rows, effects_of

    config = load_case(case)
    most = math.degrees(config.limits.target)
    if shift_deg is None:
        chatter, spindle = config.settings.reference_chatter_hz, config.cutting.spindle_hz
        shift_deg = min(0.5 * math.degrees(optimal_pitch_difference(chatter, spindle)), most)
    require("shift-deg", shift_deg, f"within +-{most:g} deg, limits.target_deg", abs(shift_deg) <= most)
    effects, other = effects_of(config, math.radians(shift_deg)), alternatives_of(config)
    job = config.job
    silent = [] if job is None else list(job.passes_without_action or ())
    answer = {
        "case": config.name, "effects": effects, **other.as_dict(), "passes_without_action": silent,
        "doubts": list(doubts_of(config)),
    }  # fmt: skip
    lines = [f"A shift of {shift_deg:.2f} deg would leave:"]
    lines += [f"  {label:22}{value:>22}   {meaning}" for label, value, meaning in effect_rows(effects)]
    lines += ["What else could be done:", *(f"  {sentence}" for sentence in other.sentences())]
    if silent:
        lines.append(f"Turret 1 does not move in these passes: {', '.join(silent)}.")
    emit(answer, "\n".join(lines) + notes(doubts_of(config)), as_json)
