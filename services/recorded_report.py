"""The report of a recording: what was heard on the bus, and nothing that was computed beside it."""

from __future__ import annotations

import math
from html import escape
from pathlib import Path

from services.effects import with_advice
from services.observed import Observed
from services.report import NO_SAFETY, NOT_JUDGED, SIMULATED, advice, limits
from services.report_page import figures, folded, head, page, section, table
from services.sentences import NOTHING, number, verdict

CAPTIONS = {
    "force": (
        "The cutting force before and after.",
        "Left, short-time spectra of the force that the monitor estimated; darker is stronger. Right, its spectrum in "
        "two stretches, with the band in which chatter is looked for.",
    ),
    "indicator": (
        "How chatter was told from quiet cutting.",
        "The indicator is the root of the moving variance of the estimated force in the band, its limit is dashed. "
        "Points above the limit are purple.",
    ),
    "shift": (
        "What turret 1 was asked to do, and did.",
        "The shift is the angle that tool 1 moves round the bar. The tool moves along the surface (dy1') and slightly "
        "inwards (dx1).",
    ),
    "part": (
        "What is left along the part.",
        "Where a simulated machine told the truth: the surface, unrolled, and its roughness. Where nobody did: what "
        "the monitor heard at each place.",
    ),
}
NO_TRUTH = (
    "No truth was recorded: vibration, surface and roughness are not known. Measure the part. The map shows what the "
    "monitor heard, not what is on it."
)
TRUTH = "Vibration, surface and roughness are those that the model of the plant told; on a machine, measure the part."
ALONE = (
    "There was no cut without control beside this one: whether it would have chattered, when chatter began, and how "
    "long it took to find it are not known."
)
NO_CONFIG = (
    "The configuration was not recorded: which limits were in force is not known, and this run cannot be repeated."
)


def write_recorded_report(observed: Observed, directory: Path) -> Path:
    """Write `report.html` into `directory`, with the figures found there taken into the file."""
    directory.mkdir(parents=True, exist_ok=True)
    path = directory / "report.html"
    path.write_text(render_recorded(observed, directory), encoding="utf-8")
    return path


def _advice(observed: Observed) -> str:
    """Tell what the shift leaves on the part, and what else could be done, where the case is known."""
    if observed.case is None:
        return f"<p>{escape(NO_CONFIG)}</p>"
    return advice(with_advice(observed.case, observed.record))


def render_recorded(observed: Observed, directory: Path) -> str:
    """Compose the whole page; figures are read from `directory`, those missing are left out."""
    record, summary = observed.record, observed.summary
    body = "\n".join(
        (
            head(f"Report of a recording · {observed.path.name}", record, summary),
            section("What was recorded", _recorded(observed)),
            section("What happened", figures(directory, CAPTIONS)),
            section("Every change", _changes(observed)),
            section("Side effects and other ways", _advice(observed)),
            section("Limits in force", limits(record, summary) if observed.case else f"<p>{escape(NO_CONFIG)}</p>"),
            section("Configuration and versions", _configuration(observed)),
            section("What was not verified", _not_verified(observed)),
        )
    )
    footer = (
        f"antiphase {escape(record.versions.get('antiphase', ''))} · configuration "
        f"<code>{escape(record.config_hash or 'unknown')}</code> · {escape(observed.path.name)}"
    )
    return page(f"{verdict(record, summary).title} · {observed.path.name}", body, footer)


def _recorded(observed: Observed) -> str:
    told, record, summary = observed.metadata, observed.record, observed.summary
    known = ", ".join(f"{count} {name}" for name, count in observed.messages.items())
    clocks = {"wall": "when each message was received", "samples": "the samples of the machine (in lockstep)"}
    rows = [
        ("Machine", told.get("machine", NOTHING), ""),
        ("Run", observed.run or NOTHING, "identifier that the machine gave it"),
        ("Begun", told.get("begun_utc", NOTHING), "by the clock of the recorder"),
        ("Stretch", f"{record.origin_s:.2f} to {record.origin_s + summary.simulated_s:.2f} s",
         "since the machine's start; every time on this page counts from the beginning of the stretch"),
        ("Log times", clocks.get(told.get("clock", ""), NOTHING), ""),
        ("Messages", known, "in this stretch"),
        ("Missing", ", ".join(f"{n} {topic}" for topic, n in observed.missing.items()) or "none",
         "numbers that were skipped between the first and the last message; held from the one before"),
    ]  # fmt: skip
    notes = "".join(f"<li>{escape(note)}</li>" for note in observed.notes)
    listed = f'<ul class="limits-of-report">{notes}</ul>' if notes else ""
    return f'<div class="card">{table(("What", "Value", "Meaning"), rows, ("", "text", "note"))}</div>{listed}'


def _changes(observed: Observed) -> str:
    if not observed.changes:
        return "<p>Nothing changed.</p>"
    rows = [(f"{change.time_s:.3f} s", change.who, change.what) for change in observed.changes]
    return folded(table(("Time", "Who", "What"), rows, ("time", "kind", "text")), f"{len(rows)} changes", len(rows))


def _configuration(observed: Observed) -> str:
    record = observed.record
    versions = table(("Package", "Version"), sorted(record.versions.items()), ("", "value"))
    seed = observed.metadata.get("seed")
    words = f"seed {escape(seed)}" if seed else "the seed was not recorded"
    text = (
        f"<p>Configuration hash <code>{escape(record.config_hash)}</code>, {words}.</p>\n<details><summary>Resolved "
        f"configuration</summary><pre>{escape(record.config_text)}</pre></details>\n"
        if observed.case
        else f"<p>{escape(NO_CONFIG)}</p>\n"
    )
    return f"{text}<details><summary>Versions</summary>{versions}</details>"


def _not_verified(observed: Observed) -> str:
    record = observed.record
    lines = [
        *(f"Outside the range of the model, so do not trust the numbers above: {d}." for d in record.doubts),
        *((SIMULATED, TRUTH) if record.has_truth else (NO_TRUTH,)),
        ALONE,
        NO_SAFETY,
        "Whether the recorded commands were obeyed is told by the state of the machine, not measured.",
        NOT_JUDGED,
    ]
    if not observed.case:
        lines.insert(0, NO_CONFIG)
    listed = "".join(f"<li>{escape(line)}</li>" for line in lines)
    return f'<ul class="limits-of-report">{listed}</ul>'


def words(observed: Observed) -> str:
    """Return what happened, for a terminal."""
    said = verdict(observed.record, observed.summary)
    start, end = observed.record.origin_s, observed.record.origin_s + observed.summary.simulated_s
    config = observed.record.config_hash[:12] or number(math.nan, 0)
    about = f"{observed.path.name}: {start:.2f} to {end:.2f} s, configuration {config}"
    return "\n".join((said.title, *said.sentences, about))
