"""What all reports are made of: one HTML page that opens anywhere, offline, with everything in it."""

from __future__ import annotations

import base64
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from importlib.resources import files
from pathlib import Path

from services.metrics import Summary
from services.record import RunRecord
from services.sentences import tiles, verdict

TONE_WORDS = {"good": "Good", "warn": "Look closer", "bad": "Not good", "neutral": "Nothing to judge"}
ROWS_OPEN = 40
Captions = Mapping[str, tuple[str, str]]
"""Stem of a picture -> its title and what it shows."""


def page(title: str, body: str, footer: str) -> str:
    """Return a whole page; body and footer are HTML."""
    style = files("services").joinpath("report.css").read_text(encoding="utf-8")
    return (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; img-src data:; "
        "style-src 'unsafe-inline'\">\n"
        f'<link rel="icon" href="data:,">\n<title>{escape(title)}</title>\n'
        f"<style>\n{style}</style>\n</head>\n<body>\n<main>\n{body}\n"
        f"<footer>{footer}</footer>\n</main>\n</body>\n</html>\n"
    )


def head(over: str, record: RunRecord, summary: Summary) -> str:
    """Return title, verdict and the few numbers that matter."""
    judged = verdict(record, summary)
    sentences = "".join(f"<li>{escape(sentence)}</li>" for sentence in judged.sentences)
    shown = "".join(
        f"<div><dt>{escape(caption)}</dt><dd>{escape(value)}</dd></div>" for value, caption in tiles(record, summary)
    )
    partial = " · partial" if summary.interrupted else ""
    return (
        f'<header>\n<p class="over">{escape(over)}{partial}</p>\n'
        f"<h1>{escape(record.title)}</h1>\n</header>\n"
        f'<div class="verdict {judged.tone}">\n<p class="word">{TONE_WORDS[judged.tone]}</p>\n'
        f'<p class="title">{escape(judged.title)}</p>\n<ul>{sentences}</ul>\n</div>\n'
        f'<dl class="tiles">{shown}</dl>'
    )


def section(title: str, content: str) -> str:
    """Return a titled part of the page; the content is HTML."""
    return f"<section>\n<h2>{escape(title)}</h2>\n{content}\n</section>"


def figures(directory: Path, captions: Captions) -> str:
    """Return the pictures found in a folder, taken into the page; those missing are left out."""
    shown: list[str] = []
    for name, (title, text) in captions.items():
        path = directory / f"{name}.png"
        if not path.is_file():
            continue
        data = base64.b64encode(path.read_bytes()).decode("ascii")
        shown.append(
            f'<figure><div class="sheet"><img src="data:image/png;base64,{data}" alt="{escape(title)} {escape(text)}">'
            f"</div><figcaption><b>{escape(title)}</b> {escape(text)}</figcaption></figure>"
        )
    return "\n".join(shown) or "<p>No figures were drawn for this run.</p>"


def table(head: Sequence[str], rows: Iterable[Sequence[str]], classes: Sequence[str]) -> str:
    """Return a table; everything in it is text."""
    top = "".join(f'<th scope="col">{escape(word)}</th>' for word in head)
    body = "".join(
        "<tr>" + "".join(f'<td class="{c}">{escape(cell)}</td>' for cell, c in zip(row, classes, strict=True)) + "</tr>"
        for row in rows
    )
    return f"<table><thead><tr>{top}</tr></thead><tbody>{body}</tbody></table>"


def folded(content: str, words: str, rows: int) -> str:
    """Return a table as it stands, or folded behind a few words when it is long."""
    if rows <= ROWS_OPEN:
        return f'<div class="card">{content}</div>'
    return f"<details><summary>{escape(words)}</summary>{content}</details>"
