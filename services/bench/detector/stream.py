"""Simulated cuts as the monitor hears them, with the truth beside."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from services.bench.detector.draw import Process, at_pressure, with_derivatives
from services.bench.detector.programme import Piece
from services.bench.detector.truth import onset_sample
from services.estimator import estimated_force, force_observer
from services.messages import BLOCK_S, Floats
from services.nodes.machine import make_plant
from turning_sim import PlantBlock, SimulationDiverged, Simulator, linear_parameters, slides_of_shift

AIR_S = (1.5, 2.0)
CALM_S, RISE_S, RISE_STEP_S, STEP_S = (1.2, 3.0), 0.05, 1e-3, 0.1
AFTER_ONSET_S = 1.3
"""How long a cut goes on after its onset: the slowest scheme needs more than a second."""
LONGEST_S = 4.0
"""A cut that has no onset after so long has none (the noise may have been too kind)."""
NEVER_S = 1e6
SPEED_ERROR = 1e-3
"""Largest relative error of the speed that the monitor is told."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Stream:
    """A simulated cut.

    Attributes
    ----------
    process
        What was cut.
    rate
        Servo rate (Hz).
    force
        As the observer of the monitor estimates it, X1 and Y1' (N), shape (n, 2).
    latency
        Of that estimate (s).
    engaged
        Whether the machine says that the tools cut, one for each block, shape (m,).
    spindle_hz
        What it says of the speed, shape (m,).
    turned
        Turns of the spindle so far, shape (n,).
    vibration
        Bar against tool 1 along X1 (m), shape (n,); truth.
    entry
        First sample in the cut.
    begin
        First sample at which the vibration grows.
    judged
        First sample at which an onset may lie: at least one revolution after the entry.
    """

    process: Process
    rate: float
    force: Floats
    latency: float
    engaged: np.ndarray
    spindle_hz: Floats
    turned: Floats
    vibration: Floats
    entry: int
    begin: int
    judged: int

    @property
    def block(self) -> int:
        """Samples in a block."""
        return round(BLOCK_S * self.rate)

    @property
    def cut_s(self) -> float:
        """Time in the cut (s)."""
        return float(np.count_nonzero(self.engaged)) * BLOCK_S


class _Recorder:
    """Keeps of every block of the plant what a stream needs."""

    def __init__(self, process: Process) -> None:
        self._process, self._rate = process, process.case.settings.sample_rate_hz
        self._observer = force_observer(process.case)
        self._parts: list[tuple[Floats, ...]] = []

    def take(self, block: PlantBlock, engaged: bool | None) -> None:
        """Keep a block and whether the machine says that the tools cut; None: it says the truth."""
        force = estimated_force(
            self._observer,
            (block.x1_thrust, block.y1_thrust),
            np.column_stack([block.x1_motor_position, block.y1_motor_position]),
            np.column_stack([block.x1_stage_position, block.y1_stage_position]),
        )
        said = np.broadcast_to(np.float64(block.in_cut if engaged is None else engaged), block.vibration.shape)
        self._parts.append((force, said, block.spindle_angle / (2.0 * math.pi), block.vibration))

    def stream(self, speed_error: float, begin: int = 0) -> Stream:
        """Return what was kept, in whole blocks."""
        block = round(BLOCK_S * self._rate)
        force, engaged, turned, vibration = (np.concatenate(part) for part in zip(*self._parts, strict=True))
        whole = len(turned) // block * block
        ends = turned[:whole].reshape(-1, block)
        speed = (ends[:, -1] - ends[:, 0]) * self._rate / (block - 1)
        inside = engaged[:whole].reshape(-1, block).min(axis=1) > 0.5
        entry = int(np.argmax(engaged > 0.5))
        return Stream(
            process=self._process,
            rate=self._rate,
            force=force[:whole],
            latency=self._observer.latency,
            engaged=inside,
            spindle_hz=speed * (1.0 + speed_error),
            turned=turned[:whole],
            vibration=vibration[:whole],
            entry=entry,
            begin=max(begin, entry),
            judged=max(begin, entry + math.ceil(self._rate / self._process.case.cutting.spindle_hz)),
        )


