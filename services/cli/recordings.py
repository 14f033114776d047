"""Verbs for recordings that people bring: `detect`."""

from __future__ import annotations

import pathlib
from dataclasses import dataclass
from typing import Annotated, Any

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
    file: Annotated[pathlib.Path, typer.Argument(help="WAV, or CSV whose first row names columns with units.")],
    channel: Annotated[str | None, typer.Option("--channel", help="Name or number (from 0) of the channel.")] = None,
    rate_hz: Annotated[
        float | None, typer.Option("--rate-hz", help="Sampling rate of a CSV without time_s (Hz).")
    ] = None,
    speed_rpm: Annotated[float | None, typer.Option("--speed-rpm", help="Spindle speed (1/min), if known.")] = None,
    tools: Annotated[int | None, typer.Option("--tools", help="Cutting edges or tools in one revolution.")] = None,
    band: BandText = None,
    out: OutDir = None,
    as_json: JsonFlag = False,
) -> None:
    """Find chatter in a recording: when, at what frequency, and whether it is regenerative or forced."""
    from chatter import detect_recording
    from services.importers.load import load_recording

    if rate_hz is not None:
        positive("rate-hz", rate_hz, "Hz")
    if speed_rpm is not None:
        require("speed-rpm", speed_rpm, "in (0, 200000] 1/min", 0 < speed_rpm <= 200_000)
    if tools is not None:
        require("tools", tools, "a whole number from 1 to 100", 1 <= tools <= 100)
    folder = writable_folder(out)
    recording = load_recording(file, rate_hz)
    name, signal = recording.channel(channel)
    limits = parse_band(band, recording.rate_hz)
    spindle_hz = speed_rpm / 60.0 if speed_rpm is not None else None
    verdict = detect_recording(signal, recording.rate_hz, band_hz=limits, spindle_hz=spindle_hz, tools=tools)
    answer: dict[str, Any] = {
        "file": recording.source,
        "channel": name,
        "rate_hz": recording.rate_hz,
        "duration_s": recording.duration_s,
        "verdict": verdict.verdict,
        "events": [
            {"start_s": e.start, "end_s": e.end, "frequency_hz": e.frequency_hz, "kind": e.kind} for e in verdict.events
        ],
        "notes": [*recording.notes, *verdict.notes],
    }
    if verdict.reason:
        raise RefusalError(verdict.reason, answer)
    if folder is not None:
        answer["written"] = [str(_draw(verdict, recording.rate_hz, signal, limits, f"{file.name}, {name}", folder))]
    for note in answer["notes"]:
        console.print(f"note: {note}", markup=False, highlight=False)
    emit(answer, _words(answer), as_json)


def _words(answer: dict[str, Any]) -> str:
    head = f"{answer['file']}, channel {answer['channel']}: {answer['duration_s']:.2f} s at {answer['rate_hz']:g} Hz"
    lines = [head, f"verdict: {answer['verdict']}"]
    lines += [
        f"  {event['start_s']:8.2f} .. {event['end_s']:8.2f} s  {event['frequency_hz']:8.1f} Hz  {event['kind']}"
        for event in answer["events"]
    ]
    lines += [f"wrote {path}" for path in answer.get("written", ())]
    return "\n".join(lines)


@dataclass(frozen=True, slots=True)
class _Drawn:
    start_s: float
    end_s: float
    frequency_hz: float
    kind: str


def _draw(
    verdict: Any, rate_hz: float, signal: Any, band: tuple[float, float] | None, title: str, out: pathlib.Path
) -> pathlib.Path:
    from services.figures import detection_figure, write_detection_figure

    events = [_Drawn(e.start, e.end, e.frequency_hz, e.kind) for e in verdict.events]
    figure = detection_figure(signal, rate_hz, verdict=verdict.verdict, events=events, band_hz=band, title=title)
    return write_detection_figure(figure, out / "detect.png")
