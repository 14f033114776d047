"""Fig. 6-18: the shift grows slowly while the tools cut, through pi, 3 pi and 5 pi of the momentary frequency."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

import numpy as np

from services.config import Case, replaced
from services.doubts import doubts_of
from services.linear_theory import strongest_root
from services.messages import Floats
from services.metrics import vibration_envelope
from services.nodes.machine import make_plant
from services.reproduce import published as thesis
from services.reproduce.equal_pitch import NOISE
from services.reproduce.formulas import half_angle_deg
from services.reproduce.plant import PlantName, feed_speed, hertz, prepared_case
from services.reproduce.rows import Row, doubted, near, said
from turning_sim import slides_of_shift

SWEEP_S, QUICK_S, SHIFT_DEG = 20.0, 6.0, 20.0
_AIR_S, _HELD_S, _CELL_S = 0.05, 1.0, 0.1
_FIXED_AT = 0.006


@dataclass(frozen=True, slots=True, kw_only=True)
class SweepCut:
    """A cut under a growing shift.

    Attributes
    ----------
    shift_deg, x1_mm, position_mm, vibration_um, envelope_um
        Sample by sample, shape (n,): half angle, slide X1, tools from the tip, bar against tool 1 and its amplitude.
    cell_shift_deg, cell_um, cell_phase_pi
        Every 0.1 s, shape (k,): half angle, amplitude, and the phase at the momentary frequency.
    """

    rate_hz: float
    shift_deg: Floats
    x1_mm: Floats
    position_mm: Floats
    vibration_um: Floats
    envelope_um: Floats
    cell_shift_deg: Floats
    cell_um: Floats
    cell_phase_pi: Floats

    def quietest(self, odd: int) -> tuple[float, float, float] | None:
        """Return half angle (deg), phase (pi) and amplitude (um) where it is quietest within pi of an odd phase."""
        near_it = np.flatnonzero(np.abs(self.cell_phase_pi - odd) < 1.0)
        if near_it.size == 0 or self.cell_phase_pi[-1] < odd:
            return None
        quiet = near_it[self.cell_um[near_it] < 1.5 * self.cell_um[near_it].min()]
        middle = int(quiet[quiet.size // 2])
        return float(self.cell_shift_deg[middle]), float(self.cell_phase_pi[middle]), float(self.cell_um[middle])

    def loudest(self, even: int) -> float | None:
        """Return the amplitude (um) where it is loudest within half pi of an even phase."""
        near_it = np.abs(self.cell_phase_pi - even) < 0.5
        return float(self.cell_um[near_it].max()) if near_it.any() else None


@dataclass(frozen=True, slots=True, kw_only=True)
class Sweep:
    """The slow cut, a quick one during which the tools hardly travel, and linear theory for tools that stay.

    Attributes
    ----------
    cut, quick
        Shift from 0 to 20 deg within 20 s and within 6 s.
    fixed_shift_deg, fixed_growth, fixed_growth_without_rake
        Growth (1/s) of the strongest root with the tools 6 mm from the tip, as it is and if the rake did not matter.
    doubts
        What lies outside the range of the model.
    """

    cut: SweepCut
    quick: SweepCut
    fixed_shift_deg: Floats
    fixed_growth: Floats
    fixed_growth_without_rake: Floats
    doubts: tuple[str, ...]


def study_sweep(plant: PlantName, seed: int) -> Sweep:
    """Cut while turret 1 goes from 0 to 20 deg; the limits of the case, which end at 4.5 deg, do not apply."""
    case = prepared_case(plant, "thesis-652", NOISE)
    blunt = replaced(case, cutting=dataclasses.replace(case.cutting, rake_gain=0.0))
    fixed = np.linspace(0.0, SHIFT_DEG, 101)
    growth, without = (
        np.array([strongest_root(which, _FIXED_AT, math.radians(float(h))).real for h in fixed])
        for which in (case, blunt)
    )
    return Sweep(
        cut=_cut(case, seed, SWEEP_S),
        quick=_cut(case, seed, QUICK_S),
        fixed_shift_deg=fixed,
        fixed_growth=growth,
        fixed_growth_without_rake=without,
        doubts=doubts_of(case, math.radians(SHIFT_DEG), feed_speed(case) * (_HELD_S + SWEEP_S)),
    )


def _cut(case: Case, seed: int, duration: float) -> SweepCut:
    simulator = make_plant(case, seed, air_time=_AIR_S)
    rate = case.settings.sample_rate_hz
    time_s = np.arange(round((_AIR_S + _HELD_S + duration) * rate)) / rate
    wanted = np.radians(SHIFT_DEG * np.clip((time_s - _AIR_S - _HELD_S) / duration, 0.0, 1.0))
    x1, y1 = slides_of_shift(wanted, simulator.diameter, case.drives.axis_angle)
    block = simulator.advance(x1, y1)
    middle = case.settings.reference_chatter_hz
    envelope = vibration_envelope(1e6 * block.vibration, rate, (0.7 * middle, 1.25 * middle))
    shift_deg = np.degrees(block.shift)
    cell = round(_CELL_S * rate)
    first = round((_AIR_S + 0.1) * rate)
    inside = [slice(int(start), int(start) + cell) for start in np.arange(first, time_s.size - cell, cell)]
    cell_shift = np.array([float(shift_deg[part].mean()) for part in inside])
    positions = np.array([float(block.tool_position[part].mean()) for part in inside])
    grid = np.linspace(0.0, feed_speed(case) * (_HELD_S + duration), 22)
    line = np.interp(positions, grid, [hertz(strongest_root(case, float(at), 0.0)) for at in grid])
    return SweepCut(
        rate_hz=rate,
        shift_deg=shift_deg,
        x1_mm=1e3 * block.x1_stage_position,
        position_mm=1e3 * block.tool_position,
        vibration_um=1e6 * block.vibration,
        envelope_um=envelope,
        cell_shift_deg=cell_shift,
        cell_um=np.array([float(np.median(envelope[part])) for part in inside]),
        cell_phase_pi=2.0 * np.radians(cell_shift) * line / (math.pi * case.cutting.spindle_hz),
    )


def sweep_rows(sweep: Sweep) -> list[Row]:
    """Return where the sweep is quiet and how quiet."""
    return doubted([*_quiet_places(sweep), *_dips(sweep)], sweep.doubts)


def _quiet_places(sweep: Sweep) -> list[Row]:
    rows: list[Row] = []
    for odd in (1, 3, 5, 7):
        found = sweep.cut.quietest(odd)
        what = f"quiet near {odd} pi of the momentary frequency"
        if found is None:
            ends = f"{sweep.cut.cell_phase_pi[-1]:.1f} pi, and {sweep.quick.cell_phase_pi[-1]:.1f} pi"
            why = f"20 deg, the most that the plant allows, are {ends} within {QUICK_S:g} s: the frequency falls"
            rows.append(said("Fig. 6-18", what, f"{odd} pi", None, False, why=why, unit="pi"))
            continue
        shift, phase, _ = found
        why = f"a third of the way to the next even phase; at {shift:.1f} deg, of the line that equal pitch has there"
        rows.append(near("Fig. 6-18", what, float(odd), phase, "pi", within=0.35, why=why))
        rows.append(_quiet_angle(sweep, odd, shift))
        loud = sweep.cut.loudest(odd - 1)
        ratio = found[2] / loud if loud else math.nan
        rows.append(
            said("Fig. 6-18", f"amplitude near {odd} pi over that near {odd - 1} pi", "< 1/3", ratio, ratio < 1 / 3,
                 why="a third is 10 dB, what a spectrogram shows plainly")
        )  # fmt: skip
    return rows


def _quiet_angle(sweep: Sweep, odd: int, shift: float) -> Row:
    printed, cut = thesis.ODD_HALF_ANGLES_DEG.get(odd, thesis.PITCH_DIFFERENCE_DEG / 2.0), sweep.cut
    loudness = float(np.interp(printed, cut.cell_shift_deg, cut.cell_um))
    place = float(np.interp(shift, cut.shift_deg, cut.position_mm))
    why = "about half the width of the first quiet stretch; the print has the angle for 652 Hz"
    otherwise = (
        f"At the printed angle the simulated sweep still shakes {loudness:.0f} um: the tools cut on meanwhile (to "
        f"{place:.0f} mm here), so the frequency has fallen and the angle grown. How far they had come is not printed"
    )
    quick = sweep.quick.quietest(odd)
    if quick is not None:
        sooner = float(np.interp(quick[0], sweep.quick.shift_deg, sweep.quick.position_mm))
        otherwise += (
            f"; were the shift made within {QUICK_S:g} s, the tools still at {sooner:.0f} mm, it would be quietest at "
            f"{quick[0]:.1f} deg, with {quick[2]:.0f} um"
        )
    return near(
        "section 6.5.2, Fig. 6-18", f"half angle where the simulated sweep is quiet near {odd} pi", printed, shift,
        "deg", within=0.75, why=why, otherwise=otherwise,
    )  # fmt: skip


def growth_near(sweep: Sweep, odd: int, growth: Floats | None = None) -> tuple[float, float]:
    """Return where (deg) and how low (1/s) linear growth dips around an odd phase, tools 6 mm from the tip."""
    values = sweep.fixed_growth if growth is None else growth
    unit = half_angle_deg(1.0, thesis.NOMINAL_HZ)
    near_it = np.abs(sweep.fixed_shift_deg - odd * unit) < unit
    lowest = int(np.argmin(np.where(near_it, values, np.inf)))
    return float(sweep.fixed_shift_deg[lowest]), float(values[lowest])


def _dips(sweep: Sweep) -> list[Row]:
    rows: list[Row] = []
    dips = {odd: growth_near(sweep, odd) for odd in (1, 3, 5, 7)}
    for odd, printed in thesis.ODD_HALF_ANGLES_DEG.items():
        at, growth = dips[odd]
        plain_at, plain = growth_near(sweep, odd, sweep.fixed_growth_without_rake)
        what = f"half angle of least linear growth near {odd} pi, tools 6 mm from the tip"
        why = "the dip is blunt; computed from the roots, not from eq. (6-10)"
        otherwise = (
            f"The rake of tool 1 turns negative with the shift and its force grows: that pulls the dip to smaller "
            f"shifts. Without it the dip would be at {plain_at:.1f} deg"
        )
        rows.append(
            near("section 6.5.2, Fig. 6-18", what, printed, at, "deg", within=0.3, why=why, otherwise=otherwise)
        )
        why = f"below zero it is quiet at this place for ever; {plain:+.1f} if the rake did not matter"
        if 0.0 <= growth < 1.0:
            why += "; neutral here"
        elif growth >= 1.0:
            why += (
                "; here one family of roots stays unstable. Where the tools stood is not printed; further from the "
                "tip, where contact is softer, the simulated sweep is quiet at 5 pi"
            )
        rows.append(
            said("section 6.5.2, Fig. 6-18", f"growth there ({odd} pi)", "< 0", growth, growth < 0.0, why=why,
                 unit="1/s")
        )  # fmt: skip
    shown = ", ".join(f"{odd} pi {growth:+.1f}" for odd, (_, growth) in dips.items())
    falls = dips[1][1] < dips[3][1] < dips[5][1] < dips[7][1]
    why = f"growth at the dips in 1/s, tools 6 mm from the tip: {shown}; a larger shift suits ever fewer frequencies"
    best = said("section 6.5.2", "the shift works best near pi", "pi", "pi" if falls else "elsewhere", falls, why=why)
    return [*rows, best]
