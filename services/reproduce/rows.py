"""One observation: what was printed, what the model computes, whether they agree and why."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, dataclass, replace
from typing import Any

Value = float | str | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One observation.

    Attributes
    ----------
    source
        Where it is printed.
    quantity
        What was observed.
    printed, computed
        In `unit`; a word where the print has only words, None where there is no value.
    expected
        What stands in place of the print where that is wrong or lost with its figure, from an independent calculation;
        None where the print itself is compared.
    unit
        Of both; empty for words and ratios.
    agrees
        Whether they agree within the tolerance that `why` states.
    why
        Why this tolerance, or why they do not agree.
    doubts
        What of the cut lies outside the range of the model, in words.
    """

    source: str
    quantity: str
    printed: Value
    computed: Value
    unit: str
    agrees: bool
    why: str
    doubts: tuple[str, ...] = ()
    expected: Value = None


def near(
    source: str,
    quantity: str,
    printed: float | None,
    computed: float | None,
    unit: str,
    *,
    within: float,
    why: str,
    otherwise: str = "",
    expected: float | None = None,
) -> Row:
    """Return a row that agrees if the computed value is `within` so much of the printed, or the expected, one."""
    target = printed if expected is None else expected
    agrees = computed is not None and target is not None and abs(computed - target) <= within
    said = f"within {within:.3g} {unit}".rstrip() + f": {why}"
    return Row(
        source=source,
        quantity=quantity,
        printed=printed,
        computed=computed,
        unit=unit,
        agrees=bool(agrees),
        why=said if agrees or not otherwise else f"not {said}. {otherwise}",
        expected=expected,
    )


def said(
    source: str, quantity: str, printed: str | None, computed: Value, agrees: bool, *, why: str, unit: str = "",
    expected: str | None = None,
) -> Row:  # fmt: skip
    """Return a row for something printed in words."""
    return Row(
        source=source, quantity=quantity, printed=printed, computed=computed, unit=unit, agrees=bool(agrees),
        why=why, expected=expected,
    )  # fmt: skip


def doubted(rows: Iterable[Row], doubts: Iterable[str]) -> list[Row]:
    """Return the rows of a cut with what lies outside the range of the model, each doubt once."""
    said = tuple(dict.fromkeys(doubts))
    return [replace(row, doubts=said) for row in rows]


def as_table(rows: Iterable[Row]) -> dict[str, Any]:
    """Return the keys of the command line: `agree` of `total` that have a print, and how many have none."""
    listed = [asdict(row) for row in rows]
    counted = [row["agrees"] for row in listed if row["printed"] is not None]
    others = [row["agrees"] for row in listed if row["printed"] is None]
    return {
        "rows": listed, "agree": sum(counted), "total": len(counted),
        "unprinted": len(others), "unprinted_hold": sum(others),
    }  # fmt: skip
