"""Named drives: TOML files turned into the axis as it is and the axis as an observer believes it to be."""

from __future__ import annotations

import dataclasses
import importlib.resources
import math
import pathlib
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from services.errors import InputError
from services.sections import CONTROL_UNITS, DRIVE_UNITS
from services.toml_section import Section, closest, read_section

ORIGINS = ("measured", "fitted", "published", "assumed")
"""Where a value may be from: a measurement, a fit to one, somebody's table, or nowhere."""

_LOOP_ONLY = ("scale_noise", "motor_friction", "presliding_stiffness")
_UNITS = {name: unit for name, unit in DRIVE_UNITS.items() if name not in _LOOP_ONLY} | {
    "screw_inertia": "kg_m2",
    "screw_damping": "n_m_s_per_rad",
    "coupling_stiffness": "n_per_m",
    "coupling_damping": "n_s_per_m",
    "screw_resolution": "nm",
    "screw_delay": "ms",
    "load": "n",
    "motor_noise": "nm",
    "stage_noise": "nm",
}
_FRICTION_UNITS = {
    "coulomb": "n",
    "static": "n",
    "stribeck_velocity": "mm_per_s",
    "viscous": "n_s_per_m",
    "bristle_stiffness": "n_per_m",
    "bristle_damping": "n_s_per_m",
}
_FRICTIONS = ("motor_friction", "stage_friction")
_WAVES = {"ripple": "n", "motor_error": "nm", "stage_error": "nm"}
_IDEAL = "current_bandwidth"


@dataclass(frozen=True, slots=True, kw_only=True)
class AxisSettings:
    """How a named drive is sampled and observed (SI).

    Attributes
    ----------
    title
        One line for people.
    source
        Where the drive is described.
    sample_rate_hz
        Of its servo.
    force_cutoff_hz
        Low-pass of its force estimate.
    """

    title: str
    source: str
    sample_rate_hz: float
    force_cutoff_hz: float

    def __post_init__(self) -> None:
        if not 100.0 <= self.sample_rate_hz <= 1e6:
            raise ValueError(f"sample_rate_hz must be in 100..1000000, got {self.sample_rate_hz}")
        if not 0.0 < self.force_cutoff_hz < self.sample_rate_hz / 2:
            raise ValueError(f"force_cutoff_hz must be in (0, rate / 2), got {self.force_cutoff_hz}")


@dataclass(frozen=True, slots=True, kw_only=True)
class NamedDrive:
    """A drive, its loops, and where each of its values is from.

    Attributes
    ----------
    name
        Word on the command line, or the stem of the file.
    settings
        How it is sampled and observed.
    drive, control
        The axis as it is, and its loops; no loops where the file has none.
    origin
        Key of the file -> "published: Table 3-3" and the like.
    """

    name: str
    settings: AxisSettings
    drive: Any
    control: Any
    origin: Mapping[str, str]

    def nominal(self, **factors: float) -> Any:
        """Return what an observer believes of the drive: its values, some of them wrong by a factor.

        Parameters
        ----------
        **factors
            Nominal over true, by field of `NominalFeedDrive`: `stage_mass=0.5`, or `motor_delay=0` for one ignored.

        Raises
        ------
        InputError
            For a field that there is not, or a factor that is not finite and at least 0.
        """
        from chatter.observers.nominal import NominalFeedDrive

        drive = self.drive
        viscous = [friction.viscous if friction else 0.0 for friction in (drive.motor_friction, drive.stage_friction)]
        screw = drive.screw_inertia or 0.0, drive.screw_damping or 0.0
        values = {
            "lead": drive.lead,
            "rotor_inertia": drive.motor_inertia + screw[0],
            "rotor_damping": drive.motor_damping + screw[1] + viscous[0] * drive.ratio**2,
            "stage_mass": drive.stage_mass,
            "stage_damping": drive.stage_damping + viscous[1],
            "screw_stiffness": drive.drive_stiffness,
            "screw_damping": drive.drive_damping,
            "omega_current": drive.current_bandwidth,
        }
        same = ("motor_resolution", "stage_resolution", "motor_delay", "stage_delay", "thrust_delay")
        values |= {name: getattr(drive, name) for name in same}
        for name, factor in factors.items():
            if name not in values:
                raise InputError(f"factor of {name}", factor, f"of one of {', '.join(values)}")
            if not (math.isfinite(factor) and factor >= 0.0):
                raise InputError(f"factor of {name}", factor, "finite and at least 0")
            values[name] *= factor
        try:
            return NominalFeedDrive(**values)
        except ValueError as error:
            raise InputError("nominal drive", str(factors), str(error)) from error


