"""The report of a run: one HTML file that opens anywhere, offline, with everything in it."""

from __future__ import annotations

import json
import math
from html import escape
from pathlib import Path

from services.metrics import Summary
from services.record import RunRecord
from services.report_page import figures, folded, head, page, section, table
from services.sentences import NOTHING, arc_mm, limit_source, noise_passes, number, verdict

CAPTIONS = {
    "linuxcnc": (
        "Who moved the turret.",
        "Requested by the guard, applied by LinuxCNC and reached by the simulated slides, on one time axis. The motion "
        "is that of LinuxCNC's own controller through its external offsets, read back in every servo cycle; its "
        "drives, the bar and the cut are simulated.",
    ),
    "spectrograms": (
        "The cutting force, as it would sound.",
        "Each column is a short-time spectrum of the force estimated from the feed drive; darker is stronger, on one "
        "scale for both. Chatter shows as a dark line between the dashed edges of the band. Where turret 1 was "
        "shifted, the shift is drawn in green.",
    ),
    "indicator": (
        "How chatter was told from quiet cutting.",
        "The indicator is the root of the moving variance of the estimated force in the band. Its limit (dashed) is "
        "learned on the machine, in air first and then in the first quiet cutting. Points above the limit are purple.",
    ),
    "shift": (
        "What turret 1 was asked to do, and did.",
        "The shift is the angle that tool 1 moves round the bar; the depth of cut stays because the path is an arc. "
        "The tool moves along the surface (dy1') and slightly inwards (dx1). Purple marks what the guard would refuse.",
    ),
    "motion": (
        "What the bar and the tool did.",
        "Displacement between bar and tool 1, its amplitude in the chatter band (thin dark line) and the threshold "
        "above which the part counts as marked. No sensor on a machine sees this; the simulation does.",
    ),
    "roughness": (
        "What is left on the part.",
        "Roughness of the finished surface along the bar, stretch by stretch. The shaded stretch was cut while the "
        "vibration was above the threshold.",
    ),
}

SIMULATED = (
    "Everything here was simulated: cut, bar, feed drives and sensors. No machine was moved and no part was cut."
)
NO_SAFETY = (
    "This software is a process-control function, not a safety function. Emergency stop, guards, drive limits and "
    "soft limits stay in the machine; no performance level (ISO 13849-1) is claimed."
)
NOT_JUDGED = (
    "Tool wear, rake at large shifts, chip breaking, heat and the second bending direction of the bar are not judged."
)
NOT_VERIFIED = (
    SIMULATED,
    NO_SAFETY,
    "The vibration, the threshold and the roughness come from the model of the plant; on a machine, measure the part.",
    "The uncontrolled cut is a twin with the same random numbers, not a second measurement.",
    NOT_JUDGED,
)


def write_summary(summary: Summary, directory: Path) -> Path:
    """Write `summary.json` into `directory`; what did not happen is null."""
    directory.mkdir(parents=True, exist_ok=True)
    path = directory / "summary.json"
    path.write_text(json.dumps(plain(summary), indent=2, ensure_ascii=False, allow_nan=False) + "\n", encoding="utf-8")
    return path


def plain(summary: Summary) -> dict[str, object]:
    """Turn a summary into values that JSON knows: no NaN and no infinity."""
    return {
        key: None if isinstance(value, float) and not math.isfinite(value) else value
        for key, value in summary.as_dict().items()
    }


def write_report(record: RunRecord, summary: Summary, directory: Path) -> Path:
    """Write `report.html` into `directory`, with the figures found there taken into the file."""
    directory.mkdir(parents=True, exist_ok=True)
    path = directory / "report.html"
    path.write_text(render(record, summary, directory), encoding="utf-8")
    return path


