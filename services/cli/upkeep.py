"""Verbs for the installation: `certs` and `doctor`."""

from __future__ import annotations

import pathlib
from dataclasses import asdict
from typing import Annotated

import typer

from services.cli.app import JsonFlag, LinuxcncDir, app, emit
from services.clock import WallClock
from services.errors import InputError


@app.command()
def certs(
    out: Annotated[pathlib.Path, typer.Option("--out", help="Folder for keys and certificates.")] = pathlib.Path(
        "certs"
    ),
    days: Annotated[int, typer.Option("--days", help="For how long they are valid.")] = 365,
    host: Annotated[
        list[str] | None,
        typer.Option("--host", help="Name or address under which the router is reached; may be given several times."),
    ] = None,
    role: Annotated[list[str] | None, typer.Option("--role", help="One role; default: all.")] = None,
    as_json: JsonFlag = False,
) -> None:
    """Make a development authority and one certificate for each role, so that the bus asks everybody who he is."""
    from services.clock import utc_now
    from services.security.authority import make_authority

    names = make_authority(out, days, utc_now(), host or (), role or ())
    answer = {"folder": out, "files": names, "days": days}
    words = f"{len(names)} files in {out}, valid for {days} days; give --identity {out} to every service"
    emit(answer, f"{words}.\nKeep authority-key.pem elsewhere: who has it can be anybody.", as_json)


@app.command()
def doctor(
    identity: Annotated[
        pathlib.Path | None, typer.Option("--identity", help="Folder of certificates: probe every right of every role.")
    ] = None,
    connect: Annotated[
        str | None, typer.Option("--connect", help="The router to probe; default: one of its own.")
    ] = None,
    linuxcnc: LinuxcncDir = None,
    as_json: JsonFlag = False,
) -> int:
    """Check the installation, the compiled kernels, the clock, a Zenoh round trip and the rights on the bus."""
    from services.doctor import examine

    if connect is not None and identity is None:
        raise InputError("connect", connect, "given with --identity DIR: without certificates there are no rights")
    found = examine(WallClock(), identity, connect) if linuxcnc is None else []
    if linuxcnc is not None:
        from services.machines.linuxcnc.examine import examine_linuxcnc

        found = examine_linuxcnc(linuxcnc)
    lines = [f"{'ok  ' if f.ok else 'FAIL'}  {f.name:18} {f.detail}" for f in found]
    emit({"checks": [asdict(f) for f in found]}, "\n".join(lines), as_json)
    return 0 if all(f.ok for f in found) else 1
