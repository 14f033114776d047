"""The verb `replay`: a recording through monitor and controller again, or back onto a bus."""

from __future__ import annotations

import math
import pathlib
from typing import Annotated, Any

import typer

from services.cli.app import JsonFlag, OutDir, app, console, emit, positive, require, writable_folder
from services.cli.loop import conclude
from services.cli.services import Connect, Listen, on_bus, say
from services.clock import WallClock
from services.errors import InputError
from services.process import Stopped, StopSignal
from services.zenoh_bus import check_machine


@app.command()
def replay(
    file: Annotated[pathlib.Path, typer.Argument(help="A recording (.mcap).")],
    pace: Annotated[
        float | None,
        typer.Option("--pace", help="Times real time; default: as fast as it goes, with --publish real time."),
    ] = None,
    start_s: Annotated[float, typer.Option("--from", help="Start of the stretch (s).")] = 0.0,
    stop_s: Annotated[float | None, typer.Option("--to", help="End of the stretch (s).")] = None,
    publish: Annotated[bool, typer.Option("--publish", help="Put it on a bus instead.")] = False,
    connect: Connect = None,
    listen: Listen = None,
    machine: Annotated[
        str | None, typer.Option("--machine", help="With --publish: name on the bus (default: as recorded).")
    ] = None,
    topic: Annotated[
        list[str] | None, typer.Option("--topic", help="With --publish: only this topic; may be repeated.")
    ] = None,
    out: OutDir = None,
    as_json: JsonFlag = False,
) -> int:
    """Feed a recording to the monitor and the controller again, and compare what they say with what they said."""
    if pace is not None:
        positive("pace", pace, "times real time")
    require("from", start_s, "0 s or more", start_s >= 0.0)
    stop = math.inf if stop_s is None else require("to", stop_s, "after --from", stop_s > start_s)
    if publish:
        return _publish(file, pace or 1.0, (start_s, stop), (connect, listen), machine, topic, as_json)
    for name, value in (("connect", connect), ("listen", listen), ("machine", machine), ("topic", topic)):
        if value:
            raise InputError(name, str(value), "left out without --publish")
    return _again(file, pace, (start_s, stop), out, as_json)


def _again(
    file: pathlib.Path, pace: float | None, stretch_s: tuple[float, float], out: pathlib.Path | None, as_json: bool
) -> int:
    from services.closed_loop import Outcome
    from services.metrics import summarize
    from services.observed import record_of
    from services.replay import repeatable
    from services.replay import replay as play

    folder, clock = writable_folder(out), WallClock()
    started = clock.now()
    result = play(file, clock, start_s=stretch_s[0], stop_s=stretch_s[1], pace=pace)
    seen = result.comparison
    extra: dict[str, Any] = {
        "same_as_recorded": seen.same,
        "compared": dict(seen.compared),
        "different": dict(seen.different),
        "examples": seen.examples,
        "notes": list(result.notes),
    }
    if not result.metadata.get("seed"):
        extra["seed"] = None
    for line in (*result.notes, *seen.examples):
        console.print(f"note: {line}", markup=False, highlight=False)
    said = "to the bit" if seen.same else f"with {seen.different.total()} differences"
    text = f"\n{seen.compared.total()} messages compared with the recording: {said}."

    def alone() -> Outcome:
        record, _ = record_of(result.tape, result.case, result.metadata)
        return Outcome(record=record, summary=summarize(record))

    return conclude(
        result.case, result.seed, result.tape, False, folder, clock.now() - started, as_json, extra=extra, more=text,
        judged=None if repeatable(result) else alone,
    )  # fmt: skip


def _publish(
    file: pathlib.Path, pace: float, stretch_s: tuple[float, float], where: tuple[str | None, str | None],
    machine: str | None, topics: list[str] | None, as_json: bool,
) -> int:  # fmt: skip
    from services.playback import check_topics, publish, serve_recorded_config, stretch
    from services.recording_file import read_metadata

    reader, messages = stretch(file, *stretch_s, check_topics(topics))
    name = check_machine(machine or read_metadata(file).get("machine") or "lathe-1")
    answer: dict[str, Any] = {"machine": name, "published": 0, "stopped": True}
    with StopSignal() as stop:
        try:
            with on_bus(name, *where, stop) as bus:
                serve_recorded_config(file, bus)
                say(f"replaying {file.name} as {name} at {bus.endpoint}, {pace:g} times real time; Ctrl-C ends it")
                played = publish(messages, bus, WallClock(), stop, pace)
                answer |= played.as_dict() | {"endpoint": bus.endpoint}
        except Stopped:  # before there was a bus
            say("stopped")
    answer["notes"] = reader.notes
    for line in reader.notes:
        console.print(f"note: {line}", markup=False, highlight=False)
    emit(answer, f"{answer['published']} messages published as {name}", as_json)
    return 0
