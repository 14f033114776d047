"""Verbs for machines of one's own: `linuxcnc init` and `conform`."""

from __future__ import annotations

import pathlib
from collections.abc import Callable
from dataclasses import asdict
from typing import Annotated

import typer

from services.cli.app import Adapter, JsonFlag, LinuxcncDir, Seed, app, emit
from services.clock import WallClock
from services.config import load_case

verbs = typer.Typer(no_args_is_help=True, help="LinuxCNC as the machine.")
app.add_typer(verbs, name="linuxcnc")
CaseOption = Annotated[str, typer.Option("--case", help="Name of a shipped case, or path of a TOML file.")]


@verbs.command()
def init(
    directory: Annotated[pathlib.Path, typer.Argument(metavar="DIR", help="Folder that is written.")],
    case: CaseOption = "thesis-652",
    angle_deg: Annotated[
        float | None,
        typer.Option("--angle-deg", help="Between the two axes: 90 if the control hides the skew."),
    ] = None,
    as_json: JsonFlag = False,
) -> None:
    """Write INI, HAL and part program of a lathe in simulation whose turret 1 can be shifted."""
    from services.machines.linuxcnc.folder import init_folder

    written = init_folder(directory, load_case(case), angle_deg)
    words = "".join(f"wrote {path}\n" for path in written)
    emit({"folder": directory, "written": written}, f"{words}try it: antiphase doctor --linuxcnc {directory}", as_json)


@app.command()
def conform(
    adapter: Adapter = "simulator",
    case: CaseOption = "thesis-652",
    linuxcnc: LinuxcncDir = None,
    seed: Seed = None,
    as_json: JsonFlag = False,
) -> int:
    """Try whether a machine adapter publishes and obeys what it must; the turret moves by a degree, in air."""
    from services.machines.adapters import Choice, open_machine
    from services.machines.conformance import RUN, conformance

    config = load_case(case)
    used = config.settings.seed if seed is None else seed
    with open_machine(Choice(adapter=adapter, folder=linuxcnc), config, used, RUN) as node:
        found = conformance(node, config, paced() if adapter == "linuxcnc" else lambda: None)
    lines = [f"{'ok  ' if f.ok else 'FAIL'}  {f.name:32} {f.detail}" for f in found]
    emit({"adapter": adapter, "checks": [asdict(f) for f in found]}, "\n".join(lines), as_json)
    return 0 if all(f.ok for f in found) else 1


def paced() -> Callable[[], None]:
    """Return what waits for the next 10 ms; when it is late by more than a block, the schedule moves."""
    from services.messages import BLOCK_S

    clock = WallClock()
    due = [clock.now()]

    def wait() -> None:
        now = clock.now()
        due[0] = max(due[0] + BLOCK_S, now - BLOCK_S)
        clock.sleep_until(due[0])

    return wait
