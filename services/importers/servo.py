"""Position and thrust of an axis from the channels of a recording, whatever they are called and measured in."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from services.errors import InputError
from services.importers.quantities import in_si, kind_of_unit
from services.importers.recording import Recording
from services.importers.roles import EFFORTS, roughness, told, twins
from services.importers.vocabulary import words
from services.messages import Floats

_GAINS = ("gtau", "gain", "kf", "kt", "km", "drivegain", "forceconstant", "motorconstant", "torqueconstant",
          "thrustconstant", "gaintau", "gf", "ktau", "torqueconst")  # fmt: skip
_LEADS = ("lead", "leadmm", "screwlead", "pitch", "spindlesteigung", "ballscrewlead", "leadm")
_MOST_TRAVEL = 10.0
"""No axis travels further (m): a position without a unit that does is not in metres."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Constants:
    """What a user says of a drive.

    Attributes
    ----------
    lead_m
        Travel in a turn of the motor (m).
    gain
        Thrust for one unit of the recorded effort (N).
    torque_constant
        (N m/A)
    """

    lead_m: float | None = None
    gain: float | None = None
    torque_constant: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Axis:
    """Signals of one axis in SI.

    Attributes
    ----------
    position_m, thrust_n
        shape (n,); NaN where samples are missing.
    stage_m
        Of a second encoder, shape (n,), None without one.
    rate_hz
        Sampling rate (Hz).
    channels
        Role -> name of the channel taken.
    notes
        What was assumed.
    """

    position_m: Floats
    thrust_n: Floats
    stage_m: Floats | None
    rate_hz: float
    channels: Mapping[str, str]
    notes: tuple[str, ...]


def axis_of(recording: Recording, constants: Constants) -> Axis:
    """Return position and thrust of a recording whose channels have roles.

    Parameters
    ----------
    recording
        From `with_roles`.
    constants
        As far as the user gives them; numbers in the file fill the gaps.
    """
    notes: list[str] = []
    place, effort = _position(recording, notes), _effort(recording, notes)
    lead = constants.lead_m or _lead(recording, notes)
    position = _metres(recording, place, lead, notes)
    thrust = _newtons(recording, effort, constants, lead, notes)
    stage = next((k for k, role in enumerate(recording.roles) if role == "stage" and k != place), None)
    second = None if stage is None else _metres(recording, stage, lead, notes)
    channels = {"position": recording.names[place], recording.roles[effort]: recording.names[effort]}
    if stage is not None:
        channels["stage"] = recording.names[stage]
    return Axis(
        position_m=position, thrust_n=thrust, stage_m=second, rate_hz=recording.rate_hz, channels=channels,
        notes=tuple(notes),
    )  # fmt: skip


def _position(recording: Recording, notes: list[str]) -> int:
    roles = recording.roles
    for wanted in ("position", "stage"):
        found = [k for k, role in enumerate(roles) if role == wanted]
        if found:
            motor = [k for k in found if "motor" in words(recording.names[k])]
            best = (motor or found)[0]
            if len(found) > 1:
                others = ", ".join(recording.names[k] for k in found if k != best)
                notes.append(f"{recording.names[best]} was taken for the position, not {others}")
            return best
    pair = [k for k in twins(recording) if roles[k] in ("other", "reference")]
    if pair:
        notes.append(f"{recording.names[pair[0]]} moves like a position that follows {recording.names[pair[-1]]}")
        return pair[0]
    smooth = [k for k, role in enumerate(roles) if role == "other" and roughness(recording.samples[:, k]) < 0.05]
    if len(smooth) == 1:
        notes.append(f"{recording.names[smooth[0]]} moves like a position and was taken for one")
        return smooth[0]
    raise _lacking(recording, "a position", "position:mm")


