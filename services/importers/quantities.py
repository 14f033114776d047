"""Units in other people's files: what they measure and what one of them is in SI."""

from __future__ import annotations

import math

from services.errors import InputError
from services.importers.recording import Recording
from services.messages import Floats

_G, _LBF = 9.80665, 4.4482216152605
_UNITS: dict[str, tuple[str, float]] = {
    "m": ("length", 1.0), "mm": ("length", 1e-3), "cm": ("length", 1e-2), "um": ("length", 1e-6),
    "nm": ("length", 1e-9), "in": ("length", 0.0254), "inch": ("length", 0.0254), "mil": ("length", 2.54e-5),
    "rad": ("angle", 1.0), "deg": ("angle", math.pi / 180.0), "°": ("angle", math.pi / 180.0),
    "rev": ("angle", 2.0 * math.pi), "turns": ("angle", 2.0 * math.pi), "mrad": ("angle", 1e-3),
    "m/s": ("speed", 1.0), "mm/s": ("speed", 1e-3), "m/min": ("speed", 1.0 / 60.0), "mm/min": ("speed", 1e-3 / 60.0),
    "rad/s": ("rotation", 1.0), "rpm": ("rotation", math.pi / 30.0), "1/min": ("rotation", math.pi / 30.0),
    "min-1": ("rotation", math.pi / 30.0), "rev/s": ("rotation", 2.0 * math.pi), "deg/s": ("rotation", math.pi / 180.0),
    "n": ("force", 1.0), "newton": ("force", 1.0), "newtons": ("force", 1.0), "kn": ("force", 1e3),
    "mn": ("force", 1e-3), "dan": ("force", 10.0), "lbf": ("force", _LBF), "lb": ("force", _LBF),
    "lbs": ("force", _LBF), "kgf": ("force", _G), "kp": ("force", _G), "ozf": ("force", _LBF / 16.0),
    "n m": ("torque", 1.0), "mn m": ("torque", 1e-3), "lbf in": ("torque", _LBF * 0.0254),
    "lbf ft": ("torque", _LBF * 0.3048), "kn m": ("torque", 1e3), "ncm": ("torque", 1e-2),
    "a": ("current", 1.0), "ma": ("current", 1e-3), "amp": ("current", 1.0), "amps": ("current", 1.0),
    "arms": ("current", 1.0), "apk": ("current", 1.0),
    "v": ("voltage", 1.0), "mv": ("voltage", 1e-3), "volt": ("voltage", 1.0), "volts": ("voltage", 1.0),
    "m/s2": ("acceleration", 1.0), "mm/s2": ("acceleration", 1e-3), "g": ("acceleration", _G),
    "mg": ("acceleration", 1e-3 * _G), "gn": ("acceleration", _G), "in/s2": ("acceleration", 0.0254),
    "s": ("time", 1.0), "ms": ("time", 1e-3), "us": ("time", 1e-6), "hz": ("frequency", 1.0),
}  # fmt: skip
_EXACT: dict[str, str] = {"Nm": "n m", "N.m": "n m", "N·m": "n m", "N-m": "n m", "N*m": "n m", "mNm": "mn m",
                          "kNm": "kn m", "Ncm": "ncm", "lb-in": "lbf in", "in-lb": "lbf in", "ft-lb": "lbf ft",
                          "lb-ft": "lbf ft", "n_m": "n m", "m_s2": "m/s2", "mm_s": "mm/s", "m_s": "m/s"}  # fmt: skip


def _plain(unit: str) -> str:
    text = unit.strip().strip("[]()").strip()
    if text in _EXACT:
        return _EXACT[text]
    text = text.replace("µ", "u").replace("μ", "u").replace("²", "2").replace("^2", "2").replace("**2", "2")
    text = text.replace("·", " ").replace("m s-2", "m/s2").replace("ms-2", "m/s2").replace("m/s/s", "m/s2")
    return text.lower()


def kind_of_unit(unit: str) -> str | None:
    """Return what a unit measures, None if it is not known.

    Parameters
    ----------
    unit
        As written: `mm`, `Nm`, `m/s²`.
    """
    return _UNITS.get(_plain(unit), (None, 0.0))[0]


def si_factor(unit: str) -> float:
    """Return what one of a unit is in SI; 1 for a unit that is not known.

    Parameters
    ----------
    unit
        As written.
    """
    return _UNITS.get(_plain(unit), ("", 1.0))[1]


def in_si(recording: Recording, k: int, *kinds: str) -> Floats:
    """Return a channel in SI, shape (n,).

    Parameters
    ----------
    recording
        Any.
    k
        Number of the channel.
    *kinds
        What it may measure; a unit of another kind is an error, no unit is none.
    """
    kind = kind_of_unit(recording.units[k])
    if kind is not None and kind not in kinds:
        rule = f"with a unit of {' or '.join(kinds)}, not of {kind}: --map says another role or unit"
        raise InputError(f"channel {recording.names[k]}", recording.units[k], rule)
    return recording.samples[:, k] * si_factor(recording.units[k])
