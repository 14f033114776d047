"""Which channels of a recording show vibration: told from their names and units, and from what they hold."""

from __future__ import annotations

import numpy as np

from services.errors import InputError
from services.importers.recording import Recording
from services.importers.vocabulary import words
from services.messages import Floats

_KINDS: tuple[tuple[str, tuple[str, ...], tuple[str, ...]], ...] = (
    ("acceleration", ("acc", "accel", "beschl", "vib", "vibr", "schwing", "ax", "ay", "az"),
     ("g", "mg", "m/s2", "m/s^2", "m/s²", "ms-2", "m_s2", "mm/s", "mm_s")),
    ("force", ("force", "kraft", "fx", "fy", "fz", "fc", "ft", "fr", "thrust", "dyna", "bending"), ("n", "kn")),
    ("displacement", ("disp", "displ", "eddy", "laser", "deflection"), ("um", "µm", "μm")),
    ("sound", ("mic", "audio", "sound", "acoustic", "schall", "ae", "left", "right", "mono"), ("pa", "full scale")),
    ("current", ("current", "strom", "iq", "torque", "moment", "power"), ("a", "ma", "nm", "n_m", "w", "kw")),
)  # fmt: skip
_ASIDE = ("speed", "rpm", "tacho", "trigger", "trig", "index", "pos", "position", "encoder", "angle", "temp", "feed",
          "label", "class", "target", "valid", "counter", "count", "date", "time", "key", "pulse", "override",
          "drehzahl", "state", "ref", "setpoint")  # fmt: skip
_ASIDE_UNITS = ("rpm", "1/min", "min-1", "deg", "rad", "c", "°c", "degc", "k", "s", "ms", "mm", "m", "%")
UNKNOWN, ASIDE = len(_KINDS), len(_KINDS) + 1
"""Ranks: a channel of a known kind stands before one that nobody named, and that before one that is no vibration."""
_LEVELS = 3
_WHOLE = 0.5
"""Part of its samples that a channel must have to be taken unasked."""


def rank_of(name: str, unit: str) -> int:
    """Return how much a channel of this name looks like vibration; less is more."""
    parts, short = words(name), unit.lower().strip()
    for rank, (_, starts, _) in enumerate(_KINDS):
        if any(_begins(part, word) for part in parts for word in starts):
            return rank
    if any(_begins(part, word) for part in parts for word in _ASIDE):
        return ASIDE
    known = [rank for rank, (_, _, units) in enumerate(_KINDS) if short in units]
    return known[0] if known else ASIDE if short in _ASIDE_UNITS else UNKNOWN


def _begins(part: str, word: str) -> bool:
    return part.startswith(word) if len(word) > 3 else part == word


def kind_of(rank: int) -> str:
    """Return the word for a rank."""
    return _KINDS[rank][0] if rank < UNKNOWN else "channels"


def varies(x: Floats) -> bool:
    """Whether a channel holds more than one value."""
    finite = x[np.isfinite(x)]
    return bool(finite.size) and bool(finite.max() > finite.min())


def chosen(recording: Recording, wanted: list[str] | None) -> Recording:
    """Return a recording with the wanted channels only.

    Parameters
    ----------
    recording
        All channels.
    wanted
        Names, or numbers from 0; `all` for every channel that varies; None for those that look like vibration, all of
        one kind: a sum over kinds would compare newtons with volts.
    """
    if not wanted:
        return _taken(recording, _usual(recording))
    if "all" in wanted and "all" not in recording.names:
        return _taken(recording, _alive(recording) or list(range(len(recording.names))))
    return _taken(recording, list(dict.fromkeys(_index(recording, name) for name in wanted)))


def answers_to(name: str, unit: str, wanted: str) -> bool:
    """Whether a channel is the one that somebody asks for: by its name, its last part, or with its unit behind."""
    asked = _letters(wanted)
    return asked in {_letters(part + more) for part in (name, name.rsplit(".", 1)[-1]) for more in ("", unit)} - {""}


def _letters(text: str) -> str:
    return "".join(letter for letter in text.lower() if letter.isalnum())


def _index(recording: Recording, wanted: str) -> int:
    names = recording.names
    if wanted in names:
        return names.index(wanted)
    if wanted.isdigit() and int(wanted) < len(names):
        return int(wanted)
    alike = [k for k, name in enumerate(names) if answers_to(name, recording.units[k], wanted)]
    if len(alike) == 1:
        return alike[0]
    listed = ", ".join(f"{k}: {name}" for k, name in enumerate(names))
    raise InputError("channel", wanted, f"one of the channels of {recording.source} ({listed}), or all")


def _alive(recording: Recording) -> list[int]:
    return [k for k in range(len(recording.names)) if varies(recording.samples[:, k])]


def _usual(recording: Recording) -> list[int]:
    alive = _alive(recording)
    if len(alive) < 2:
        return alive or [0]
    told = {k: rank_of(recording.names[k], recording.units[k]) for k in alive}
    whole = [k for k in alive if np.isfinite(recording.samples[:, k]).mean() >= _WHOLE] or alive
    moving = [k for k in whole if not _is_slow_or_logic(recording.samples[:, k])] or whole
    best = min(told[k] for k in moving)
    return [k for k in moving if told[k] == best]


def _is_slow_or_logic(x: Floats) -> bool:
    """Whether a channel only rises or falls, or has few levels: a ramp, a trigger, a label."""
    finite = x[np.isfinite(x)]
    step = np.diff(finite)
    if (step >= 0.0).all() or (step <= 0.0).all():
        return True
    return np.unique(finite[:: max(1, finite.size // 5000)]).size <= _LEVELS


def _taken(recording: Recording, which: list[int]) -> Recording:
    for k in which:
        if not np.isfinite(recording.samples[:, k]).any():
            raise InputError("channel", recording.names[k], f"one that holds numbers in {recording.source}")
    return recording.only(which)
