"""From the messages of a run to its record and its numbers; where the messages came from does not matter."""

from __future__ import annotations

import math
import platform
from dataclasses import dataclass, field
from importlib.metadata import version
from typing import Any

import numpy as np

from services.clock import Clock
from services.config import Case
from services.doubts import doubts_of
from services.estimator import estimated_force, force_observer
from services.messages import (
    ChatterReport,
    Event,
    Floats,
    ForceBlock,
    MachineState,
    SampleBlock,
    Tick,
    Truth,
    TurretCommand,
)
from services.metrics import Summary, onset_time, summarize, suppressed_time
from services.record import CutSeries, ReportSeries, RunRecord
from turning_sim import PlantBlock, SurfaceTrace, finished_roughness

STRETCH = 0.8e-3
"""Length of part for one value of Ra (m): the sampling length of ISO 4288 for Ra 0.1...2 um."""


@dataclass(slots=True)
class Tape:
    """Keeps every message of a run, by type, and the wall time that the loop took.

    Attributes
    ----------
    messages, log
        By type, and all in the order in which they came.
    latency_ms
        From publishing a block to the command that names it, one value each.
    wall_s
        Of the loop alone.
    blocks_lost
        Blocks that the monitor never saw.
    """

    messages: dict[type, list[Any]] = field(default_factory=dict[type, list[Any]])
    log: list[Any] = field(default_factory=list[Any])
    latency_ms: list[float] = field(default_factory=list[float])
    wall_s: float = 0.0
    blocks_lost: int = 0

    def add(self, message: Any) -> None:
        """Append a message."""
        self.log.append(message)
        self.messages.setdefault(type(message), []).append(message)

    def of(self, kind: type) -> list[Any]:
        """Return the messages of one type, in order."""
        return self.messages.get(kind, [])

    def series(self, kind: type, name: str) -> Floats:
        """Return a field of all blocks of one type as one array."""
        parts = [getattr(message, name) for message in self.of(kind)]
        return np.concatenate(parts) if parts else np.zeros(0)


class Tap:
    """Puts what a bus carries on a tape, with the time from each block to the command that it caused.

    It knows neither bus nor loop, so that a loop and all that it recorded are gone with its last user.

    Parameters
    ----------
    clock
        For the latency.
    """

    def __init__(self, clock: Clock) -> None:
        self.tape = Tape()
        self._clock, self._published = clock, 0.0

    def __call__(self, message: Any) -> None:
        """Take a message."""
        if isinstance(message, SampleBlock):
            self._published = self._clock.now()
        elif isinstance(message, TurretCommand):
            self.tape.latency_ms.append(1e3 * (self._clock.now() - self._published))
        if not isinstance(message, Tick):
            self.tape.add(message)


@dataclass(frozen=True, slots=True, kw_only=True)
class Surface:
    """What both tools of a cut left, and the tool that left it."""

    trace: SurfaceTrace
    nose_radius: float
    feed_per_rev: float

    def roughness(self, start: float, stop: float) -> float:
        """Return Ra (m) between two tool positions (m); nan when nothing is finished there."""
        if not start < stop:
            return math.nan
        return finished_roughness(self.trace, start, stop, nose_radius=self.nose_radius, feed_per_rev=self.feed_per_rev)

    def along(self) -> tuple[Floats, Floats]:
        """Return the middle of each finished stretch of the part (m) and its Ra (m)."""
        inside = self.trace.position
        if inside.size < 2:
            return np.zeros(0), np.zeros(0)
        edges = np.arange(inside[0], inside[-1], STRETCH)
        ra = np.array([self.roughness(float(a), float(b)) for a, b in zip(edges[:-1], edges[1:], strict=True)])
        known = np.isfinite(ra)
        return (0.5 * (edges[:-1] + edges[1:]))[known], ra[known]


def surface_of(case: Case, in_cut: Floats, *series: Floats) -> Surface:
    """Return the surface from left1, left2 (m), phase1, phase2 (rad) and position (m), shape (n,) each."""
    inside = in_cut > 0.5
    trace = SurfaceTrace(*(values[inside] for values in series))
    return Surface(trace=trace, nose_radius=case.cutting.nose_radius, feed_per_rev=case.cutting.feed_per_rev)


def plant_surface(case: Case, block: PlantBlock) -> Surface:
    """Return the surface that one long block of the plant left."""
    series = (block.left1, block.left2, block.phase1, block.phase2, block.tool_position)
    return surface_of(case, block.in_cut.astype(np.float64), *series)


def tape_surface(case: Case, tape: Tape) -> Surface:
    """Return the surface from the truth on a tape."""
    um, rad = 1e-6, 1.0
    names = (("left1_um", um), ("left2_um", um), ("phase1_rad", rad), ("phase2_rad", rad), ("z_mm", 1e-3))
    series = (tape.series(Truth, name) * factor for name, factor in names)
    return surface_of(case, tape.series(Truth, "in_cut"), *series)


def twin_series(case: Case, block: PlantBlock, surface: Surface) -> CutSeries:
    """Return the series of a cut without control; the force is estimated as the monitor does."""
    force = estimated_force(
        force_observer(case),
        (block.x1_thrust, block.y1_thrust),
        np.column_stack([block.x1_motor_position, block.y1_motor_position]),
        np.column_stack([block.x1_stage_position, block.y1_stage_position]),
    )
    position, ra = surface.along()
    return CutSeries(
        vibration_um=block.vibration * 1e6,
        bar_displacement_um=block.bar_displacement * 1e6,
        tool_radial_um=(block.bar_displacement - block.vibration) * 1e6,
        force_x1_n=force[:, 0],
        force_y1p_n=force[:, 1],
        shift_applied_deg=np.degrees(block.shift),
        dx1_um=block.dx1 * 1e6,
        dy1p_um=block.dy1p * 1e6,
        z_mm=block.tool_position * 1e3,
        in_cut=block.in_cut.astype(np.float64),
        ra_position_mm=position * 1e3,
        ra_um=ra * 1e6,
    )


