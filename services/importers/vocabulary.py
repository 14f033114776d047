"""What the names in other people's files mean: rates, periods, time, units, and what a channel measures."""

from __future__ import annotations

import math
import re

_RATES = frozenset((
    "fs", "sr", "fsample", "fsampling", "fsamp", "fsam", "fabtast", "samplerate", "samplingrate",
    "samplefrequency", "samplingfrequency", "samplefreq", "samplingfreq", "sfreq", "srate", "acquisitionrate",
    "acqrate", "scanrate", "datarate", "scanfrequency", "abtastrate", "abtastfrequenz", "samplespersecond",
))  # fmt: skip
_PERIODS = frozenset((
    "dt", "ts", "deltat", "deltax", "xdelta", "sampletime", "samplingtime", "sampleperiod", "samplingperiod",
    "sampleinterval", "samplinginterval", "wfincrement", "tinterval", "timestep", "timeincrement", "xincrement",
    "deltatime", "tsample", "tsampling", "abtastzeit",
))  # fmt: skip
_WHOLE = frozenset(("rate", "increment", "frequency"))
"""Words that mean sampling only when nothing stands before them: a feed rate is none."""
_PER_SECOND = {"hz": 1.0, "khz": 1e3, "mhz": 1e6, "sps": 1.0, "ksps": 1e3, "ss": 1.0, "kss": 1e3}
SECONDS = {"s": 1.0, "sec": 1.0, "secs": 1.0, "second": 1.0, "seconds": 1.0, "ms": 1e-3, "msec": 1e-3,
           "milliseconds": 1e-3, "us": 1e-6, "µs": 1e-6, "μs": 1e-6, "usec": 1e-6, "ns": 1e-9, "min": 60.0}  # fmt: skip
"""Units of time and what one of them is in seconds."""
_TIME = frozenset((
    "time", "zeit", "temps", "timestamp", "timestamps", "datetime", "clock", "elapsed", "tvec", "timevec",
    "timevector",
))  # fmt: skip
_INDEX = frozenset(("", "index", "idx", "n", "no", "nr", "sample", "samples", "unnamed", "row", "id", "i", "k"))
_UNITS = frozenset((
    "g", "mg", "m/s2", "m/s^2", "m/s²", "ms-2", "m_s2", "mm/s", "mm_s", "m/s", "m_s", "v", "mv", "uv", "µv", "a",
    "ma", "n", "kn", "nm", "n_m", "pa", "kpa", "bar", "db", "w", "kw", "um", "µm", "μm", "mm", "m", "nm", "deg",
    "rad", "rpm", "hz", "c", "degc", "°c", "k", "percent", "%", "-", "s", "ms", "us", "µs", "ns", "sec", "min",
    "1/min", "min-1", "lsb", "counts", "ipc",
))  # fmt: skip
_NAMED = re.compile(r"^(.*?)\s*[\[({<]\s*(?!\d+\s*\])([^\])}>]*?)\s*[\])}>]\s*$")
_CAMEL = re.compile(r"(?<=[a-z])(?=[A-Z])|(?<=[A-Za-z])(?=\d)|[^A-Za-zäöüÄÖÜµ°]+")


def words(name: str) -> list[str]:
    """Return the words of a name in small letters: `SamplingRate_Hz` is sampling, rate, hz."""
    return [word.lower() for word in _CAMEL.split(name) if word]


def split_unit(name: str) -> tuple[str, str]:
    """Return a name without its unit, and the unit: `force x [N]`, `force_n`, `F/N`."""
    named = _NAMED.match(name)
    if named and named.group(1):
        return named.group(1), named.group(2)
    for separator in ("_", "/", ", ", " in "):
        head, found, unit = name.rpartition(separator)
        longer, _, more = head.rpartition("_")
        if found and longer and f"{more}_{unit}".lower() in _UNITS:
            return longer, f"{more}_{unit}"
        if found and head and unit.lower() in _UNITS and not (separator == "/" and "_" in head):
            return head, unit
    return name, ""


def is_unit(text: str) -> bool:
    """Whether a cell holds a unit and nothing else."""
    bare = text.strip()
    inside = bare[1:-1].strip() if bare[:1] + bare[-1:] in ("[]", "()", "<>") else bare
    return inside.lower() in _UNITS


def rate_from(name: str, value: float, unit: str = "") -> float | None:
    """Return the sampling rate (Hz) that a named number tells, None if it is about something else."""
    if not (math.isfinite(value) and value > 0.0):
        return None
    bare, own = split_unit(name)
    parts, given = words(bare), (unit or own).lower().replace("/", "").strip()
    if len(parts) > 1 and parts[-1] in _PER_SECOND | SECONDS:
        given, parts = given or parts[-1], parts[:-1]
    tails = ["".join(parts[k:]) for k in range(len(parts))]
    if any(tail in _RATES for tail in tails) or (len(parts) == 1 and parts[0] in _WHOLE - {"increment"}):
        return value * _PER_SECOND.get(given, 1.0)
    if any(tail in _PERIODS for tail in tails) or parts == ["increment"]:
        return 1.0 / (value * SECONDS.get(given, 1.0))
    return None


def is_time(name: str) -> bool:
    """Whether a name is one of time: `t`, `Time (ms)`, `Data1_time_AI_1`, `Time - Voltage`."""
    parts = words(split_unit(name)[0])
    if not parts:
        return False
    return "time" in parts or parts[-1] in _TIME or parts[0] in _TIME - {"clock"} or parts == ["t"]


def is_index(name: str) -> bool:
    """Whether a name is one of a count of rows."""
    return "".join(words(name)) in _INDEX or name.strip() in ("#", "Unnamed: 0")


def seconds_per(name: str, unit: str = "") -> float | None:
    """Return what one unit of a time of this name is in seconds, None if the name does not tell."""
    return SECONDS.get((unit or split_unit(name)[1]).lower().strip())
