"""Verbs for recordings that people bring: `detect`."""

from __future__ import annotations

import pathlib
from typing import Annotated

import typer

from services.cli.app import JsonFlag, OutDir, app, console, emit, positive, require, writable_folder
from services.errors import InputError, RefusalError

BandText = Annotated[str | None, typer.Option("--band", help="Frequencies to look at, LO:HI (Hz).")]


def parse_band(text: str | None, rate_hz: float) -> tuple[float, float] | None:
    """Return `LO:HI` as two frequencies (Hz), or say what is wrong with it."""
    if text is None:
        return None
    rule = "LO:HI in Hz with 0 < LO < HI, for example 500:750"
    try:
        low, high = (float(part) for part in text.split(":"))
    except ValueError as error:
        raise InputError("band", text, rule) from error
    if not 0 < low < high < float("inf"):
        raise InputError("band", text, rule)
    if high > 0.5 * rate_hz:
        seen = f"sampled at {rate_hz:g} Hz, cannot see {low:g}..{high:g} Hz (only what lies below {rate_hz / 2:g} Hz)"
        raise RefusalError(seen, {"rate_hz": rate_hz, "duration_s": None, "verdict": None, "events": None})
    return low, high


@app.command()
def detect(
    file: Annotated[pathlib.Path, typer.Argument(help="WAV, FLAC, MP3, OGG, CSV, TDMS, MAT, LVM, UFF, HDF5 or MCAP.")],
    channel: Annotated[
        list[str] | None,
        typer.Option(
            "--channel",
            help="Name or number (from 0) of a channel; may be repeated; `all`. Default: those that show vibration.",
        ),
    ] = None,
    rate_hz: Annotated[
        float | None, typer.Option("--rate-hz", help="Sampling rate (Hz) of a file that does not tell it.")
    ] = None,
    speed_rpm: Annotated[float | None, typer.Option("--speed-rpm", help="Spindle speed (1/min), if known.")] = None,
    tools: Annotated[int | None, typer.Option("--tools", help="Cutting edges or tools in one revolution.")] = None,
    band: BandText = None,
    sensitivity: Annotated[
        float, typer.Option("--sensitivity", help="Steps of 3 dB by which every limit is lowered (negative: raised).")
    ] = 0.0,
    out: OutDir = None,
    as_json: JsonFlag = False,
) -> None:
    """Find chatter in a recording: when, at what frequency, and whether it is regenerative or forced."""
    from chatter import RecordingVerdict, detect_recording
    from services.detected import Detected, left_out, speed_told
    from services.importers.channels import chosen
    from services.importers.health import dead, unheld
    from services.importers.load import load_recording

    if rate_hz is not None:
        positive("rate-hz", rate_hz, "Hz")
    if speed_rpm is not None:
        require("speed-rpm", speed_rpm, "in (0, 200000] 1/min", 0 < speed_rpm <= 200_000)
    if tools is not None:
        require("tools", tools, "a whole number from 1 to 100", 1 <= tools <= 100)
    require("sensitivity", sensitivity, "in [-3, 3]", abs(sensitivity) <= 3)
    folder = writable_folder(out)
    whole = load_recording(file, rate_hz, channel or ())
    recording = unheld(chosen(whole, channel))
    spindle_hz = speed_rpm / 60.0 if speed_rpm is not None else None
    limits = parse_band(band, recording.rate_hz)
    reason = dead(recording)
    verdict = RecordingVerdict(verdict=None, reason=reason) if reason else detect_recording(
        recording.samples, recording.rate_hz, band_hz=limits, spindle_hz=spindle_hz, tools=tools,
        sensitivity=sensitivity,
    )  # fmt: skip
    others = left_out(whole.names, recording.names) + ([] if speed_rpm else speed_told(whole))
    found = Detected(recording=recording, verdict=verdict, notes=(*recording.notes, *others, *verdict.notes))
    answer = found.as_dict()
    if verdict.reason:
        raise RefusalError(verdict.reason, answer)
    text = found.words()
    if folder is not None:
        title = f"{file.name}, {answer['channel']}"
        written = found.write(folder, title=title, band_hz=limits, spindle_hz=spindle_hz, tools=tools)
        answer["written"] = written
        text += "".join(f"\nwrote {path}" for path in written)
    for note in found.notes:
        console.print(f"note: {note}", markup=False, highlight=False)
    emit(answer, text, as_json)
