"""Verbs that read recordings of a bus: `convert`."""

from __future__ import annotations

import pathlib
from typing import Annotated

import typer

from services.cli.app import JsonFlag, OutDir, app, console, emit

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