def _effort(recording: Recording, notes: list[str]) -> int:
    for wanted in EFFORTS:
        found = [k for k, role in enumerate(recording.roles) if role == wanted]
        measured = [k for k in found if not {"ref", "cmd", "command", "soll"} & set(words(recording.names[k]))]
        if found:
            best = (measured or found)[0]
            if len(found) > 1:
                others = ", ".join(recording.names[k] for k in found if k != best)
                notes.append(f"{recording.names[best]} was taken for the {wanted}, not {others}")
            return best
    raise _lacking(recording, "a thrust, torque, current or drive voltage", "thrust:N")


def _lacking(recording: Recording, what: str, example: str) -> InputError:
    found = ", ".join(told(recording))
    rule = f"said: {recording.source} holds {found}, but none of them is {what}; say it with --map CHANNEL={example}"
    return InputError("map", None, rule)


def _metres(recording: Recording, k: int, lead: float | None, notes: list[str]) -> Floats:
    kind = kind_of_unit(recording.units[k])
    values = in_si(recording, k, "length", "angle")
    name = recording.names[k]
    if kind == "angle":
        if lead is None:
            raise InputError("lead-mm", None, f"given: {name} is an angle, and travel in a turn is not known")
        return values * lead / (2.0 * math.pi)
    if kind is None:
        finite = values[np.isfinite(values)]
        if recording.units[k] or (finite.size and float(np.ptp(finite)) > _MOST_TRAVEL):
            said = recording.units[k] or f"no unit, and moves by {np.ptp(finite):.3g}"
            raise InputError(f"channel {name}", said, f"with a unit of length: say it with --map {name}=position:mm")
        notes.append(f"{name} has no unit and was taken for metres")
    return values


def _lead(recording: Recording, notes: list[str]) -> float | None:
    for key, value in recording.numbers.items():
        if "".join(words(key.rsplit(".", 1)[-1])) in _LEADS and value > 0.0:
            metres = value if value < 0.2 and "mm" not in words(key) else 1e-3 * value
            notes.append(f"the lead is {key} of the file: {1e3 * metres:g} mm")
            return metres
    return None


def _newtons(recording: Recording, k: int, constants: Constants, lead: float | None, notes: list[str]) -> Floats:
    kind, role, name = kind_of_unit(recording.units[k]), recording.roles[k], recording.names[k]
    values = in_si(recording, k, "force", "torque", "current", "voltage")
    if constants.gain is not None:
        return constants.gain * recording.samples[:, k]
    if kind == "force":
        return values
    if kind == "torque" or role == "torque" and not recording.units[k]:
        if kind is None:
            notes.append(f"{name} has no unit and was taken for newton metres")
        if lead is None:
            raise InputError("lead-mm", None, f"given: {name} is a torque, and travel in a turn is not known")
        return values * 2.0 * math.pi / lead
    if constants.torque_constant is not None and (kind == "current" or role == "current"):
        if lead is None:
            raise InputError("lead-mm", None, f"given: with --torque-constant, {name} makes a torque, not a thrust")
        return values * constants.torque_constant * 2.0 * math.pi / lead
    stated = [(key, value) for key, value in recording.numbers.items() if _is_gain(key)]
    if len(stated) == 1 and stated[0][1] != 0.0:
        key, value = stated[0]
        torque = "torque" in "".join(words(key)) and lead is not None
        notes.append(f"the thrust is {name} times {key} of the file, {value:g}" + (" (N m)" if torque else ""))
        return recording.samples[:, k] * value * (2.0 * math.pi / lead if torque and lead else 1.0)
    if role == "thrust" and kind is None and not recording.units[k]:
        notes.append(f"{name} has no unit and was taken for newtons")
        return values
    listed = f" (the file states {', '.join(key for key, _ in stated)})" if stated else ""
    unit = f"{name} [{recording.units[k]}]" if recording.units[k] else name
    rule = f"given: thrust (N) for one unit of {unit}, which is a {role}; or --torque-constant and --lead-mm{listed}"
    raise InputError("gain", None, rule)


def _is_gain(key: str) -> bool:
    return "".join(words(key.rsplit(".", 1)[-1])).removesuffix("npera").removesuffix("nperv") in _GAINS
