"""Verb about cutting force without a sensor: `compare`."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from services.cli.app import JsonFlag, OutDir, Seed, app, emit, writable_folder
from services.errors import InputError


@app.command()
def compare(
    condition: Annotated[
        int, typer.Option("--condition", help="Milling condition of thesis Table 4-2: 1, 2, 3, 4.")
    ] = 2,
    drive: Annotated[str, typer.Option("--drive", help="Named drive, or the path of a TOML file.")] = "machine-a",
    mass_error: Annotated[
        float, typer.Option("--mass-error", help="Mass of the stage as believed over the true one.")
    ] = 1.0,
    no_delay_compensation: Annotated[
        bool, typer.Option("--no-delay-compensation", help="Dead times of the drive as they are, not compensated.")
    ] = False,
    sensors: Annotated[
        str, typer.Option("--sensors", help="ideal (the reference condition of the thesis) or real (as in the file).")
    ] = "ideal",
    estimator: Annotated[
        list[str] | None, typer.Option("--estimator", help="One estimator; may be given several times. Default: all.")
    ] = None,
    seed: Seed = None,
    out: OutDir = None,
    as_json: JsonFlag = False,
) -> None:
    """Set every estimator of the cutting force beside the true force of one simulated cut."""
    if condition not in (1, 2, 3, 4):
        raise InputError("condition", condition, "1, 2, 3 or 4")
    if sensors not in ("ideal", "real"):
        raise InputError("sensors", sensors, "ideal or real")
    from services.compare import compare as judged
    from services.drives import load_drive

    folder = writable_folder(out)
    cut, found = judged(
        load_drive(drive), condition, mass_error=mass_error, compensation=not no_delay_compensation,
        sensors=sensors, lags=no_delay_compensation or sensors == "real",
        names=estimator or (), seed=1 if seed is None else seed,
    )  # fmt: skip
    rows = [one.row() for one in found]
    answer: dict[str, Any] = {"condition": condition, "drive": drive, "sensors": sensors, "rows": rows}
    text = _table(rows, condition, drive)
    if folder is not None:
        from services.figures.estimators import write_comparison

        answer["written"] = write_comparison(cut, found, folder)
        text += "".join(f"\nwrote {path}" for path in answer["written"])
    emit(answer, text, as_json)


def _table(rows: list[dict[str, Any]], condition: int, drive: str) -> str:
    head = "estimator   error/force   error N  gain 335 Hz  late ms  predicted N"
    lines = [f"Milling condition {condition} of the thesis on {drive}:", head]
    for row in rows:
        gain, predicted = row["gain_335hz"], row["predicted_error_n"]
        lines.append(
            f"{row['estimator']:10}  {row['error_ratio']:11.4f}  {row['error_std_n']:8.3g}  "
            f"{'-' if gain is None else f'{gain:.3f}':>11}  {row['latency_ms']:7.2f}  "
            f"{'-' if predicted is None else f'{predicted:.3g}':>11}"
        )
    return "\n".join(lines)