def shipped_drives() -> dict[str, pathlib.Path]:
    """Return the names of the shipped drives and where they are."""
    folder = pathlib.Path(str(importlib.resources.files("services.configs"))) / "drives"
    return {path.stem: path for path in sorted(folder.glob("*.toml"))}


def load_drive(name: str) -> NamedDrive:
    """Return a shipped drive, or the one in a TOML file.

    Parameters
    ----------
    name
        Name of a shipped drive or path of a file.

    Raises
    ------
    InputError
        Naming the key, its value and the rule that it breaks.
    """
    known = shipped_drives()
    path = known.get(name) or pathlib.Path(name)
    if not path.is_file():
        rule = f"one of {', '.join(known)}, or the path of a TOML file{closest(name, list(known))}"
        raise InputError("drive", name, rule)
    try:
        tables = tomllib.loads(path.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InputError("drive", str(path), f"a readable TOML file ({error})") from error
    return _built(path.stem, tables)


def drive_sections() -> dict[str, Section]:
    """Return the tables of a drive file that become one object each."""
    from turning_sim import AxisControl, AxisDrive, Friction, Wave

    friction = {name: Section(kind=Friction, units=_FRICTION_UNITS) for name in _FRICTIONS}
    waves = {
        name: Section(kind=Wave, units={"amplitude": unit, "wavelength": "um", "phase": "deg"})
        for name, unit in _WAVES.items()
    }
    return {
        "axis": Section(kind=AxisSettings, units={}),
        "drive": Section(kind=AxisDrive, units=_UNITS, given=(*friction, *waves)),
        "control": Section(kind=AxisControl, units=CONTROL_UNITS),
        **{f"drive.{below}": section for below, section in (friction | waves).items()},
    }


def _built(name: str, tables: Mapping[str, Any]) -> NamedDrive:
    sections = drive_sections()
    for key, value in tables.items():
        if key not in ("axis", "drive", "control", "origin"):
            raise InputError(key, str(value)[:60], "one of the tables axis, drive, control, origin")
    axis, drive = (_table(tables, key) for key in ("axis", "drive"))
    control = read_section(_table(tables, "control"), "control", sections["control"]) if "control" in tables else None
    return NamedDrive(
        name=name,
        settings=read_section(axis, "axis", sections["axis"]),
        drive=_drive(drive, sections),
        control=control,
        origin=_origins(tables),
    )


def _drive(table: Mapping[str, Any], sections: Mapping[str, Section]) -> Any:
    parts: dict[str, Any] = {}
    for name in _FRICTIONS:
        where = f"drive.{name}"
        below = _table(table, name, where) if name in table else None
        parts[name] = None if below is None else read_section(below, where, sections[where])
    for name in _WAVES:
        items = table.get(name, [])
        if not isinstance(items, list):
            raise InputError(f"drive.{name}", str(items)[:60], f"given as tables [[drive.{name}]]")
        where = f"drive.{name}"
        parts[name] = tuple(read_section(_whole(item, where), where, sections[where]) for item in items)
    plain, section = {key: value for key, value in table.items() if key not in parts}, sections["drive"]
    ideal = f"{_IDEAL}_{_UNITS[_IDEAL]}"
    if plain.get(ideal) == math.inf:
        parts[_IDEAL] = plain.pop(ideal)
        section = dataclasses.replace(section, given=(*section.given, _IDEAL))
    return read_section(plain, "drive", section, **parts)


def _table(tables: Mapping[str, Any], name: str, where: str = "") -> Mapping[str, Any]:
    return _whole(tables.get(name), where or name)


def _whole(found: Any, where: str) -> Mapping[str, Any]:
    if not isinstance(found, Mapping):
        raise InputError(where, None if found is None else str(found)[:60], f"given as a table [{where}]")
    return found


def _origins(tables: Mapping[str, Any]) -> dict[str, str]:
    """Return the origin of every value; one that has none is refused, and so is an origin of nothing."""
    words = ("title", "source")
    keys = [key for name in ("axis", "drive", "control") for key in tables.get(name, {}) if key not in words]
    origins = _table(tables, "origin")
    for key in keys:
        if key not in origins:
            raise InputError(f"origin.{key}", None, f"given in [origin]: {', '.join(ORIGINS)}, and where from")
    for key, value in origins.items():
        if key not in keys:
            raise InputError(f"origin.{key}", value, "the origin of a key of [axis], [drive] or [control]")
        if not isinstance(value, str) or value.split(":")[0] not in ORIGINS or len(value.split(":", 1)) < 2:
            raise InputError(f"origin.{key}", value, f"a text that begins with one of {', '.join(ORIGINS)} and a colon")
    return dict(origins)
