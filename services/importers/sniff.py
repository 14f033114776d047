"""Where the table in a text file begins, what separates its cells, and what stands above it."""

from __future__ import annotations

import codecs
import csv
import pathlib
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from services.errors import InputError
from services.importers.vocabulary import is_unit, rate_from

_LOOKED_AT = 400
_COMMENT = ("#", "%", "//", "!", "*")
_MISSING = frozenset(("", "nan", "na", "n/a", "-", "--", "null", "none", "inf", "-inf", "+inf", "#n/a", "?"))
_STATED = re.compile(
    r"^(?P<name>[^\d:=;\t,]*[^\d:=;\t,\s(\[])\s*(?:[(\[](?P<own>[^)\]]*)[)\]])?\s*(?:[:=;\t,]|\s)\s*"
    r"(?P<value>[-+]?[\d.]+(?:,\d+)?(?:[eE][-+]?\d+)?)\s*(?P<unit>[A-Za-zµ/]*)"
)
_DATE = re.compile(
    r"\d{1,4}([-./:])(\d{1,2}|[A-Za-z]{3})\1\d{1,4}([.,]\d+)?([T ]+[\d:.,]+ ?([AaPp][Mm]|Z|[-+]\d\d:?\d\d)?)?"
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Layout:
    """How a text holds its table.

    Attributes
    ----------
    separator
        Between two cells; None for white space.
    decimal_comma
        Whether numbers are written 0,5.
    first
        Line of the first row of numbers.
    names, units
        Of the columns; empty where the text does not tell.
    rate_hz
        As stated above the table, None if nothing is.
    named
        Whether there is a row of names.
    """

    separator: str | None
    decimal_comma: bool
    first: int
    names: tuple[str, ...]
    units: tuple[str, ...]
    rate_hz: float | None
    named: bool


def text_of(path: pathlib.Path) -> str:
    """Return the text of a file in UTF-8, UTF-16 or Latin-1, or say that it is none."""
    return decoded(path.read_bytes(), str(path))[0]


def decoded(raw: bytes, source: str) -> tuple[str, str]:
    """Return bytes as text, and the name of its coding.

    Parameters
    ----------
    raw
        A file or its beginning.
    source
        For messages.
    """
    coding = "utf-8-sig"
    if raw[:2] in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE):
        return raw.decode("utf-16", errors="replace"), "utf-16"
    try:
        text = codecs.getincrementaldecoder("utf-8-sig")().decode(raw, final=False)
    except UnicodeDecodeError:
        text, coding = raw.decode("latin-1"), "latin-1"
        odd = sum(letter < " " and letter not in "\t\r\n\f" or "\x7f" <= letter < "\xa0" for letter in text[:4096])
        if odd > 8:
            raise InputError("file", source, "a CSV in text (this looks like binary data)") from None
    if "\0" in text[:65536]:
        raise InputError("file", source, "a CSV in text (this looks like binary data)")
    return text, coding


def cells_of(line: str, separator: str | None) -> list[str]:
    """Return the cells of a line, without the blanks around them."""
    if separator is None:
        return line.split()
    cells = line.split(separator) if '"' not in line else next(csv.reader([line], delimiter=separator))
    return [cell.strip() for cell in cells]


def number(cell: str, decimal_comma: bool) -> float | None:
    """Return a cell as a number, None if it is none."""
    try:
        return float(cell.replace(",", ".") if decimal_comma else cell)
    except ValueError:
        return None


