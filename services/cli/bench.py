"""The verb `bench`: tables of ours beside its peers."""

from __future__ import annotations

import pathlib
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any

import typer

from services.cli.app import JsonFlag, OutDir, app, console, emit, writable_folder
from services.cli.loop import progress_bar
from services.errors import InputError

Rows = list[dict[str, Any]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Options:
    """What the command line says of the size of a benchmark."""

    long: bool
    seed: int
    workers: int
    out: pathlib.Path | None


def _transport(_: Options) -> dict[str, Any]:
    from services.bench.transport import measure

    return {"rows": measure()}


def _detector(options: Options) -> dict[str, Any]:
    from services.bench.detector.measure import LONG, SHORT, measure

    with progress_bar("cuts") as progress:
        outcome = measure(
            LONG if options.long else SHORT, seed=options.seed, workers=options.workers, out=options.out,
            progress=progress,
        )  # fmt: skip
    written = [] if options.out is None else outcome.write(options.out)
    return {"rows": outcome.rows, "detector": outcome.numbers, "written": written}


def _delay(_: Options) -> dict[str, Any]:
    from services.bench.delay import measure

    return {"rows": measure(say=_say)}


def _loop(_: Options) -> dict[str, Any]:
    from services.bench.loop import measure

    return {"rows": measure(say=_say)}


def _estimators(_: Options) -> dict[str, Any]:
    from services.bench.estimators import measure

    return {"rows": measure(say=_say)}


def _sdft(_: Options) -> dict[str, Any]:
    from services.bench.spectrum import measure

    return {"rows": measure(say=_say)}


def _variance(_: Options) -> dict[str, Any]:
    from services.bench.variance import measure

    return {"rows": measure(say=_say)}


def _population(options: Options) -> dict[str, Any]:
    from services.bench.population.measure import LONG, SHORT, measure

    with progress_bar("processes") as progress:
        size = LONG if options.long else SHORT
        rows, numbers = measure(size, seed=options.seed, workers=options.workers, progress=progress)
    return {"rows": rows, "population": numbers}


def _dashboard(_: Options) -> dict[str, Any]:
    from services.bench.dashboard import measure

    return {"rows": measure(say=_say)}


def _fleet(_: Options) -> dict[str, Any]:
    from services.bench.fleet import measure

    return {"rows": measure(say=_say)}


def _stability(_: Options) -> dict[str, Any]:
    from services.bench.stability import measure

    return {"rows": measure(say=_say)}


def _say(what: str) -> None:
    console.print(f"  {what} ...", highlight=False)


TABLES: dict[str, Callable[[Options], dict[str, Any]]] = {
    "transport": _transport, "detector": _detector, "delay": _delay, "loop": _loop,
    "estimators": _estimators, "sdft": _sdft, "variance": _variance, "population": _population,
    "stability": _stability, "dashboard": _dashboard, "fleet": _fleet,
}  # fmt: skip
LongFlag = Annotated[bool, typer.Option("--long", help="detector: 20 h of stable cuts; population: 500.")]
Workers = Annotated[int | None, typer.Option("--workers", help="Processes (default: all cores).", min=1)]
BenchSeed = Annotated[int, typer.Option("--seed", help="Seed of every random number.", min=0)]


@app.command()
def bench(
    name: Annotated[str | None, typer.Argument(help=f"One table: {', '.join(TABLES)}. Default: all.")] = None,
    long: LongFlag = False,
    seed: BenchSeed = 1,
    workers: Workers = None,
    out: OutDir = None,
    as_json: JsonFlag = False,
) -> None:
    """Measure ours beside its peers, in one run; what `detector` has done is kept in --out and not done again."""
    if name is not None and name not in TABLES:
        raise InputError("name", name, f"one of {', '.join(TABLES)}")
    options = Options(long=long, seed=seed, workers=workers or _cores(), out=writable_folder(out))
    answer: dict[str, Any] = {"rows": []}
    for table in [name] if name else TABLES:
        console.print(f"measuring {table} ...", highlight=False)
        found = TABLES[table](options)
        rows = answer["rows"] + found["rows"]
        answer |= found | {"rows": rows}
    text = "\n".join([table_of(answer["rows"]), *(f"wrote {path}" for path in answer.get("written", []))])
    emit(answer, text, as_json)


def _cores() -> int:
    import os

    return os.cpu_count() or 1


def table_of(rows: Rows) -> str:
    """Return the rows as text; the ratio is ours over the peer's, and the unit says which side is better."""
    wide = max(len(row["case"]) for row in rows)
    head = f"{'case':{wide}}  {'ours':>9}  {'peer':>9}  {'ratio':>9}  unit"
    lines = (
        f"{row['case']:{wide}}  {row['ours']:9.4g}  {_number(row['peer'])}  {_number(row['ratio'])}  {row['unit']}"
        for row in rows
    )
    return "\n".join((head, *lines, "ratio = ours / peer"))


def _number(value: float | None) -> str:
    return f"{'-':>9}" if value is None else f"{value:9.4g}"