def controlled_series(case: Case, tape: Tape, surface: Surface) -> CutSeries:
    """Return the series of the cut under control."""
    dx1, dy1p = tape.series(SampleBlock, "dx1_um"), tape.series(SampleBlock, "dy1p_um")
    radius = 0.5e6 * case.workpiece.cutting_diameter
    position, ra = surface.along()
    return CutSeries(
        vibration_um=tape.series(Truth, "vibration_um"),
        bar_displacement_um=tape.series(Truth, "bar_displacement_um"),
        tool_radial_um=tape.series(Truth, "tool_radial_um"),
        force_x1_n=tape.series(ForceBlock, "force_x1_n"),
        force_y1p_n=tape.series(ForceBlock, "force_y1p_n"),
        shift_applied_deg=np.degrees(np.arctan2(dy1p, radius - dx1)),
        dx1_um=dx1,
        dy1p_um=dy1p,
        z_mm=tape.series(Truth, "z_mm"),
        in_cut=tape.series(Truth, "in_cut"),
        ra_position_mm=position * 1e3,
        ra_um=ra * 1e6,
    )


def report_series(tape: Tape) -> ReportSeries:
    """Return what monitor and controller said, block by block."""
    reports: list[ChatterReport] = tape.of(ChatterReport)
    commands = {command.cause: command.shift_deg for command in tape.of(TurretCommand)}

    def numbers(name: str) -> Floats:
        values = (getattr(report, name) for report in reports)
        return np.array([math.nan if value is None else float(value) for value in values])

    return ReportSeries(
        first_sample=numbers("first_sample"),
        indicator=numbers("indicator"),
        limit=numbers("limit"),
        frequency_hz=numbers("frequency_hz"),
        amplitude_n=numbers("amplitude_n"),
        confidence=numbers("confidence"),
        shift_requested_deg=np.array([commands.get(report.sequence, math.nan) for report in reports]),
        state=tuple(report.state for report in reports),
        kind=tuple(report.kind or "" for report in reports),
        limit_source=tuple(report.limit_source for report in reports),
    )


def make_record(
    case: Case, seed: int, tape: Tape, controlled: CutSeries, twin: CutSeries, *, interrupted: bool
) -> RunRecord:
    """Return everything that a report shows."""
    settings, cutting = case.settings, case.cutting
    states: list[MachineState] = tape.of(MachineState)
    names = ("commands_accepted", "commands_rejected", "commands_late")
    counts = {name: int(getattr(states[-1], name)) if states else 0 for name in names}
    return RunRecord(
        case=case.name,
        title=settings.title,
        seed=seed,
        sample_rate_hz=settings.sample_rate_hz,
        spindle_speed_rpm=60.0 * cutting.spindle_hz,
        feed_mm_per_rev=1e3 * cutting.feed_per_rev,
        diameter_mm=1e3 * case.workpiece.cutting_diameter,
        chatter_band_hz=(0.75 * settings.reference_chatter_hz, 1.25 * settings.reference_chatter_hz),
        search_band_hz=case.monitor.band_hz,
        threshold_um=1e6 * settings.threshold * 0.5 * cutting.feed_per_rev,
        shift_limit_deg=math.degrees(case.limits.target),
        guard_limits=case.limits.describe(),
        doubts=doubts_of(case, math.radians(max((abs(c.shift_deg) for c in tape.of(TurretCommand)), default=0.0))),
        controlled=controlled,
        twin=twin,
        reports=report_series(tape),
        events=tuple(tape.of(Event)),
        counts=counts | {"blocks_lost": tape.blocks_lost},
        loop_latency_ms=np.array(tape.latency_ms),
        loop_wall_s=tape.wall_s,
        interrupted=interrupted,
        config_text=case.text,
        config_hash=case.digest,
        versions=versions(),
        false_alarms_per_h=case.monitor.false_alarms_per_hour,
    )


def versions() -> dict[str, str]:
    """Return what computed this: Python, Antiphase and the libraries that numbers depend on."""
    return {"python": platform.python_version(), **{n: version(n) for n in ("antiphase", "numpy", "scipy", "numba")}}


def evaluate(record: RunRecord, surface: Surface, twin: Surface) -> Summary:
    """Return the numbers of a run, with the roughness of both surfaces; the wall time is for the caller."""
    return summarize(
        record,
        ra_before_um=ra_from(record, record.twin, twin, onset_time(record)),
        ra_after_um=ra_from(record, record.controlled, surface, suppressed_time(record)),
    )


def ra_from(record: RunRecord, cut: CutSeries, surface: Surface, start_s: float | None) -> float | None:
    """Return Ra (um) of what was cut from a time on, None when there is nothing to measure."""
    if start_s is None:
        return None
    first = float(cut.z_mm[round(start_s * record.sample_rate_hz)])
    ra = surface.roughness(1e-3 * first, 1e-3 * float(cut.z_mm[-1]))
    return 1e6 * ra if math.isfinite(ra) else None
