"""Whether a folder of LinuxCNC can be shifted: what `doctor --linuxcnc DIR` looks at, without starting it."""

from __future__ import annotations

import pathlib
import re
import subprocess

from services.doctor import Finding
from services.errors import InputError
from services.machines.linuxcnc.control import INSTALL, SYSTEM_PATH, installed, old_version, running
from services.machines.linuxcnc.folder import missing_lines
from services.machines.linuxcnc.settings import Settings, load_settings


def examine_linuxcnc(folder: pathlib.Path) -> list[Finding]:
    """Look at installation, version, INI, HAL, the room of each axis, and whether another LinuxCNC runs."""
    why = installed()
    found = [_finding("linuxcnc", why, "installed")]
    if not why:
        version = _version()
        found.append(_finding("version", old_version(version), version))
        found.append(_finding("no other control", running(), "none is running"))
    try:
        settings = load_settings(folder)
    except InputError as error:
        return [*found, _finding("ini", str(error), "")]
    missing = missing_lines(settings)
    lack = f"{len(missing)} lines missing, first: {missing[0]} (compare `antiphase linuxcnc init`)" if missing else ""
    return [
        *found,
        _finding("ini", "", str(settings.path)),
        _finding("hal", lack, "bounds and watchdog are in the servo thread"),
        *_axes(settings),
    ]


def _axes(settings: Settings) -> list[Finding]:
    return [
        _finding(
            f"axis {axis.letter}", axis.room(0.0, settings.clearance_mm),
            f"{what}, offset {axis.low_mm:g}..{axis.high_mm:g} mm at {axis.speed_mm_per_s:g} mm/s and "
            f"{axis.acceleration_mm_per_s2:g} mm/s^2",
        )
        for axis, what in ((settings.first, "along X1"), (settings.second, "round the bar"))
    ]  # fmt: skip


def _version() -> str:
    said = subprocess.run(
        ["linuxcnc_var", "LINUXCNCVERSION"], capture_output=True, text=True, check=False, env={"PATH": SYSTEM_PATH}
    )
    return said.stdout.strip() if re.match(r"\d", said.stdout) else f"unknown; {INSTALL}"


def _finding(name: str, wrong: str, right: str) -> Finding:
    return Finding(name=name, ok=not wrong, detail=wrong or right)
