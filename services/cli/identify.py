"""Verbs that find the parameters of a machine in its recordings: `identify servo`, `hammer`, `sweep`, `cutting`."""

from __future__ import annotations

import pathlib
from typing import Annotated

import typer

from services.cli.app import JsonFlag, OutDir, app, console, emit, positive, require, writable_folder
from services.cli.recordings import parse_band
from services.errors import InputError
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
    dead_time_ms: Annotated[
        float | None, typer.Option("--dead-time-ms", help="Position late beside the thrust (ms); default: found.")
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
    if dead_time_ms is not None:
        require("dead-time-ms", dead_time_ms, "in [0, 50] ms", 0.0 <= dead_time_ms <= 50.0)
    late = None if dead_time_ms is None else 1e-3 * dead_time_ms
    _tell(servo_answer(recording, axis, cutoff_hz, late), folder, file.name, as_json)


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


@group.command()
def sweep(
    file: File,
    map_: MapText = None,
    rate_hz: RateHz = None,
    period_s: Annotated[
        float | None, typer.Option("--period-s", help="Period of the sweep (s); default: as the thrust repeats.")
    ] = None,
    band: Annotated[str | None, typer.Option("--band", help="Frequencies of the sweep, LO:HI (Hz).")] = None,
    current_bandwidth: Annotated[
        float, typer.Option("--current-bandwidth", help="Of the current loop (rad/s); default: a dead time instead.")
    ] = float("inf"),
    lead_mm: Annotated[float | None, typer.Option("--lead-mm", help="Travel in one turn of the motor (mm).")] = None,
    gain: Annotated[
        float | None, typer.Option("--gain", help="Thrust (N) for one unit of the recorded effort as it stands.")
    ] = None,
    out: OutDir = None,
    as_json: JsonFlag = False,
) -> None:
    """Find inertias, dampings, stiffness and dead times of a drive in a swept sine that repeats on a constant feed."""
    from services.identified_drive import sweep_answer
    from services.importers.load import load_recording
    from services.importers.roles import mapping, with_roles
    from services.importers.servo import Constants, axis_of

    for name, value, unit in (("rate-hz", rate_hz, "Hz"), ("lead-mm", lead_mm, "mm"), ("period-s", period_s, "s")):
        if value is not None:
            positive(name, value, unit)
    if not current_bandwidth > 0.0:
        raise InputError("current-bandwidth", current_bandwidth, "above 0 rad/s")
    folder, said = writable_folder(out), mapping(map_ or ())
    recording = with_roles(load_recording(file, rate_hz, [one.channel for one in said]), said)
    axis = axis_of(recording, Constants(lead_m=None if lead_mm is None else 1e-3 * lead_mm, gain=gain))
    limits = parse_band(band, recording.rate_hz)
    _tell(sweep_answer(recording, axis, period_s, limits, current_bandwidth), folder, file.name, as_json)


@group.command()
def cutting(
    file: File,
    depth_mm: Annotated[float, typer.Option("--depth-mm", help="Depth of cut (mm).")],
    teeth: Annotated[
        int | None, typer.Option("--teeth", help="Teeth of a mill in a full slot; left out for turning.")
    ] = None,
    map_: MapText = None,
    out: OutDir = None,
    as_json: JsonFlag = False,
) -> None:
    """Find cutting and edge coefficients from forces at several feeds (one column of feed, others of force)."""
    from services.identified_drive import cutting_answer
    from services.importers.load import load_rows
    from services.importers.roles import mapping, with_roles

    positive("depth-mm", depth_mm, "mm")
    if teeth is not None:
        require("teeth", teeth, "a whole number from 1 to 100", 1 <= teeth <= 100)
    folder, said = writable_folder(out), mapping(map_ or ())
    recording = with_roles(load_rows(file, [one.channel for one in said]), said)
    _tell(cutting_answer(recording, depth_mm, teeth), folder, file.name, as_json)


def _tell(answer: Answer, folder: pathlib.Path | None, title: str, as_json: bool) -> None:
    text = answer.text
    if folder is not None:
        from services.figures.identified import write_identified

        answer.keys["written"] = write_identified(answer.keys, answer.made, folder, title)
        text += "".join(f"\nwrote {path}" for path in answer.keys["written"])
    for note in (*answer.keys.get("flags", ()), *answer.keys["notes"]):
        console.print(f"note: {note}", markup=False, highlight=False)
    emit(answer.keys, text, as_json)
