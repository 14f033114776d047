"""Verbs that read recordings of a bus: `convert`, `report` and `history`."""

from __future__ import annotations

import math
import pathlib
from dataclasses import asdict
from typing import Annotated, Any

import typer

from services.cli.app import JsonFlag, OutDir, app, console, emit, require, writable_folder
from services.cli.loop import progress_bar

Recording = Annotated[pathlib.Path, typer.Argument(help="A recording (.mcap).")]


@app.command()
def convert(
    file: Recording,
    to: Annotated[str, typer.Option("--to", help="parquet, csv or hdf5.")],
    topic: Annotated[
        list[str] | None, typer.Option("--topic", help="Only this topic, such as servo/turret1; may be repeated.")
    ] = None,
    out: OutDir = None,
    as_json: JsonFlag = False,
) -> None:
    """Write the topics of a recording as tables: one row for each sample or message, units in the column names."""
    from services.convert import check_format, convert
    from services.playback import check_topics

    wanted, kind = check_topics(topic), check_format(to)
    done = convert(file, kind, out or file.with_name(f"{file.stem}-{kind}"), wanted)
    for line in done.notes:
        console.print(f"note: {line}", markup=False, highlight=False)
    text = "\n".join(f"{table['file']}: {table['rows']} rows of {table['topic']}" for table in done.tables)
    answer = {"file": file, "to": kind, "tables": done.tables, "notes": done.notes, "written": done.written}
    emit(answer, text + "".join(f"\nwrote {path}" for path in done.written), as_json)


@app.command()
def report(
    file: Recording,
    start_s: Annotated[float, typer.Option("--from", help="Start of the stretch (s).")] = 0.0,
    stop_s: Annotated[float | None, typer.Option("--to", help="End of the stretch (s).")] = None,
    out: OutDir = None,
    as_json: JsonFlag = False,
) -> None:
    """Tell a recording on one page: what was heard, every change, limits, spectra, the part, what was not verified."""
    from services.figures.recorded import write_recorded_figures
    from services.observed import observe
    from services.recorded_report import words, write_recorded_report

    require("from", start_s, "0 s or more", start_s >= 0.0)
    stop = math.inf if stop_s is None else require("to", stop_s, "after --from", stop_s > start_s)
    seen = observe(file, start_s, stop)
    folder = writable_folder(out or file.with_name(f"{file.stem}-report")) or pathlib.Path()
    trace = seen.surface.trace if seen.surface else None
    drawn = write_recorded_figures(seen.record, seen.summary, trace, folder)
    written = [*drawn, write_recorded_report(seen, folder)]
    for line in seen.notes:
        console.print(f"note: {line}", markup=False, highlight=False)
    answer = seen.summary.as_dict() | {
        "file": file, "machine": seen.metadata.get("machine"), "run": seen.run or None,
        "origin_s": seen.record.origin_s, "config_sha256": seen.record.config_hash or None,
        "messages": seen.messages, "missing": seen.missing, "changes": len(seen.changes),
        "seed": seen.record.seed if seen.metadata.get("seed") else None,
        "truth": seen.record.has_truth, "notes": seen.notes, "written": written,
    }  # fmt: skip
    emit(answer, words(seen) + "".join(f"\nwrote {path}" for path in written), as_json)


@app.command()
def history(
    places: Annotated[list[pathlib.Path], typer.Argument(help="Recordings (.mcap), and folders of them.")],
    out: OutDir = None,
    as_json: JsonFlag = False,
) -> None:
    """List the alarms of many recordings: when, at what frequency, and what became of them."""
    from services.history import history, write_history

    folder = writable_folder(out)
    with progress_bar("reading") as progress:
        alarms, read, notes = history(places, progress)
    for line in notes:
        console.print(f"note: {line}", markup=False, highlight=False)
    written = [write_history(alarms, folder / "history.csv")] if folder else []
    answer = {
        "recordings": len(read), "alarms": [asdict(alarm) for alarm in alarms], "notes": notes, "written": written,
    }  # fmt: skip
    if not as_json and alarms:
        show_table([asdict(alarm) for alarm in alarms])
    text = f"{len(alarms)} alarms in {len(read)} recordings" + "".join(f"\nwrote {path}" for path in written)
    emit(answer, text, as_json)


def show_table(alarms: list[dict[str, Any]]) -> None:
    """Print the history as a table for people."""
    from rich.console import Console
    from rich.table import Table

    heads = {
        "begun_utc": "begun (UTC)", "case": "case", "alarm_s": "alarm (s)", "onset_s": "onset (s)",
        "frequency_hz": "Hz", "kind": "kind", "shift_deg": "shift (deg)", "suppressed_s": "calm (s)",
        "marked_mm": "marked (mm)", "file": "file",
    }  # fmt: skip
    table = Table(box=None, pad_edge=False)
    for name, head in heads.items():
        table.add_column(head, no_wrap=name != "file", overflow="fold")
    for alarm in alarms:
        cells = {**alarm, "begun_utc": alarm["begun_utc"][:16].replace("T", " ")}
        table.add_row(*(_cell(cells[name]) for name in heads))
    Console(width=None if console.is_terminal else 160).print(table)


def _cell(value: Any) -> str:
    if value is None:
        return "-"
    return f"{value:.2f}" if isinstance(value, float) else str(value)