def layout_of(lines: Sequence[str], source: str) -> Layout:
    """Find the table in the lines of a text.

    Raises
    ------
    InputError
        If there is no table of numbers.
    """
    head = [_bare(line) for line in lines[:_LOOKED_AT]]
    data = [k for k, line in enumerate(lines[:_LOOKED_AT]) if line.strip() and not line.lstrip().startswith(_COMMENT)]
    separator, comma, pattern = _style([head[k] for k in data[len(data) // 2 :]])
    matching = [k for k in data if _fits(cells_of(head[k], separator), comma, pattern)]
    if not matching:
        shown = next((line.strip() for line in lines if line.strip()), "")
        rule = "a CSV of numbers whose first row names the columns with their units"
        raise InputError("file", source, f"{rule}; none of its lines is a row of numbers (it begins {shown[:60]!r})")
    first = matching[0]
    above = [cells_of(head[k], separator) for k in range(max(0, first - 4), first) if head[k].strip()]
    names, units = _names(above, len(pattern))
    if not names and _counts(cells_of(head[first], separator)) and len(matching) > 1:
        names, first = tuple(cells_of(head[first], separator)), matching[1]  # a frame written with numbers for names
    return Layout(
        separator=separator,
        decimal_comma=comma,
        first=first,
        names=names or tuple(f"ch{k}" for k in range(len(pattern))),
        units=units or ("",) * len(pattern),
        rate_hz=_stated(head[:first]),
        named=bool(names),
    )


def _bare(line: str) -> str:
    bare = line.rstrip("\r\n")
    return bare.lstrip().lstrip("#%!*/").strip() if bare.lstrip().startswith(_COMMENT) else bare


def _style(lines: Sequence[str]) -> tuple[str | None, bool, tuple[bool, ...]]:
    """Return separator, decimal comma, and which columns hold numbers, as most of the lines have it."""
    best, style = (0, 0.0), (",", False, (False,))
    joined = "\n".join(lines)
    found = [mark for mark in (";", "\t", ",", "|") if mark in joined]
    for separator, comma in [(mark, comma) for mark in (*found, None) for comma in (False, True)]:
        if separator == "," and comma:
            continue
        rows = [cells_of(line, separator) for line in lines if line.strip()]
        for pattern, _ in Counter(_pattern(cells, comma) for cells in rows).most_common(3):
            if separator is None and comma and len(pattern) < 2:
                continue
            cells_read = sum(_fits(cells, comma, pattern) for cells in rows) * sum(pattern)
            score = (cells_read, sum(pattern) / max(len(pattern), 1))
            if score > best:
                best, style = score, (separator, comma, pattern)
    return style


def _pattern(cells: Sequence[str], comma: bool) -> tuple[bool, ...]:
    return tuple(number(cell, comma) is not None or bool(_DATE.fullmatch(cell)) for cell in cells)


def _fits(cells: Sequence[str], comma: bool, pattern: Sequence[bool]) -> bool:
    """Whether a line is a row of the table: numbers, dates or nothing where the others have numbers."""
    if len(cells) != len(pattern) or not any(pattern):
        return False
    have = _pattern(cells, comma)
    missing = [cell.lower() in _MISSING for cell in cells]
    return any(h and p for h, p in zip(have, pattern, strict=True)) and all(
        h or m or not p for h, m, p in zip(have, missing, pattern, strict=True)
    )


def _names(above: Sequence[Sequence[str]], columns: int) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return names and units from the lines above the table."""
    rows = [list(cells) for cells in above if len(cells) in (columns, columns - 1) and any(cells)]
    rows = [[""] * (columns - len(cells)) + cells for cells in rows]
    if not rows:
        return (), ()
    units = rows.pop() if len(rows) > 1 and all(is_unit(cell) or not cell for cell in rows[-1]) else []
    bare = tuple(cell.strip("[]()<> ") for cell in units)
    rows = [cells for cells in rows if not any(number(cell, True) is not None for cell in cells)] or rows[-1:]
    return (tuple(rows[-1]), bare) if rows else ((), bare)


def _counts(cells: Sequence[str]) -> bool:
    filled = cells[1:] if cells and not cells[0] else cells
    return len(filled) > 1 and list(filled) == [str(k) for k in range(len(filled))]


def _stated(lines: Sequence[str]) -> float | None:
    """Return the rate (Hz) that a line above the table states."""
    for line in lines:
        for part in (line, *re.split(r"[;,\t]\s*(?=[A-Za-z])", line)):
            match = _STATED.match(part.strip().replace('"', ""))
            value = number(match.group("value"), True) if match else None
            if match and value is not None:
                found = rate_from(match.group("name").strip(), value, match.group("unit") or match.group("own") or "")
                if found is not None:
                    return found
    return _below(lines)


def _below(lines: Sequence[str]) -> float | None:
    """Return the rate (Hz) that stands below its name, as in a table of two lines."""
    for names, values in zip(lines, lines[1:], strict=False):
        pairs = zip(re.split(r"[;,\t]", names), re.split(r"[;,\t]", values), strict=False)
        told = ((name.strip(), number(cell.strip(), False)) for name, cell in pairs)
        rates = (rate_from(name, value) for name, value in told if value is not None)
        found = next((rate for rate in rates if rate is not None), None)
        if found is not None:
            return found
    return None