def render(record: RunRecord, summary: Summary, directory: Path) -> str:
    """Compose the whole page; figures are read from `directory`, those missing are left out."""
    body = "\n".join(
        (
            head(f"Run report · {record.case} · seed {record.seed}", record, summary),
            section("Key numbers", _numbers(record, summary)),
            section("What happened", figures(directory, CAPTIONS)),
            *([section("Side effects and other ways", advice(record))] if record.alternatives else []),
            section("Event log", _events(record)),
            section("Limits in force", limits(record, summary)),
            section("Configuration and versions", _configuration(record)),
            section("What was not verified", _not_verified(record)),
        )
    )
    footer = (
        f"antiphase {escape(record.versions.get('antiphase', ''))} · configuration "
        f"<code>{escape(record.config_hash)}</code> · seed {record.seed}"
    )
    return page(_page_title(record, summary), body, footer)


def _page_title(record: RunRecord, summary: Summary) -> str:
    return f"{verdict(record, summary).title} · {record.case}"


Row = tuple[str, str, str]


def _rows_cut(record: RunRecord, summary: Summary) -> list[Row]:
    threshold = number(record.threshold_um, 2, "µm")
    return [
        ("Tools entered the part", number(summary.entered_cut_s, 3, "s"), "after the machine started"),
        ("Chatter began", number(summary.chatter_onset_s, 3, "s"),
         f"when the cut without control passed {threshold} and stayed there for 20 ms"),
        ("Chatter found", number(summary.detected_s, 3, "s"), "first report that says chatter"),
        ("Time to find it", number(summary.detection_latency_s, 3, "s"),
         "from onset to detection; negative when found before it passed the threshold"),
        ("Chatter frequency", number(summary.chatter_hz, 1, "Hz"), "as told by that report"),
        ("Largest vibration", number(summary.peak_vibration_um, 2, "µm"),
         f"with control; without: {number(summary.peak_vibration_twin_um, 2, 'µm')}"),
        ("Vibration gone", number(summary.suppressed_s, 3, "s"),
         f"from here the controlled cut stayed below {threshold} for half a second"),
    ]  # fmt: skip


def _rows_turret(record: RunRecord, summary: Summary) -> list[Row]:
    late = f"{summary.commands_rejected} rejected, {summary.commands_late} late"
    return [
        ("First command", number(summary.first_command_s, 3, "s"), "when the first move was asked for"),
        ("Shift of turret 1", number(summary.shift_deg, 2, "°"),
         f"first commanded; {number(arc_mm(record, summary), 2, 'mm')} along the surface"),
        ("Pitch difference", number(summary.pitch_difference_deg, 2, "°"),
         "difference of the two angles between the tools, twice the shift"),
        ("Largest shift reached", number(summary.max_shift_deg, 2, "°"),
         f"limit ±{number(record.shift_limit_deg, 2, '°')}"),
        ("Moves", str(summary.moves), "commands that asked for another shift than the one before"),
        ("Commands accepted", str(summary.commands_accepted), late),
    ]  # fmt: skip


def _rows_part(record: RunRecord, summary: Summary) -> list[Row]:
    del record
    return [
        ("Marked", number(summary.marked_length_mm, 2, "mm"),
         f"length cut above the threshold; without control: {number(summary.marked_length_twin_mm, 2, 'mm')}"),
        ("Ra without control", number(summary.ra_before_um, 2, "µm"), "mean of the surface after onset"),
        ("Ra with control", number(summary.ra_after_um, 2, "µm"), "mean of the surface after suppression"),
    ]  # fmt: skip


def _rows_loop(record: RunRecord, summary: Summary) -> list[Row]:
    del record
    return [
        ("Simulated", number(summary.simulated_s, 2, "s"), "machine time covered by this report"),
        ("Loop time, median", number(summary.loop_p50_ms, 2, "ms"), "from a block of samples to the command it causes"),
        ("Loop time, 99 %", number(summary.loop_p99_ms, 2, "ms"), "99 of 100 blocks were answered at least this fast"),
        ("Speed", number(summary.real_time_factor, 1, "× real time"), "simulated time over the time the loop took"),
        ("Blocks lost", str(summary.blocks_lost), "messages of 10 ms that never arrived"),
        ("Wall time", number(summary.total_wall_s, 1, "s"), "with everything: twin, figures, recording"),
    ]  # fmt: skip


