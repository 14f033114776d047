"""The loop in one process: the nodes in lockstep on a bus in memory, and the uncontrolled twin beside them."""

from __future__ import annotations

import math
import platform
import uuid
from collections.abc import Callable
from dataclasses import dataclass, field
from importlib.metadata import version
from typing import Any

import numpy as np

from chatter import LoadSideObserver
from services.bus import InMemoryBus
from services.clock import Clock
from services.config import Case
from services.messages import (
    BLOCK_S,
    ChatterReport,
    Event,
    Floats,
    ForceBlock,
    MachineState,
    OperatorRequest,
    SampleBlock,
    Tick,
    Truth,
    TurretCommand,
)
from services.metrics import Summary, onset_time, summarize, suppressed_time
from services.nodes.controller import ControllerNode
from services.nodes.machine import MachineNode, make_plant
from services.nodes.monitor import MonitorNode
from services.record import CutSeries, ReportSeries, RunRecord
from turning_sim import PlantBlock, Simulator, slides_of_shift

STRETCH = 0.8e-3
"""Length of part for one value of Ra (m): the sampling length of ISO 4288 for Ra 0.1...2 um."""
Progress = Callable[[float], None]


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """A finished (or interrupted) run."""

    record: RunRecord
    summary: Summary


@dataclass(slots=True)
class Tape:
    """Keeps every message of a run, by type."""

    messages: dict[type, list[Any]] = field(default_factory=dict)

    def __call__(self, message: Any) -> None:
        """Append a message."""
        self.messages.setdefault(type(message), []).append(message)

    def of(self, kind: type) -> list[Any]:
        """Return the messages of one type, in order."""
        return self.messages.get(kind, [])

    def series(self, kind: type, name: str) -> Floats:
        """Return a field of all blocks of one type as one array."""
        parts = [getattr(message, name) for message in self.of(kind)]
        return np.concatenate(parts) if parts else np.zeros(0)


def run_case(
    case: Case, seed: int, clock: Clock, *, arm_after_s: float = 0.0, progress: Progress = lambda _: None
) -> Outcome:
    """Run the loop of a case and its twin, and evaluate both; Ctrl-C ends it early with what was seen.

    Parameters
    ----------
    case
        The case.
    seed
        Of the plant's noise; the twin has the same.
    clock
        For the latency and the speed of the loop; nothing else depends on it.
    arm_after_s
        When the guard is armed (s); later than the entry lets the chatter grow first.
    progress
        Told the share that is done, 0...1.
    """
    started = clock.now()
    loop = _Loop(case, seed, clock, arm_after_s)
    blocks = round((case.settings.air_time + case.settings.cut_time) / BLOCK_S)
    interrupted = False
    try:
        for number in range(blocks):
            loop.step(number)
            progress(0.8 * (number + 1) / blocks)
    except KeyboardInterrupt:
        interrupted = True
    twin = make_plant(case, seed)
    still = np.zeros(loop.machine.plant.sample)
    twin_series = cut_series(case, twin, open_loop(case, twin, still))
    progress(0.95)
    record = _record(case, seed, loop, twin_series, interrupted)
    return Outcome(record=record, summary=evaluate(record, loop.machine.plant, twin, clock.now() - started))


def open_loop(case: Case, plant: Simulator, still: Floats, shift: float = 0.0) -> PlantBlock:
    """Advance a plant whose turret stands at one shift (rad) for `still.size` samples."""
    x1, y1 = slides_of_shift(shift, plant.diameter, case.drives.axis_angle)
    return plant.advance(still + x1, still + y1)


class _Loop:
    """The three nodes on one bus, with a tape of everything and the wall time of each turn."""

    def __init__(self, case: Case, seed: int, clock: Clock, arm_after_s: float) -> None:
        run = str(uuid.uuid4())
        self.machine = MachineNode(case, seed, run)
        self.monitor = MonitorNode(case, run)
        self.controller = ControllerNode(case, run)
        self.tape = Tape()
        self.latency_ms: list[float] = []
        self.wall_s = 0.0
        nodes = (self.machine, self.monitor, self.controller)
        self._bus = InMemoryBus(nodes, tap=self._tap)
        self._clock, self._published = clock, 0.0
        self._arm_block = round(arm_after_s / BLOCK_S)
        self._arm = OperatorRequest(run=run, source="operator", sequence=0, request="arm", nonce=uuid.uuid4().hex)
        for node in nodes:
            node.prepare()

    def step(self, number: int) -> None:
        """Let 10 ms pass."""
        begin = self._clock.now()
        if number == self._arm_block:
            self._bus.publish(self._arm)
        self._bus.publish(Tick(block=number))
        self.wall_s += self._clock.now() - begin

    def _tap(self, message: Any) -> None:
        if isinstance(message, SampleBlock):
            self._published = self._clock.now()
        elif isinstance(message, TurretCommand):
            self.latency_ms.append(1e3 * (self._clock.now() - self._published))
        self.tape(message)


