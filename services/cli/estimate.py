"""The verb `estimate`: cutting force from the recording of a servo axis."""

from __future__ import annotations

import pathlib
from typing import Annotated, Any

import typer

from services.cli.app import JsonFlag, OutDir, app, console, emit, positive, require, writable_folder
from services.cli.identify import File, MapText, RateHz


@app.command()
def estimate(
    file: File,
    drive: Annotated[str, typer.Option("--drive", help="Named drive, or the path of a TOML file.")],
    estimator: Annotated[
        str | None, typer.Option("--estimator", help="Default: load_side with a second encoder, dob without.")
    ] = None,
    idle: Annotated[
        pathlib.Path | None, typer.Option("--idle", help="The same axis while nothing cuts: taken off over position.")
    ] = None,
    map_: MapText = None,
    rate_hz: RateHz = None,
    gain: Annotated[
        float | None, typer.Option("--gain", help="Thrust (N) for one unit of the recorded effort as it stands.")
    ] = None,
    torque_constant: Annotated[
        float | None, typer.Option("--torque-constant", help="Torque of the motor for a current (N m/A).")
    ] = None,
    speed_rpm: Annotated[float | None, typer.Option("--speed-rpm", help="Spindle speed (1/min), if known.")] = None,
    tools: Annotated[int | None, typer.Option("--tools", help="Cutting edges or tools in one revolution.")] = None,
    out: OutDir = None,
    as_json: JsonFlag = False,
) -> None:
    """Estimate the cutting force in the recording of a servo axis."""
    from services.drives import load_drive
    from services.estimated import estimated
    from services.importers.load import load_recording
    from services.importers.roles import mapping, with_roles
    from services.importers.servo import Constants, axis_of

    for name, value, unit in (("rate-hz", rate_hz, "Hz"), ("torque-constant", torque_constant, "N m/A")):
        if value is not None:
            positive(name, value, unit)
    if speed_rpm is not None:
        require("speed-rpm", speed_rpm, "in (0, 200000] 1/min", 0 < speed_rpm <= 200_000)
    if tools is not None:
        require("tools", tools, "a whole number from 1 to 100", 1 <= tools <= 100)
    named, folder, said = load_drive(drive), writable_folder(out), mapping(map_ or ())
    constants = Constants(lead_m=named.drive.lead, gain=gain, torque_constant=torque_constant)

    def signals(path: pathlib.Path) -> Any:
        return axis_of(with_roles(load_recording(path, rate_hz, [one.channel for one in said]), said), constants)

    axis = signals(file)
    found = estimated(
        axis, named, name=estimator, idle=None if idle is None else signals(idle),
        spindle_hz=None if speed_rpm is None else speed_rpm / 60.0, tools=tools,
    )  # fmt: skip
    answer = {**found.keys(), "rate_hz": axis.rate_hz, "channels": dict(axis.channels)}
    error = answer["predicted_error_n"]
    text = f"{found.estimator} on {found.drive}: {answer['mean_n']:.4g} N in the mean, {answer['std_n']:.3g} N about it"
    text += f", at most {answer['peak_n']:.4g} N; {answer['samples']} samples, {found.latency_ms:.2f} ms late"
    text += "" if error is None else f"\nexpected error {error:.2g} N"
    if folder is not None:
        from services.figures.estimated import write_force_figure

        answer["written"] = [found.write(folder / "force.csv"), write_force_figure(found, folder, file.name)]
        text += "".join(f"\nwrote {path}" for path in answer["written"])
    for note in found.notes:
        console.print(f"note: {note}", markup=False, highlight=False)
    emit(answer, text, as_json)
