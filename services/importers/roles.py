"""What each channel of a recording is: told by the user, by its name, by its unit, and in the end by how it moves."""

from __future__ import annotations

import pathlib
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from services.errors import InputError
from services.importers.channels import answers_to
from services.importers.quantities import kind_of_unit
from services.importers.recording import Recording
from services.importers.vocabulary import words
from services.messages import Floats

ROLES = ("position", "stage", "velocity", "reference", "thrust", "torque", "current", "voltage", "hammer", "response",
         "force", "other")  # fmt: skip
"""`position` is the motor's or the only one, `stage` a second encoder on the slide."""
_WORDS: tuple[tuple[str, tuple[str, ...]], ...] = (
    ("other", ("error", "err", "deviation", "following", "temperature", "temp", "status", "state", "index", "trigger",
               "comment", "override", "enable")),
    ("reference", ("ref", "reference", "cmd", "command", "commanded", "setpoint", "set", "target", "desired", "des",
                   "demand", "soll", "sollwert", "qg", "xref", "qref", "xd", "qd", "interpolated")),
    ("hammer", ("hammer", "impact", "exc", "excitation", "impulse", "hit")),
    ("stage", ("stage", "scale", "linear", "load", "table", "slide", "direct", "carriage", "xt")),
    ("velocity", ("velocity", "vel", "speed", "geschwindigkeit", "drehzahl", "dq", "qdot", "xdot", "vm")),
    ("torque", ("torque", "moment", "drehmoment", "tau", "tq", "trq")),
    ("current", ("current", "strom", "iq", "amps", "amp", "im")),
    ("thrust", ("thrust", "force", "kraft", "fx", "fy", "fz", "fm", "motorforce")),
    ("voltage", ("voltage", "vir", "volt", "volts", "spannung", "control", "ctrl", "drive", "input")),
    ("response", ("acc", "accel", "acceleration", "beschleunigung", "response", "resp", "accelerometer")),
    ("position", ("position", "pos", "encoder", "enc", "angle", "theta", "displacement", "lage", "weg", "qm", "xm",
                  "travel", "motor")),
)  # fmt: skip
_LETTERS = {"x": "position", "q": "position", "y": "position", "v": "velocity", "f": "thrust", "i": "current",
            "u": "voltage", "t": "torque", "a": "response"}  # fmt: skip
_OF_UNIT = {"length": "position", "angle": "position", "speed": "velocity", "rotation": "velocity", "force": "thrust",
            "torque": "torque", "current": "current", "voltage": "voltage", "acceleration": "response"}  # fmt: skip
EFFORTS = ("thrust", "torque", "current", "voltage")


@dataclass(frozen=True, slots=True)
class Said:
    """What a user says of a channel."""

    channel: str
    role: str
    unit: str | None


def mapping(texts: Sequence[str]) -> list[Said]:
    """Return what `--map` says: `channel=role`, `channel=role:unit`, or a TOML file with a table [channels].

    Parameters
    ----------
    texts
        As they stand on the command line.
    """
    return [said for text in texts for said in (_file(text) if text.endswith(".toml") else [_said(*_cut(text))])]


def _cut(text: str) -> tuple[str, str]:
    channel, found, what = text.rpartition("=")
    if not found or not channel or not what:
        raise InputError("map", text, "CHANNEL=ROLE or CHANNEL=ROLE:UNIT, or a TOML file with a table [channels]")
    return channel.strip(), what.strip()


def _said(channel: str, what: str) -> Said:
    role, found, unit = what.partition(":")
    role = role.strip().lower()
    if role not in ROLES:
        raise InputError("map", f"{channel}={what}", f"a channel and one of the roles {', '.join(ROLES)}")
    if found and kind_of_unit(unit.strip()) is None:
        raise InputError("map", f"{channel}={what}", f"a role and a unit that is known, not {unit.strip()!r}")
    return Said(channel, role, unit.strip() if found else None)


def _file(text: str) -> list[Said]:
    path = pathlib.Path(text)
    try:
        tables: dict[str, Any] = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InputError("map", text, f"a readable TOML file ({error})") from error
    channels = tables.get("channels")
    if not isinstance(channels, dict) or not channels:
        raise InputError("map", text, 'a file with a table [channels] of lines such as qm = "position:mm"')
    return [_said(str(name), str(what)) for name, what in channels.items()]