def cut_series(case: Case, plant: Simulator, block: PlantBlock) -> CutSeries:
    """Return the series of a cut; the force is estimated as the monitor does."""
    observer = LoadSideObserver(case.belief, case.settings.sample_rate_hz, case.settings.force_cutoff_hz)
    force = observer.update(
        np.column_stack([block.x1_motor_position, block.y1_motor_position]),
        np.column_stack([block.x1_stage_position, block.y1_stage_position]),
    )
    position, ra = roughness_along(plant, block.tool_position, block.in_cut)
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


def roughness_along(plant: Simulator, position: Floats, in_cut: Floats) -> tuple[Floats, Floats]:
    """Return the middle of each stretch of the finished part (m) and its Ra (m)."""
    inside = position[in_cut > 0.5]
    if inside.size < 2:
        return np.zeros(0), np.zeros(0)
    edges = np.arange(inside[0], inside[-1], STRETCH)
    stretches = list(zip(edges[:-1], edges[1:], strict=True))
    ra = np.array([plant.roughness(float(low), float(high)) for low, high in stretches])
    middle = np.array([0.5 * (low + high) for low, high in stretches])
    known = np.isfinite(ra)
    return middle[known], ra[known]


def _controlled(case: Case, loop: _Loop) -> CutSeries:
    tape, plant = loop.tape, loop.machine.plant
    z = tape.series(Truth, "z_mm")
    in_cut = _repeated(tape, Truth, "in_cut", z.size)
    offset = {name: tape.series(SampleBlock, name) for name in ("dx1_um", "dy1p_um")}
    radius = 500.0 * plant.diameter * 1e3
    position, ra = roughness_along(plant, z * 1e-3, in_cut)
    return CutSeries(
        vibration_um=tape.series(Truth, "vibration_um"),
        bar_displacement_um=tape.series(Truth, "bar_displacement_um"),
        tool_radial_um=tape.series(Truth, "tool_radial_um"),
        force_x1_n=tape.series(ForceBlock, "force_x1_n"),
        force_y1p_n=tape.series(ForceBlock, "force_y1p_n"),
        shift_applied_deg=np.degrees(np.arctan2(offset["dy1p_um"], radius - offset["dx1_um"])),
        **offset,
        z_mm=z,
        in_cut=in_cut,
        ra_position_mm=position * 1e3,
        ra_um=ra * 1e6,
    )


def _repeated(tape: Tape, kind: type, name: str, size: int) -> Floats:
    """Return a field that each block has once, for every sample."""
    values = np.array([float(getattr(message, name)) for message in tape.of(kind)])
    return np.repeat(values, size // max(values.size, 1))


def _reports(tape: Tape) -> ReportSeries:
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


def _record(case: Case, seed: int, loop: _Loop, twin: CutSeries, interrupted: bool) -> RunRecord:
    settings, cutting = case.settings, case.cutting
    states: list[MachineState] = loop.tape.of(MachineState)
    last = states[-1] if states else None
    feed_per_tool = 0.5 * cutting.feed_per_rev
    return RunRecord(
        case=case.name,
        title=settings.title,
        seed=seed,
        sample_rate_hz=settings.sample_rate_hz,
        spindle_speed_rpm=60.0 * cutting.spindle_hz,
        feed_mm_per_rev=1e3 * cutting.feed_per_rev,
        diameter_mm=1e3 * loop.machine.plant.diameter,
        chatter_band_hz=(0.75 * settings.reference_chatter_hz, 1.25 * settings.reference_chatter_hz),
        threshold_um=1e6 * settings.threshold * feed_per_tool,
        shift_limit_deg=math.degrees(case.limits.target),
        controlled=_controlled(case, loop),
        twin=twin,
        reports=_reports(loop.tape),
        events=tuple(loop.tape.of(Event)),
        counts={
            "commands_accepted": last.commands_accepted if last else 0,
            "commands_rejected": last.commands_rejected if last else 0,
            "commands_late": last.commands_late if last else 0,
            "blocks_lost": loop.monitor.blocks_lost,
        },
        loop_latency_ms=np.array(loop.latency_ms),
        loop_wall_s=loop.wall_s,
        interrupted=interrupted,
        config_text=case.text,
        config_hash=case.digest,
        versions=versions(),
    )


def versions() -> dict[str, str]:
    """Return what computed this: Python, Antiphase and the libraries that numbers depend on."""
    return {"python": platform.python_version(), **{n: version(n) for n in ("antiphase", "numpy", "scipy", "numba")}}


def evaluate(record: RunRecord, plant: Simulator, twin: Simulator, wall_s: float) -> Summary:
    """Return the numbers of a run, with the roughness asked from both plants."""
    onset, calm = onset_time(record), suppressed_time(record)
    return summarize(
        record,
        ra_before_um=_ra_from(record, record.twin, twin, onset),
        ra_after_um=_ra_from(record, record.controlled, plant, calm),
        total_wall_s=wall_s,
    )


def _ra_from(record: RunRecord, cut: CutSeries, plant: Simulator, start_s: float | None) -> float | None:
    """Return Ra (um) of what was cut from a time on, None when there is nothing to measure."""
    if start_s is None:
        return None
    first, last = float(cut.z_mm[round(start_s * record.sample_rate_hz)]), float(cut.z_mm[-1])
    if last <= first:
        return None
    ra = plant.roughness(1e-3 * first, 1e-3 * last)
    return 1e6 * ra if math.isfinite(ra) else None
