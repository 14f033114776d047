"""From a recording to the record of a run: what was heard, and nothing else.

There is no twin: nobody knows from a recording what the same cut would have done without control. The truth of a
simulated machine is used where it was recorded. Whatever is missing between two blocks is held from the one before.
"""

from __future__ import annotations

import math
import pathlib
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, replace

import msgspec
import numpy as np

from services.changes import Change, changes_of
from services.config import Case
from services.errors import InputError, RefusalError
from services.gaps import Gaps
from services.messages import (
    BLOCK_S,
    ChatterReport,
    Event,
    Floats,
    ForceBlock,
    MachineState,
    Message,
    SampleBlock,
    Truth,
)
from services.metrics import Summary, summarize, suppressed_time
from services.playback import stretch
from services.record import CutSeries, RunRecord
from services.replay import case_of
from services.tape import Surface, Tape, make_record, ra_from, report_series, surface_of, versions

MOST_S = 200.0
"""Longest stretch that is looked at in one go (s): 1.5 MB each second are held in memory."""
BLOCKS = (SampleBlock, ForceBlock, Truth, ChatterReport)


@dataclass(frozen=True, slots=True, kw_only=True)
class Observed:
    """A recording made ready to be told.

    Attributes
    ----------
    metadata
        What the recording says of itself, see `run_metadata`.
    case
        With which it was run, None if nobody told.
    messages
        How many on each topic, in this stretch.
    missing
        How many are missing, by topic.
    changes
        Everything that changed: states, limits, events.
    notes
        What the file lacks, and what was not looked at.
    """

    path: pathlib.Path
    run: str
    record: RunRecord
    summary: Summary
    metadata: dict[str, str]
    case: Case | None
    messages: dict[str, int]
    missing: dict[str, int]
    changes: tuple[Change, ...]
    surface: Surface | None
    notes: tuple[str, ...]


def observe(path: pathlib.Path, start_s: float = 0.0, stop_s: float = math.inf) -> Observed:
    """Read a stretch of a recording (s of the machine's samples).

    Raises
    ------
    RefusalError
        If it holds no blocks, so that there is nothing to tell.
    """
    reader, messages = stretch(path, start_s, stop_s)
    tape, gaps, heard = Tape(), Gaps(), Counter[str]()
    notes: list[str] = []
    run, others, begun = "", set[str](), math.nan
    for _, message in messages:
        if isinstance(message, BLOCKS) and not run:
            run = reader.metadata.get("run") or message.run
        if run and message.run not in (run, ""):
            others.add(message.run)
            continue
        if isinstance(message, SampleBlock):
            now = message.first_sample / message.sample_rate_hz
            begun = now if math.isnan(begun) else begun
            if now - begun >= MOST_S:
                notes.append(f"only {MOST_S:g} s are told here; --from and --to choose others")
                break
        gaps.see(message)
        heard[type(message).__name__] += 1
        tape.add(message)
    if not any(tape.of(kind) for kind in BLOCKS):
        raise RefusalError(
            f"{path} holds no blocks of samples, forces or reports in this stretch", {"notes": reader.notes}
        )
    if others:
        notes.append(f"{len(others)} other runs are in the same recording and were left out")
    case = _case(path, notes)
    record, surface = record_of(tape, case, reader.metadata)
    ra = ra_from(record, record.controlled, surface, suppressed_time(record)) if surface else None
    notes += [f"{count} messages of {topic} are missing" for topic, count in gaps.missing().items()]
    return Observed(
        path=path, run=run, record=record, summary=summarize(record, ra_after_um=ra), metadata=reader.metadata,
        case=case, messages=dict(heard), missing=gaps.missing(), changes=changes_of(tape, record), surface=surface,
        notes=(*reader.notes, *notes),
    )  # fmt: skip


def _case(path: pathlib.Path, notes: list[str]) -> Case | None:
    try:
        return case_of(path)
    except InputError as error:
        notes.append(f"the configuration is not known: {error.rule}")
        return None


def record_of(tape: Tape, case: Case | None, metadata: dict[str, str]) -> tuple[RunRecord, Surface | None]:
    """Return the record of what is on a tape, and the surface if its truth is known."""
    rate = next((m.sample_rate_hz for kind in (SampleBlock, ForceBlock, Truth) for m in tape.of(kind)), 0.0)
    if not rate:
        reports: list[ChatterReport] = tape.of(ChatterReport)
        rate = case.settings.sample_rate_hz if case else reports[0].samples / BLOCK_S
    firsts = [message.first_sample for kind in BLOCKS for message in tape.of(kind)]
    first, end = min(firsts), max(firsts) + round(BLOCK_S * rate)
    grid = _Grid(tape, first, end - first)
    surface = grid.surface(case)
    cut = _cut(grid, case, surface)
    nothing = CutSeries(**{name: np.zeros(0) for name in CutSeries.__dataclass_fields__})
    base = (
        make_record(case, 0, tape, cut, nothing, interrupted=False)
        if case
        else _without_case(tape, cut, nothing, rate)
    )
    said = report_series(tape)
    seed = metadata.get("seed", "")
    record = replace(
        base,
        case=metadata.get("case") or base.case,
        seed=int(seed) if seed.isdecimal() else 0,
        reports=replace(said, first_sample=said.first_sample - first),
        events=tuple(_moved(event, first) for event in base.events),
        versions=versions() | ({"antiphase (recorded)": metadata["version"]} if metadata.get("version") else {}),
        origin_s=first / rate,
    )
    return record, surface


