"""The verb `commission`: from a machine that nobody knows to one that is armed, step by step."""

from __future__ import annotations

import pathlib
import sys
from functools import partial
from typing import Annotated

import typer

from services.cli.app import Adapter, JsonFlag, LinuxcncDir, Seed, app, console, emit, writable_folder
from services.config import load_case
from services.errors import InputError

CaseName = Annotated[str, typer.Argument(help="Case that the machine begins with: a shipped name, or a TOML file.")]
Sweep = Annotated[pathlib.Path | None, typer.Option(help="Recording of a swept sine: thrust, motor, stage.")]


@app.command()
def commission(
    case: CaseName = "thesis-652",
    out: Annotated[
        pathlib.Path | None, typer.Option("--out", help="Folder of this machine; kept, and gone on with.")
    ] = None,
    step: Annotated[
        list[str] | None, typer.Option("--step", help="Only this step, again if it was done; may be repeated.")
    ] = None,
    yes: Annotated[bool, typer.Option("--yes", help="Do not ask before something moves.")] = False,
    sweep_x1: Sweep = None,
    sweep_y1: Sweep = None,
    sweep_band: Annotated[
        str | None, typer.Option("--sweep-band", help="Frequencies of these sweeps, LO:HI (Hz); default: 5:1000.")
    ] = None,
    adapter: Adapter = "simulator",
    linuxcnc: LinuxcncDir = None,
    seed: Seed = None,
    as_json: JsonFlag = False,
) -> None:
    """Bring a machine up: signs, idle run, identification, limits, dry run, advice, armed. Writes its TOML."""
    from services.cli.linuxcnc import paced
    from services.cli.recordings import parse_band
    from services.commission.course import Course
    from services.commission.drives import BAND_HZ
    from services.commission.lockstep import Place
    from services.commission.steps import Step
    from services.machines.adapters import Choice, open_machine

    if out is None:
        raise InputError("out", None, "a folder that keeps what is found: a commissioning may take days")
    sweeps = {axis: path for axis, path in (("x1", sweep_x1), ("y1", sweep_y1)) if path is not None}
    for axis, path in sweeps.items():
        if not path.is_file():
            raise InputError(f"sweep-{axis}", str(path), "a file")
    if not yes and not sys.stdin.isatty():
        raise InputError("yes", None, "given where nobody can be asked before something moves")

    def say(text: str) -> None:
        console.print(text, markup=False, highlight=False, soft_wrap=True)

    def ask(one: Step) -> bool:
        say(f"{one.title}: {one.moves}")
        return yes or typer.confirm("go on?", err=True)

    folder = writable_folder(out) or pathlib.Path()
    band = parse_band(sweep_band, load_case(case).settings.sample_rate_hz) or BAND_HZ
    choice = Choice(adapter=adapter, folder=linuxcnc)
    place = Place(make=partial(open_machine, choice), pace=paced()) if adapter != "simulator" else Place()
    course = Course(name=case, folder=folder, seed=seed, sweeps=sweeps, band_hz=band, place=place)
    answer = course.answer(course.go(step or (), ask, say))
    left = "the machine is armed" if answer["next"] is None else f"next: {answer['next']}"
    lines = [f"{row['name']:12}{row['state']}" for row in answer["steps"]]
    emit(answer, "\n".join([*lines, f"{left}; its case is {answer['machine']}"]), as_json)
