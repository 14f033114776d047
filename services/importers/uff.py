"""Universal files (UFF data set 58, ASCII and binary), by pyuff: time records, and frequency responses as they are."""

from __future__ import annotations

import pathlib
import struct
import warnings
from typing import Any

import numpy as np
import pyuff

from services.errors import InputError
from services.importers.recording import Recording
from services.importers.timebase import even, same_rate

_TIME, _FRF, _COHERENCE = 1, 4, 6
_WHAT = {0: "general", 2: "auto spectrum", 3: "cross spectrum", 4: "frequency response", 5: "transmissibility",
         6: "coherence", 7: "auto correlation", 9: "power spectral density", 12: "spectrum"}  # fmt: skip
_OF_TYPE = {8: ("displacement", "m"), 9: ("force", "N"), 11: ("velocity", "m/s"), 12: ("acceleration", "m/s^2"),
            13: ("force", "N")}  # fmt: skip
_DIRECTIONS = {1: "+x", 2: "+y", 3: "+z", -1: "-x", -2: "-y", -3: "-z", 0: ""}
_BROKEN = (OSError, ValueError, TypeError, KeyError, IndexError, EOFError, AttributeError, OverflowError,
           UnicodeError, struct.error, Exception)  # fmt: skip


def data_sets(path: pathlib.Path) -> list[dict[str, Any]]:
    """Return all data sets 58 of a file.

    Parameters
    ----------
    path
        Universal file.
    """
    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            file = pyuff.UFF(str(path))
            kinds = [str(int(kind)) for kind in np.atleast_1d(file.get_set_types())]
            return [dict(file.read_sets(k)) for k, kind in enumerate(kinds) if kind == "58"] or _none(path, kinds)
    except InputError:
        raise
    except _BROKEN as error:  # pyuff raises bare Exception
        rule = f"a readable universal file; it is damaged or ends early ({error})"
        raise InputError("file", str(path), rule) from error


def _none(path: pathlib.Path, kinds: list[str]) -> list[dict[str, Any]]:
    found = ", ".join(sorted(set(kinds))) or "nothing that is whole"
    raise InputError("file", str(path), f"a universal file with data sets 58 (found: {found})")


def read_uff(path: pathlib.Path, rate_hz: float | None) -> Recording:
    """Read the time records of `path`; repeated records of the same channels follow each other with a gap between."""
    sets = data_sets(path)
    times = [one for one in sets if int(one.get("func_type", 0)) == _TIME]
    if not times:
        found = ", ".join(sorted({_WHAT.get(int(one.get("func_type", 0)), "other") for one in sets}))
        raise InputError("file", str(path), f"a universal file with time records (found: {found})")
    channels: dict[tuple[str, str], list[dict[str, Any]]] = {}
    for one in times:
        channels.setdefault((name_of(one), unit_of(one)), []).append(one)
    first, notes = times[0], list[str]()
    rate = _rate(str(path), first, rate_hz)
    length = len(first["data"])
    runs = min(len(found) for found in channels.values())
    kept = {
        key: found[:runs] for key, found in channels.items()
        if all(len(one["data"]) == length and same_rate(_rate(str(path), one, rate_hz), rate) for one in found[:runs])
    }  # fmt: skip
    if len(kept) < len(channels):
        notes.append(f"{len(channels) - len(kept)} channels of another rate or length were left out")
    if runs > 1:
        notes.append(f"{runs} records of each channel were joined, with one missing sample between them")
    columns = [_run_on([np.real(np.asarray(one["data"])) for one in found]) for found in kept.values()]
    names, units = zip(*kept, strict=True)
    return Recording(
        source=str(path), rate_hz=rate, names=names, units=units, samples=np.column_stack(columns), notes=tuple(notes)
    )


def _run_on(parts: list[np.ndarray]) -> np.ndarray:
    gap = np.array([np.nan])
    return np.concatenate([piece for part in parts for piece in (part, gap)][:-1])


def _rate(source: str, one: dict[str, Any], option: float | None) -> float:
    step = float(one.get("abscissa_inc") or 0.0)
    if not int(one.get("abscissa_spacing", 1)):
        time = np.asarray(one["x"], dtype=np.float64)
        return even(source, time, np.zeros((len(time), 1)), [])[0]
    if not step > 0.0:
        if option is None:
            raise InputError("rate-hz", None, f"given: {source} does not tell the step of its time")
        return option
    if option is not None and not same_rate(option, 1.0 / step):
        raise InputError("rate-hz", option, f"the rate in {source} ({1.0 / step:.6g} Hz), or left out")
    return 1.0 / step


def name_of(one: dict[str, Any]) -> str:
    """Return the name of a record: what it measures and where.

    Parameters
    ----------
    one
        Data set 58.
    """
    what = _OF_TYPE.get(int(one.get("ordinate_spec_data_type", 0) or 0), (None, ""))[0]
    place = str(one.get("rsp_ent_name", "")).strip()
    place = "" if place.upper() == "NONE" else place
    where = f"{place}{int(one.get('rsp_node', 0))}{_DIRECTIONS.get(int(one.get('rsp_dir', 0)), '')}"
    title = str(one.get("id1", "")).strip()
    return f"{what} {where}" if what else (title if title and title.upper() != "NONE" else f"channel {where}")


def unit_of(one: dict[str, Any]) -> str:
    """Return the unit of a record.

    Parameters
    ----------
    one
        Data set 58.
    """
    label = str(one.get("ordinate_axis_units_lab", "")).strip()
    known = _OF_TYPE.get(int(one.get("ordinate_spec_data_type", 0) or 0), ("", ""))[1]
    return known if label.upper() in ("", "NONE") else label


def responses_of(path: pathlib.Path) -> tuple[Any, list[str]] | None:
    """Return the frequency responses in a file as an `Frf`, and their names; None if it has none.

    Parameters
    ----------
    path
        Universal file.
    """
    from chatter.identification import Frf

    sets = data_sets(path)
    found = [one for one in sets if int(one.get("func_type", 0)) == _FRF]
    if not found:
        return None
    lines = len(found[0]["data"])
    same = [one for one in found if len(one["data"]) == lines]
    hz = np.asarray(same[0]["x"], dtype=np.float64)
    if lines < 32 or (np.diff(hz) <= 0.0).any() or not np.allclose(np.diff(hz), hz[1] - hz[0], rtol=1e-3):
        rule = f"a universal file with at least 32 even lines of frequency ({lines} found)"
        raise InputError("file", str(path), rule)
    seen = {_place(one): np.real(one["data"]) for one in sets if int(one.get("func_type", 0)) == _COHERENCE}
    known = all(_place(one) in seen and len(seen[_place(one)]) == lines for one in same)
    frf = Frf(
        frequency_hz=hz, response=np.array([np.asarray(one["data"], dtype=np.complex128) for one in same]),
        coherence=np.array([seen[_place(one)] for one in same]) if known else None,
        band_hz=(float(hz[0] if hz[0] > 0.0 else hz[1]), float(hz[-1])), averages=0,
    )  # fmt: skip
    return frf, [name_of(one) for one in same]


def _place(one: dict[str, Any]) -> tuple[int, int, int, int]:
    rsp_node, rsp_dir, ref_node, ref_dir = (int(one.get(k, 0)) for k in ("rsp_node", "rsp_dir", "ref_node", "ref_dir"))
    return rsp_node, rsp_dir, ref_node, ref_dir