def _moved(event: Event, first: int) -> Event:
    return msgspec.structs.replace(event, sample=max(event.sample - first, 0))


class _Grid:
    """Puts the blocks of a tape on one grid of samples."""

    def __init__(self, tape: Tape, first: int, count: int) -> None:
        self.tape, self.first, self.count = tape, first, count

    def series(self, kind: type[Message], name: str) -> Floats:
        """Return a field of all blocks of a type, shape (n,); empty if there is no such block."""
        blocks = self.tape.of(kind)
        if not blocks:
            return np.zeros(0)
        values = np.full(self.count, np.nan)
        for block in blocks:
            at, part = block.first_sample - self.first, np.atleast_1d(getattr(block, name))
            size = part.size if part.size > 1 else round(BLOCK_S * block.sample_rate_hz)
            values[at : at + size] = part
        return held(values)

    def slow(self, name: str) -> Floats:
        """Return a number of the machine's state, shape (n,), by its last value; empty if it never told."""
        states: list[MachineState] = self.tape.of(MachineState)
        values = np.full(self.count, np.nan)
        for state in states:
            at = state.sample - self.first
            if 0 <= at < self.count:
                values[at] = float(getattr(state, name))
        return held(values) if np.isfinite(values).any() else np.zeros(0)

    def surface(self, case: Case | None) -> Surface | None:
        """Return what the tools left, if the truth was recorded and the tools are known."""
        if case is None or not self.tape.of(Truth):
            return None
        um, names = 1e-6, ("left1_um", "left2_um", "phase1_rad", "phase2_rad", "z_mm")
        series = (self.series(Truth, name) * f for name, f in zip(names, (um, um, 1.0, 1.0, 1e-3), strict=True))
        return surface_of(case, self.series(Truth, "in_cut"), *series)


def held(values: Floats) -> Floats:
    """Return values of which those missing are held from the one before; at the start from the first."""
    known = np.flatnonzero(np.isfinite(values))
    if known.size == 0:
        return values
    return values[known[np.maximum(np.searchsorted(known, np.arange(values.size), side="right") - 1, 0)]]


def _cut(grid: _Grid, case: Case | None, surface: Surface | None) -> CutSeries:
    """Return the series of the one cut that there is."""
    blocks: list[SampleBlock] = grid.tape.of(SampleBlock)
    dx1, dy1p = grid.series(SampleBlock, "dx1_um"), grid.series(SampleBlock, "dy1p_um")
    if blocks:
        diameter = 1e3 * case.workpiece.cutting_diameter if case else blocks[0].diameter_mm
        shift = np.degrees(np.arctan2(dy1p, 500.0 * diameter - dx1))
        inside = grid.series(SampleBlock, "in_cut")
    else:
        shift, inside = grid.slow("shift_applied_deg"), grid.slow("in_cut")
        shift = shift if shift.size else np.zeros(grid.count)
        dx1 = dy1p = np.zeros(grid.count)
    truth_z = grid.series(Truth, "z_mm")
    position, ra = surface.along() if surface else (np.zeros(0), np.zeros(0))
    truth_inside = grid.series(Truth, "in_cut")
    return CutSeries(
        vibration_um=grid.series(Truth, "vibration_um"),
        bar_displacement_um=grid.series(Truth, "bar_displacement_um"),
        tool_radial_um=grid.series(Truth, "tool_radial_um"),
        force_x1_n=grid.series(ForceBlock, "force_x1_n"),
        force_y1p_n=grid.series(ForceBlock, "force_y1p_n"),
        shift_applied_deg=shift,
        dx1_um=dx1,
        dy1p_um=dy1p,
        z_mm=truth_z if truth_z.size else grid.slow("z_mm"),
        in_cut=next((x for x in (truth_inside, inside) if x.size), np.zeros(grid.count)),
        ra_position_mm=position * 1e3,
        ra_um=ra * 1e6,
    )


def _without_case(tape: Tape, cut: CutSeries, nothing: CutSeries, rate: float) -> RunRecord:
    """Return a record of a run of which the configuration is not known; limits are then not known either."""
    states: list[MachineState] = tape.of(MachineState)
    blocks: Iterable[SampleBlock | ChatterReport] = [*tape.of(SampleBlock), *tape.of(ChatterReport)]
    one = next(iter(blocks), None)
    feed = states[-1].feed_mm_per_rev if states else math.nan
    names = ("commands_accepted", "commands_rejected", "commands_late")
    return RunRecord(
        case="unknown", title="A recording without its configuration", seed=0, sample_rate_hz=rate,
        spindle_speed_rpm=one.spindle_speed_rpm if one else math.nan, feed_mm_per_rev=feed,
        diameter_mm=one.diameter_mm if one else math.nan, chatter_band_hz=(0.02 * rate, 0.2 * rate),
        search_band_hz=(0.02 * rate, 0.2 * rate), threshold_um=0.05 * 0.5e3 * feed, shift_limit_deg=math.nan,
        guard_limits=(), doubts=(), controlled=cut, twin=nothing, reports=report_series(tape),
        events=tuple(tape.of(Event)),
        counts={name: int(getattr(states[-1], name)) if states else 0 for name in names},
        loop_latency_ms=np.zeros(0), loop_wall_s=0.0, interrupted=False, config_text="", config_hash="",
        versions=versions(),
    )  # fmt: skip