def _numbers(record: RunRecord, summary: Summary) -> str:
    groups = (("The cut", _rows_cut), ("Turret 1", _rows_turret), ("The part", _rows_part), ("The loop", _rows_loop))
    lines: list[str] = []
    for name, rows in groups:
        lines.append(f'<tr><th class="group" colspan="3" scope="rowgroup">{escape(name)}</th></tr>')
        lines += [
            f'<tr><th scope="row">{escape(label)}</th><td class="value">{escape(value)}</td>'
            f'<td class="note">{escape(note)}</td></tr>'
            for label, value, note in rows(record, summary)
        ]
    return f'<div class="card"><table class="numbers"><tbody>{"".join(lines)}</tbody></table></div>'


def advice(record: RunRecord) -> str:
    """Tell what the shift leaves on the part, and what else could be done."""
    lines = "".join(f"<li>{escape(sentence)}</li>" for sentence in record.alternatives)
    other = f"<p>What else could be done, by the belief about bar and cut and linear theory:</p>\n<ul>{lines}</ul>"
    if not record.effects:
        return f"<p>No shift was commanded or advised.</p>\n{other}"
    shown = table(("Left by the shift", "Value", "Meaning"), record.effects, ("", "value", "note"))
    return f'<div class="card">{shown}</div>\n{other}'


def _events(record: RunRecord) -> str:
    if not record.events:
        return "<p>Nothing was logged.</p>"
    rows = [(f"{e.sample / record.sample_rate_hz:.3f} s", e.kind.replace("_", " "), e.text) for e in record.events]
    return folded(table(("Time", "What", "Detail"), rows, ("time", "kind", "text")), f"{len(rows)} events", len(rows))


def limits(record: RunRecord, summary: Summary) -> str:
    """Return the limits in force as HTML."""
    low, high = record.search_band_hz
    last = record.reports.limit[-1] if record.reports.limit.size else None
    rows = [
        ("Shift of turret 1", f"±{number(record.shift_limit_deg, 2, '°')}", "checked by the guard of the machine"),
        ("Chatter band", f"{low:.0f} to {high:.0f} Hz", "where chatter is looked for"),
        ("Vibration threshold", number(record.threshold_um, 2, "µm"), "5 % of the feed per tool"),
        ("Indicator limit", NOTHING if last is None or not math.isfinite(last) else f"{last:.3g} N",
         "; ".join(filter(None, (
             f"at the end of the run; the one that decided: {limit_source(summary.limit_source)}",
             noise_passes(record.false_alarms_per_h))))),
        ("Spindle speed", f"{record.spindle_speed_rpm:g} min⁻¹", f"feed {record.feed_mm_per_rev:g} mm per revolution"),
        ("Bar diameter", number(record.diameter_mm, 2, "mm"), "at the tools"),
    ]  # fmt: skip
    guard = [tuple(line.split(" = ", 1)) for line in record.guard_limits]
    every = table(("Limit of the guard", "Value"), guard, ("", "value"))
    shown = table(("Limit", "Value", "Meaning"), rows, ("", "value", "note"))
    folded_limits = f"<details><summary>All limits of the guard</summary>{every}</details>" if guard else ""
    return f'<div class="card">{shown}</div>{folded_limits}'


def _configuration(record: RunRecord) -> str:
    versions = table(("Package", "Version"), sorted(record.versions.items()), ("", "value"))
    return (
        f"<p>Configuration hash <code>{escape(record.config_hash)}</code>, seed {record.seed}: the same two give the "
        "same run, bit for bit.</p>\n"
        f"<details><summary>Resolved configuration</summary><pre>{escape(record.config_text)}</pre></details>\n"
        f"<details><summary>Versions</summary>{versions}</details>"
    )


def _not_verified(record: RunRecord) -> str:
    outside = [f"Outside the range of the model, so do not trust the numbers above: {d}." for d in record.doubts]
    lines = "".join(f"<li>{escape(line)}</li>" for line in (*outside, *NOT_VERIFIED))
    return f'<ul class="limits-of-report">{lines}</ul>'
