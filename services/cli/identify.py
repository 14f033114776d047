"""Verbs that find the parameters of a machine in its recordings: `identify servo`, `identify hammer`."""

from __future__ import annotations

import pathlib
from typing import Annotated

import typer

from services.cli.app import JsonFlag, OutDir, app, console, emit, positive, writable_folder
from services.cli.recordings import parse_band
from services.identified import Answer

group = typer.Typer(name="identify", help="Parameters of a machine from its recordings, with confidence.",
                    no_args_is_help=True)  # fmt: skip
app.add_typer(group, name="identify")

File = Annotated[
    pathlib.Path, typer.Argument(help="Recording: CSV, TDMS, MAT, LVM, UFF, HDF5, WAV or MCAP.")
]
RateHz = Annotated[float | None, typer.Option("--rate-hz", help="Sampling rate (Hz) of a file that does not tell it.")]
MapText = Annotated[
    list[str] | None,
    typer.Option("--map", help="CHANNEL=ROLE[:UNIT], may be repeated, or a TOML file with a table [channels]."),
]


@group.command()
def servo(
    file: File,
    map_: MapText = None,
    rate_hz: RateHz = None,
    lead_mm: Annotated[float | None, typer.Option("--lead-mm", help="Travel in one turn of the motor (mm).")] = None,
    gain: Annotated[
        float | None, typer.Option("--gain", help="Thrust (N) for one unit of the recorded effort as it stands.")
    ] = None,
    torque_constant: Annotated[
        float | None, typer.Option("--torque-constant", help="Torque of the motor for a current (N m/A).")
    ] = None,
    cutoff_hz: Annotated[
        float | None, typer.Option("--cutoff-hz", help="Edge of the low-pass (Hz); default: the best.")
    ] = None,
    out: OutDir = None,
    as_json: JsonFlag = False,
) -> None:
    """Find mass and friction of a feed axis on which nothing pushes."""
    from services.identified import servo_answer
    from services.importers.load import load_recording
    from services.importers.roles import mapping, with_roles
    from services.importers.servo import Constants, axis_of

    for name, value, unit in (("rate-hz", rate_hz, "Hz"), ("lead-mm", lead_mm, "mm"), ("cutoff-hz", cutoff_hz, "Hz"),
                              ("torque-constant", torque_constant, "N m/A")):  # fmt: skip
        if value is not None:
            positive(name, value, unit)
    folder = writable_folder(out)
    said = mapping(map_ or ())
    recording = with_roles(load_recording(file, rate_hz, [one.channel for one in said]), said)
    lead = None if lead_mm is None else 1e-3 * lead_mm
    axis = axis_of(recording, Constants(lead_m=lead, gain=gain, torque_constant=torque_constant))
    _tell(servo_answer(recording, axis, cutoff_hz), folder, file.name, as_json)


@group.command()
def hammer(
    file: File,
    map_: MapText = None,
    rate_hz: RateHz = None,
    band: Annotated[str | None, typer.Option("--band", help="Where to look for modes, LO:HI (Hz).")] = None,
    out: OutDir = None,
    as_json: JsonFlag = False,
) -> None:
    """Find the modes of a structure in the taps of an impact hammer."""
    from services.identified import hammer_answer, modes_answer
    from services.importers.load import frequency_responses, load_recording
    from services.importers.roles import mapping, with_roles

    if rate_hz is not None:
        positive("rate-hz", rate_hz, "Hz")
    folder = writable_folder(out)
    said = mapping(map_ or ())
    ready = frequency_responses(file)
    if ready is not None:
        frf, names = ready
        found = {"taps": None, "double_hits": None, "responses": names, "notes": ["the file holds responses, no taps"]}
        limits = parse_band(band, 2.0 * float(frf.frequency_hz[-1]))
        _tell(modes_answer(str(file), frf, found, limits), folder, file.name, as_json)
        return
    recording = with_roles(load_recording(file, rate_hz, [one.channel for one in said]), said)
    sure = any(one.role == "hammer" for one in said)
    _tell(hammer_answer(recording, parse_band(band, recording.rate_hz), sure), folder, file.name, as_json)


def _tell(answer: Answer, folder: pathlib.Path | None, title: str, as_json: bool) -> None:
    text = answer.text
    if folder is not None:
        from services.figures.identified import write_identified

        answer.keys["written"] = write_identified(answer.keys, answer.made, folder, title)
        text += "".join(f"\nwrote {path}" for path in answer.keys["written"])
    for note in (*answer.keys.get("flags", ()), *answer.keys["notes"]):
        console.print(f"note: {note}", markup=False, highlight=False)
    emit(answer.keys, text, as_json)
