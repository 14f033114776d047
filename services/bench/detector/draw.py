"""Processes drawn at random, each with the growth rate that was asked for.

Bar, condition, noise and drives are drawn; the cutting pressure is then solved for so that the rightmost root of the
linear process has the wanted real part. Stiffness, overlap and steady forces follow from that pressure and the chip
(`turning_sim.cut_derivatives`), so that every cut is one that a material could make.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from pitch import OneModeProcess, stiffness_for_growth
from services.config import Case, load_case, replaced
from turning_sim import Cutting, ProcessModel, TurretDrives, Workpiece, cut_derivatives, linear_parameters

TURRETS = ("thesis-652",)
"""Cases whose turrets take part: the drives, their control, and what the monitor believes of them."""
Axes = Literal["both", "x1", "y1"]
AXES: tuple[Axes, ...] = ("both", "both", "x1", "y1")
"""Half of the monitors listen to both axes, a quarter to either alone, as the rig of the thesis did to Y1."""

GROWTH = (10.0, 60.0)
STABLE_GROWTH = (-60.0, -5.0)
CALM_GROWTH, CALM_PRESSURE = -8.0, 0.3
"""Before an onset in the cut: growth (1/s), and the least share of the later pressure."""
CHATTER_HZ = (300.0, 1000.0)
SPEED_HZ = (10.0, 40.0)
NOISE = (0.01, 0.03)
DIAMETER, SLENDERNESS, DAMPING = (18e-3, 40e-3), (4.5, 8.0), (0.03, 0.12)
FEED, DEPTH, START = (0.10e-3, 0.20e-3), (0.10e-3, 0.35e-3), (2e-3, 10e-3)
PRESSURE = (0.3, 3.0)
"""Cutting pressure over that of the case."""
WITHIN = 0.6
"""Share of the onsets that come in the cut, of those that can without a leap of the pressure."""
MISMATCH = 0.1
"""Largest relative error of the masses, springs and dampers that the observer believes in."""
PREDICTION = 0.05
"""Largest relative error of the predicted chatter frequency, about which the band lies."""
BELIEF = 1.25
"""Largest factor by which the believed cutting stiffness is wrong, either way."""
WAVE = 1.1
"""|1 + mu exp(-i phi)| at the phase of chatter, 0.3 turns: what regeneration makes of the cutting stiffness."""
EXPECTED = 0.8
"""Expected limit over the force of the threshold vibration, as in the shipped cases."""
FLANK = 2.0
"""Least amplitude at which the flank begins to rub, over the threshold: below, chatter would end before its onset."""
PAIR_SPEED_HZ, PAIR_SPACING_HZ, PAIR_GAP = (18.6, 21.2), (37.0, 40.0), 0.005


@dataclass(frozen=True, slots=True, kw_only=True)
class Process:
    """One cut.

    Attributes
    ----------
    case
        Bar, cut, drives and monitor.
    turret
        Where the drives are from.
    axes
        What the monitor listens to.
    seed
        Of the simulator.
    growth, chatter_hz
        Real part (1/s) and frequency of the rightmost root where the tools enter, at the worst of the conditions.
    rival_hz
        Frequency of the root that the next higher pressure would bring to the same growth; NaN when there is none.
    believed_force
        What the monitor believes the threshold vibration makes of force along X1 (N).
    calm
        Share of the cutting pressure at which the cut begins, stable, before the pressure rises; 1 when it grows from
        the entry on.
    """

    case: Case
    turret: str
    axes: Axes
    seed: int
    growth: float
    chatter_hz: float
    rival_hz: float
    believed_force: float
    calm: float = 1.0

    @property
    def threshold(self) -> float:
        """Vibration that counts as chatter (m)."""
        return self.case.settings.threshold * 0.5 * self.case.cutting.feed_per_rev

    @property
    def band_hz(self) -> tuple[float, float]:
        """Band in which vibration is judged and chatter is looked for (Hz)."""
        middle = self.case.settings.reference_chatter_hz
        return 0.75 * middle, 1.25 * middle

    @property
    def channels(self) -> list[int]:
        """Columns of the force to listen to."""
        return {"both": [0, 1], "x1": [0], "y1": [1]}[self.axes]

    def expected(self, channels: Sequence[int]) -> float:
        """Return the expected amplitude of the force at the threshold (N), root sum of squares over some axes."""
        ratios = (1.0, self.case.cutting.tangential_ratio)
        return self.believed_force * math.hypot(*(ratios[channel] for channel in channels))


def onset_process(seed: int, number: int, turrets: Sequence[str] = TURRETS) -> Process:
    """Return a cut that will chatter: most from the entry on, three in ten after a stretch of stable cutting."""
    rng = np.random.default_rng([seed, 1, number])
    while True:
        drawn = _drawn(rng, turrets)
        found = drawn.solved(rng.uniform(*GROWTH), [(1.0, 1.0)])
        if found is None:
            continue
        at, _ = drawn.crossings(found.growth, 1.0, 1.0, 0.0)
        before, _ = drawn.crossings(CALM_GROWTH, 1.0, 1.0, 0.0)
        calm = float(before[0] / at[0])
        return replace(found, calm=calm) if calm > CALM_PRESSURE and rng.random() < WITHIN else found


def stable_process(
    seed: int, number: int, conditions: Iterable[tuple[float, float]], turrets: Sequence[str] = TURRETS
) -> Process:
    """Return a cut that is stable at all of some speeds and feeds (over the nominal ones), all along the bar."""
    rng = np.random.default_rng([seed, 2, number])
    met = list(conditions)
    while True:
        drawn = _drawn(rng, turrets)
        found = drawn.solved(rng.uniform(*STABLE_GROWTH), met, along=True)
        if found is not None:
            return found


def pair_process(seed: int, number: int, turrets: Sequence[str] = TURRETS) -> Process:
    """Return a cut with two roots 37 to 40 Hz apart that grow equally fast: the speed is chosen so."""
    rng = np.random.default_rng([seed, 3, number])
    while True:
        drawn, growth = _drawn(rng, turrets), rng.uniform(*GROWTH)
        gap, speed = drawn.nearest_rival(growth, np.linspace(*PAIR_SPEED_HZ, 20))
        if gap < 0.1:
            gap, speed = drawn.nearest_rival(growth, speed + np.linspace(-0.13, 0.13, 21))
        if gap < PAIR_GAP:
            found = replace(drawn, speed=speed).solved(growth, [(1.0, 1.0)])
            if found is not None:
                return replace(found, axes="both")


@dataclass(frozen=True, slots=True, kw_only=True)
class _Draw:
    """A bar and a condition whose cutting pressure is still open."""

    base: Case
    turret: str
    workpiece: Workpiece
    drives: TurretDrives
    speed: float
    feed: float
    depth: float
    position: float
    noise: float
    setting: float
    flank_damping: float
    prediction: float
    belief: float
    axes: Axes
    seed: int

    def cutting(self, pressure: float, speed: float = 1.0, feed: float = 1.0) -> Cutting:
        """Return the cut at a pressure (over that of the case), a speed and a feed (over the nominal ones)."""
        cut = replace(
            self.base.cutting, spindle_hz=speed * self.speed, feed_per_rev=feed * self.feed, depth_of_cut=self.depth,
            force_noise=self.noise, setting_difference=self.setting,
        )  # fmt: skip
        return with_derivatives(at_pressure(cut, pressure), self.flank_damping)

    def crossings(self, growth: float, speed: float, feed: float, position: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the pressures that give a growth at one condition, and the frequencies of the roots (Hz)."""
        cut = self.cutting(1.0, speed, feed)
        linear = linear_parameters(self.workpiece, cut, self.position + position)
        bar = OneModeProcess(
            linear.mass_at_tools, linear.natural_frequency_hz, linear.damping_ratio, cut.overlap, cut.process_damping
        )
        largest = 2.0 * PRESSURE[1] * cut.cutting_stiffness
        stiffness, hertz = stiffness_for_growth(bar, growth, cut.spindle_hz, 0.0, largest)
        return stiffness / cut.cutting_stiffness, hertz

    def nearest_rival(self, growth: float, speeds: np.ndarray) -> tuple[float, float]:
        """Return by how little the pressures of two neighbouring roots can differ, and the speed (Hz) for that."""
        found = [(math.inf, float(speeds[0]))]
        for speed in speeds.tolist():
            stiffness, hertz = replace(self, speed=speed).crossings(growth, 1.0, 1.0, 0.0)
            if len(stiffness) > 1 and PAIR_SPACING_HZ[0] <= abs(hertz[1] - hertz[0]) <= PAIR_SPACING_HZ[1]:
                found.append((float(stiffness[1] / stiffness[0] - 1.0), speed))
        return min(found)

    def solved(self, growth: float, met: Sequence[tuple[float, float]], *, along: bool = False) -> Process | None:
        """Return the process with this growth at the worst of the conditions; None when no material gives it."""
        found: list[tuple[float, float, float]] = []
        for speed, feed in met:
            for position in (0.0, 0.4 * self.workpiece.length) if along else (0.0,):
                pressures, hertz = self.crossings(growth, speed, feed, position)
                if len(pressures):
                    found.append((float(pressures[0]), float(hertz[0]), float([*hertz, math.nan][1])))
                    if pressures[0] < PRESSURE[0]:
                        return None
        if not found:
            return None
        pressure, chatter_hz, rival_hz = min(found)
        if not (PRESSURE[0] <= pressure <= PRESSURE[1] and CHATTER_HZ[0] <= chatter_hz <= CHATTER_HZ[1]):
            return None
        cut = self.cutting(pressure)
        threshold = self.base.settings.threshold * 0.5 * self.feed
        surface_speed = math.pi * self.workpiece.diameter * self.speed
        rubs = surface_speed * math.tan(cut.flank_clearance) / (2.0 * math.pi * chatter_hz)
        if rubs < FLANK * threshold:
            return None
        return self._process(cut, growth, chatter_hz, rival_hz, threshold)

    def _process(self, cut: Cutting, growth: float, chatter_hz: float, rival_hz: float, threshold: float) -> Process:
        reference = round(self.prediction * chatter_hz, -1)
        case = replaced(
            self.base, name=f"{self.turret}, drawn", workpiece=self.workpiece, cutting=cut, drives=self.drives,
            settings=replace(
                self.base.settings, reference_chatter_hz=reference, start_position=self.position, seed=self.seed
            ),
        )  # fmt: skip
        process = Process(
            case=case, turret=self.turret, axes=self.axes, seed=self.seed, growth=growth, chatter_hz=chatter_hz,
            rival_hz=rival_hz, believed_force=self.belief * WAVE * threshold * cut.cutting_stiffness,
        )  # fmt: skip
        expected = EXPECTED * process.expected(process.channels)
        monitor = replace(self.base.monitor, band_hz=process.band_hz, expected_limit=expected)
        return replace(process, case=replaced(case, monitor=monitor))


