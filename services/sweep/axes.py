"""What a sweep varies: words of the command line, keys of a case, units."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from services.errors import InputError

MOST_CELLS = 1_000_000
Value = float | str


@dataclass(frozen=True, slots=True, kw_only=True)
class Kind:
    """Something that can be varied.

    Attributes
    ----------
    option
        Word of the command line.
    name
        Of the dimension, with its unit.
    label
        For axes of figures.
    key
        Key of the case that it replaces; empty where it needs more than that.
    words
        Whether its values are words.
    """

    option: str
    name: str
    label: str
    key: str = ""
    words: bool = False


KINDS = (
    Kind(option="phase", name="phase_pi", label="phase difference Δε/π at the reference frequency"),
    Kind(option="speed-rpm", name="speed_rpm", label="spindle speed (1/min)", key="cutting.spindle_speed_rpm"),
    Kind(option="depth-mm", name="depth_mm", label="depth of cut (mm)"),
    Kind(option="overhang-mm", name="overhang_mm", label="projection of the bar (mm)", key="workpiece.length_mm"),
    Kind(option="noise", name="noise_n_per_rthz", label="force noise (N/√Hz)", key="cutting.force_noise_n_per_rthz"),
    Kind(option="stiffness", name="stiffness_ratio", label="cutting stiffness over that of the case"),
    Kind(option="estimator", name="estimator", label="estimator", key="case.force_estimator", words=True),
    Kind(option="sensitivity", name="sensitivity", label="sensitivity of the detector", key="monitor.sensitivity"),
    Kind(option="seed", name="seed", label="seed"),
)
BY_OPTION = {kind.option: kind for kind in KINDS}


@dataclass(frozen=True, slots=True, kw_only=True)
class Axis:
    """One dimension of a sweep.

    Attributes
    ----------
    kind
        What is varied.
    values
        In order.
    """

    kind: Kind
    values: tuple[Value, ...]


def parse_axis(option: str, text: str) -> Axis:
    """Return the axis that `A:B:STEP` (B included), `a,b,c` or a single value stands for.

    Parameters
    ----------
    option
        Word of the command line.
    text
        What the user wrote.
    """
    kind = BY_OPTION[option]
    if kind.words:
        return Axis(kind=kind, values=_distinct(option, text, tuple(text.split(","))))
    try:
        numbers = _steps(option, text) if ":" in text else tuple(float(part) for part in text.split(","))
    except ValueError as error:
        raise InputError(option, text, "A:B:STEP (B included), or numbers with commas between them") from error
    if not all(math.isfinite(value) for value in numbers):
        raise InputError(option, text, "finite numbers")
    return Axis(kind=kind, values=_distinct(option, text, numbers))


def _steps(option: str, text: str) -> tuple[float, ...]:
    low, high, step = (float(part) for part in text.split(":"))
    if not (math.isfinite(low) and math.isfinite(high) and math.isfinite(step)) or step == 0 or (high - low) / step < 0:
        raise InputError(option, text, "A:B:STEP with a step that leads from A to B")
    count = math.floor((high - low) / step + 1e-9) + 1
    if count > MOST_CELLS:
        raise InputError(option, text, f"at most {MOST_CELLS} values")
    return tuple(round(low + step * k, 12) for k in range(count))


def _distinct(option: str, text: str, values: tuple[Value, ...]) -> tuple[Value, ...]:
    if not values or len(set(values)) < len(values) or "" in values:
        raise InputError(option, text, "values that differ from each other")
    return values


def cells_of(axes: Sequence[Axis]) -> int:
    """Return how many cells the axes span, or say that they are too many."""
    count = math.prod(len(axis.values) for axis in axes)
    if count > MOST_CELLS:
        raise InputError("cells", count, f"at most {MOST_CELLS}")
    return count


def grid(axes: Sequence[Axis]) -> Iterator[tuple[int, dict[str, Value]]]:
    """Yield the number and the values, by name, of every cell, the last axis running fastest."""
    names = [axis.kind.name for axis in axes]
    for number, values in enumerate(itertools.product(*(axis.values for axis in axes))):
        yield number, dict(zip(names, values, strict=True))
