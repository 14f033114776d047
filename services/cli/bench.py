"""The verb `bench`: tables of ours beside its peers."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any

import typer

from services.cli.app import JsonFlag, app, console, emit
from services.errors import InputError

Rows = list[dict[str, Any]]


def _transport() -> Rows:
    from services.bench.transport import measure

    return measure()


TABLES: dict[str, Callable[[], Rows]] = {"transport": _transport}


@app.command()
def bench(
    name: Annotated[str | None, typer.Argument(help="One table: transport. Default: all.")] = None,
    as_json: JsonFlag = False,
) -> None:
    """Measure ours beside its peers, in one run."""
    if name is not None and name not in TABLES:
        raise InputError("name", name, f"one of {', '.join(TABLES)}")
    rows: Rows = []
    for table in [name] if name else TABLES:
        console.print(f"measuring {table} ...", highlight=False)
        rows += TABLES[table]()
    emit({"rows": rows}, table_of(rows), as_json)


def table_of(rows: Rows) -> str:
    """Return the rows as text."""
    wide = max(len(row["case"]) for row in rows)
    head = f"{'case':{wide}}  {'ours':>9}  {'peer':>9}  {'ratio':>6}  unit"
    lines = (
        f"{row['case']:{wide}}  {row['ours']:9.4g}  {row['peer']:9.4g}  {row['ratio']:6.2f}  {row['unit']}"
        for row in rows
    )
    return "\n".join((head, *lines))