def with_roles(recording: Recording, said: Sequence[Said] = ()) -> Recording:
    """Return a recording whose channels have roles and units; `other` is what nobody can tell.

    Parameters
    ----------
    recording
        As read.
    said
        By the user; counts more than any name.
    """
    units = list(recording.units)
    roles = [role_of(name, unit) for name, unit in zip(recording.names, recording.units, strict=True)]
    for one in said:
        fitting = [k for k, n in enumerate(recording.names) if n == one.channel] or [
            k for k, n in enumerate(recording.names) if answers_to(n, units[k], one.channel)
        ]
        if not fitting and one.channel.isdigit() and int(one.channel) < len(units):
            fitting = [int(one.channel)]
        if len(fitting) != 1:
            listed = ", ".join(told(recording))
            raise InputError("map", one.channel, f"one of the channels of {recording.source}: {listed}")
        roles[fitting[0]] = one.role
        units[fitting[0]] = one.unit if one.unit is not None else units[fitting[0]]
    return replace(recording, roles=tuple(roles), units=tuple(units))


def told(recording: Recording) -> list[str]:
    """Return each channel with its unit and role, for messages."""
    roles = recording.roles or ("",) * len(recording.names)
    return [
        name + (f" [{unit}]" if unit else "") + (f" ({role})" if role else "")
        for name, unit, role in zip(recording.names, recording.units, roles, strict=True)
    ]


def role_of(name: str, unit: str) -> str:
    """Return the role that name and unit tell, `other` if they do not.

    Parameters
    ----------
    name, unit
        As in the file.
    """
    last = words(name.rsplit(".", 1)[-1]) or words(name)
    joined = "".join(last)
    kind = _OF_UNIT.get(kind_of_unit(unit) or "", "")
    named = next((role for role, starts in _WORDS if any(_is(part, starts) for part in (*last, joined))), "")
    if named == "reference" and kind in EFFORTS:
        return kind
    if named in ("stage", "reference", "position") and kind and kind != "position":
        return kind
    if named == "hammer" or not kind and named:
        return named
    if named in EFFORTS and kind in EFFORTS:
        return kind
    if not kind and len(last) <= 2 and last and last[0] in _LETTERS:
        return _LETTERS[last[0]]
    return named if named and named not in EFFORTS else kind or "other"


def _is(part: str, starts: Sequence[str]) -> bool:
    return any(part == start or (len(start) > 4 and part.startswith(start)) for start in starts)


def twins(recording: Recording) -> list[int]:
    """Return two channels that are nearly one: a position and its reference; measured first, empty if there are none.

    Parameters
    ----------
    recording
        With channels of which nobody has told the role.
    """
    smooth = [k for k in range(len(recording.names)) if roughness(recording.samples[:, k]) < 0.2]
    pairs = [(a, b) for i, a in enumerate(smooth) for b in smooth[i + 1 :] if _alike(recording.samples[:, [a, b]])]
    if not pairs:
        return []
    noise = {k: _noise(recording.samples[:, k]) for k in pairs[0]}
    return sorted(noise, key=lambda k: -noise[k])


def roughness(x: Floats) -> float:
    """Return how much a channel moves from sample to sample, over how much it moves at all.

    Parameters
    ----------
    x
        shape (n,)
    """
    finite = x[np.isfinite(x)]
    spread = float(np.std(finite)) if finite.size > 2 else 0.0
    return float(np.std(np.diff(finite))) / spread if spread > 0.0 else np.inf


def _alike(pair: Floats) -> bool:
    both = pair[np.isfinite(pair).all(axis=1)]
    if len(both) < 8 or (np.ptp(both, axis=0) == 0.0).any():
        return False
    return float(np.std(both[:, 0] - both[:, 1])) < 0.05 * float(np.std(both[:, 0]))


def _noise(x: Floats) -> float:
    return float(np.median(np.abs(np.diff(x[np.isfinite(x)], 4))))
