"""The page for reviewers says what the program does; `python -m tests.services.test_safety` writes its limits."""

import dataclasses
import math
import pathlib
import re

from services.config import load_case
from services.guard_limits import GuardLimits

ROOT = pathlib.Path(__file__).resolve().parents[2]
PAGE = ROOT / "services" / "SAFETY.md"


def limits_table():
    """Name, value in `thesis-652`, unit and meaning of every limit, from the type and its docstring."""
    limits = load_case("thesis-652").limits
    units = {field.name: field.metadata["unit"] for field in dataclasses.fields(GuardLimits)}
    lines = ["| limit | `thesis-652` | meaning |", "|---|---|---|"]
    found = re.findall(r"^ {4}(\w[\w, ]*) : .*\n((?: {8}.*\n)+)", GuardLimits.__doc__, re.M)
    for names, meaning in found:
        values = []
        for name in names.split(", "):
            value, unit = getattr(limits, name), units[name]
            if unit.startswith("rad"):
                value, unit = math.degrees(value), unit.replace("rad", "deg")
            values.append(f"{value:g} {unit}".strip() if isinstance(value, float) else f"{value} {unit}".strip())
        text = re.sub(r" \((rad|m|s|Hz)[^)]*\)", "", " ".join(meaning.split()))
        lines.append(f"| {', '.join(f'`{name}`' for name in names.split(', '))} | {', '.join(values)} | {text} |")
    assert sum(line.count("`") // 2 for line in lines[2:]) >= len(units)
    return "\n".join(lines)


def between(text, name):
    return text.split(f"<!-- {name} -->\n")[1].split(f"<!-- /{name} -->")[0]


def test_the_limits_on_the_page_are_those_of_the_guard():
    assert between(PAGE.read_text(), "limits") == limits_table() + "\n"


def test_every_limit_is_on_the_page():
    table = between(PAGE.read_text(), "limits")
    assert all(f"`{field.name}`" in table for field in dataclasses.fields(GuardLimits))


def test_the_page_says_what_it_is_not():
    text = " ".join(PAGE.read_text().split())
    norms = ("ISO 12100", "ISO 13849-1", "ISO 23125")
    for words in ("not a safety function", "no performance level", "never clears", *norms):
        assert words in text
    limits = load_case("thesis-652").limits
    for name, value in (("T1", limits.loss_hold), ("T2", limits.loss_return), ("T3", limits.loss_fault)):
        assert f"{name} = {value:g} s" in text or f"{name} = {value:.1f} s" in text
    assert "services/SAFETY.md" in (ROOT / "README.md").read_text()
    assert "SAFETY.md" in (ROOT / "pyproject.toml").read_text()


if __name__ == "__main__":
    before = PAGE.read_text()
    PAGE.write_text(before.replace(between(before, "limits"), limits_table() + "\n") if between(before, "limits")
                    else before.replace("<!-- limits -->\n", f"<!-- limits -->\n{limits_table()}\n"))  # fmt: skip
