"""Where a case leaves the range of its model: said with every result, and refused where nothing can be computed."""

from __future__ import annotations

from collections.abc import Generator, Iterable
from contextlib import contextmanager

from services.config import Case
from services.errors import RefusalError
from services.units import SI
from turning_sim import Doubt, SimulationDiverged, validity

_EDGE = {
    "depth_of_cut": ("depth_of_cut_mm", "mm"),
    "feed_per_tool": ("feed_per_tool_mm", "mm"),
    "spindle_hz": ("spindle_speed_rpm", "rpm"),
    "feed_force": ("feed_force_n", "n"),
    "shift": ("shift_deg", "deg"),
}


def doubts_of(case: Case, shift: float = 0.0, length: float | None = None) -> tuple[str, ...]:
    """Return what lies outside the range of the model over a whole cut, in words.

    Parameters
    ----------
    case
        The case.
    shift
        Largest shift of turret 1 (rad).
    length
        Of the cut (m); None for that of the case.
    """
    start, cutting = case.settings.start_position, case.cutting
    feed = case.settings.cut_time * cutting.feed_per_rev * cutting.spindle_hz if length is None else length
    end = min(start + feed, case.workpiece.length)
    found = {
        (doubt.name, doubt.most): in_words(doubt)
        for position in (end, start)
        for doubt in validity(
            case.workpiece, cutting, model=case.process, tool_position=position, shift=shift
        )
    }  # fmt: skip
    return tuple(found.values())


def in_words(doubt: Doubt) -> str:
    """Return one sentence in the units of a case file."""
    name, unit = _EDGE.get(doubt.name, (doubt.name, "hz"))
    return doubt.sentence(name, SI[unit])


def notes(doubts: Iterable[str]) -> str:
    """Return the lines that follow a result for people."""
    return "".join(f"\nnote: outside the range of the model: {doubt}" for doubt in doubts)


@contextmanager
def refusing(case: Case, keys: Iterable[str], shift: float = 0.0) -> Generator[None]:
    """Turn a plant that cannot go on into a refusal that says what lies outside the range of the model.

    Parameters
    ----------
    case
        The case.
    keys
        Of the result that there would have been; they are null in the refusal.
    shift
        Largest shift of turret 1 (rad).
    """
    try:
        yield
    except SimulationDiverged as error:
        doubts = doubts_of(case, shift)
        outside = f"; outside the range of the model: {'; '.join(doubts)}" if doubts else ""
        unknown: dict[str, object] = {key: None for key in keys}
        raise RefusalError(f"{error}{outside}", unknown | {"doubts": list(doubts)}) from error