def _stand(plant: Simulator, samples: int, speed: Any = None, knock: Floats | None = None) -> PlantBlock:
    """Cut on with the turret at equal pitch."""
    x1, y1 = slides_of_shift(0.0, plant.diameter, plant.drives.axis_angle)
    return plant.advance(np.full(samples, float(x1)), np.full(samples, float(y1)), speed, knock)


def onset_stream(process: Process) -> Stream:
    """Cut until 1.3 s after the onset.

    The growth begins with the entry or, for a process that is calm at first, when the cutting pressure has risen
    within 50 ms after some seconds in the cut.
    """
    rng = np.random.default_rng([process.seed, 11])
    air_time, calm_time = round(rng.uniform(*AIR_S), 2), round(rng.uniform(*CALM_S), 2)
    plant = make_plant(process.case, process.seed, air_time=air_time)
    kept, rate, nominal = _Recorder(process), plant.sample_rate_hz, process.case.cutting
    begin = round(air_time * rate)
    if process.calm < 1.0:
        begin = round((air_time + calm_time) * rate)
        plant.resume(air_time=air_time, cutting=at_pressure(nominal, process.calm))
        kept.take(_stand(plant, begin), None)
        for part in np.linspace(process.calm, 1.0, round(RISE_S / RISE_STEP_S) + 1)[1:]:
            plant.resume(cutting=at_pressure(nominal, float(part)))
            kept.take(_stand(plant, round(RISE_STEP_S * rate)), None)
    wanted: float = begin + round(LONGEST_S * rate)
    onset: int | None = None
    while plant.sample < wanted:
        try:
            kept.take(_stand(plant, round(STEP_S * rate)), None)
        except SimulationDiverged:  # beyond a millimetre the model means nothing any more
            break
        if onset is None:
            onset = onset_sample(kept.stream(0.0, begin))
            if onset is not None:
                wanted = onset + round(AFTER_ONSET_S * rate)
    return kept.stream(SPEED_ERROR * rng.uniform(-1.0, 1.0), begin)


def stable_stream(process: Process, pieces: Iterable[Piece]) -> Stream:
    """Cut through a programme."""
    rng = np.random.default_rng([process.seed, 12])
    plant = make_plant(process.case, process.seed, air_time=NEVER_S)
    kept, nominal, feed = _Recorder(process), process.case.cutting, 1.0
    for piece in pieces:
        if piece.feed != feed:
            feed = piece.feed
            plant.resume(cutting=_fed(process, feed))
        if piece.enter:
            plant.resume(position=process.case.settings.start_position)
        elif piece.slot:
            plant.resume(air_time=piece.slot / plant.sample_rate_hz)
        elif not piece.engaged:
            plant.resume(air_time=NEVER_S)
        knock = _blow(process, piece, plant.sample_rate_hz) if piece.knocks else None
        kept.take(_stand(plant, piece.samples, nominal.spindle_hz * piece.speed, knock), piece.engaged)
    return kept.stream(SPEED_ERROR * rng.uniform(-1.0, 1.0))


def _fed(process: Process, feed: float) -> Any:
    cut = process.case.cutting
    per_edge = cut.process_damping / cut.chip.edge_length
    return with_derivatives(replace(cut, feed_per_rev=feed * cut.feed_per_rev), per_edge)


def _blow(process: Process, piece: Piece, rate: float) -> Floats:
    """Return half sines of force, each of which would move the free bar as far as it says."""
    force = np.zeros((piece.samples, 2))
    linear = linear_parameters(process.case.workpiece, process.case.cutting, process.case.settings.start_position)
    for at, length, tool, height in piece.knocks:
        speed = 2.0 * math.pi * process.chatter_hz * height * process.threshold
        peak = 0.5 * math.pi * linear.mass_at_tools * speed * rate / length
        wave = peak * np.sin(math.pi * (np.arange(length) + 0.5) / length)
        force[at : at + length, tool] += wave[: piece.samples - at]
    return force