def with_derivatives(cut: Cutting, flank_damping: float) -> Cutting:
    """Return a cut whose stiffness, overlap and damping follow from its chip and its force law.

    Parameters
    ----------
    cut
        Condition and force law.
    flank_damping
        Process damping per edge length (N s/m2).
    """
    found = cut_derivatives(cut, ProcessModel(cut="surface", directions=2))
    return replace(
        cut,
        cutting_stiffness=found.stiffness,
        tangential_ratio=found.tangential_stiffness / found.stiffness,
        overlap=found.overlap,
        process_damping=flank_damping * cut.chip.edge_length,
    )


def at_pressure(cut: Cutting, share: float) -> Cutting:
    """Return the same chip at a share of the cutting pressure: forces and stiffness scale, overlap and ratio stay."""
    law = cut.force_law
    law = replace(
        law,
        thrust_coefficient=share * law.thrust_coefficient,
        tangential_coefficient=share * law.tangential_coefficient,
    )
    return replace(cut, force_law=law, cutting_stiffness=share * cut.cutting_stiffness)


def _drawn(rng: np.random.Generator, turrets: Sequence[str]) -> _Draw:
    turret = turrets[int(rng.integers(len(turrets)))]
    base = load_case(turret)
    diameter = rng.uniform(*DIAMETER)
    length, size = diameter * rng.uniform(*SLENDERNESS), diameter / base.workpiece.diameter
    chuck = base.workpiece.chuck
    chuck = replace(
        chuck, lateral_stiffness=chuck.lateral_stiffness * size, tilt_stiffness=chuck.tilt_stiffness * size**3
    )
    workpiece = replace(
        base.workpiece, diameter=diameter, length=length, turned_length=0.6 * length, chuck=chuck,
        damping_ratios=(rng.uniform(*DAMPING),),
    )  # fmt: skip
    per_edge = base.cutting.process_damping / base.cutting.chip.edge_length
    return _Draw(
        base=base, turret=turret, workpiece=workpiece, drives=_drives(rng, base.drives),
        speed=rng.uniform(*SPEED_HZ), feed=rng.uniform(*FEED), depth=rng.uniform(*DEPTH),
        position=rng.uniform(*START), noise=rng.uniform(*NOISE), setting=rng.uniform(0.0, 8e-6),
        flank_damping=per_edge * rng.uniform(0.5, 1.5), prediction=1.0 + PREDICTION * rng.uniform(-1.0, 1.0),
        belief=BELIEF ** rng.uniform(-1.0, 1.0), axes=AXES[int(rng.integers(len(AXES)))],
        seed=int(rng.integers(2**31)),
    )  # fmt: skip


def _drives(rng: np.random.Generator, believed: TurretDrives) -> TurretDrives:
    """Return drives that differ from what is believed of them."""

    def off(value: float) -> float:
        return value * (1.0 + MISMATCH * rng.uniform(-1.0, 1.0))

    names = ("stage_damping", "drive_stiffness", "drive_damping", "motor_inertia")
    changed: dict[str, Any] = {}
    for axis in ("x1", "y1"):
        drive = getattr(believed, axis)
        changed[axis] = replace(drive, **{name: off(getattr(drive, name)) for name in names})
    heavier = off(1.0)  # what rides on both slides is one mass
    for axis in ("x1", "y1"):
        changed[axis] = replace(changed[axis], stage_mass=heavier * changed[axis].stage_mass)
    return replace(believed, **changed, upper_mass=heavier * believed.upper_mass)
