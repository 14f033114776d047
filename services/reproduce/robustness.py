"""Fig. 6-19 as a closed picture: the eight published cuts over a map of phase difference and diameter.

Every cut of Table 6-4 has its own diameter, so a band of phases is no line but a curve through the map. A cell is the
gain of a small wave while the tools pass, by linear theory; 20 dB take the noise to the threshold.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pitch.belief import ProcessBelief
from pitch.foresight import strongest_roots
from services.config import Case
from services.doubts import doubts_of
from services.linear_theory import gain_of_pass, roots_of_pass
from services.messages import Floats
from services.reproduce import published as thesis
from services.reproduce.phases import CHATTER_DB, LENGTH, PLACES
from services.reproduce.plant import PlantName, Progress, prepared_case
from services.reproduce.rows import Row, doubted, near, said
from turning_sim import linear_parameters

PHASES, DIAMETERS = (0.35, 1.45, 111), (22.0, 25.0, 31)
STOCK_MM = 24.999
"""A bar that was turned is thinner than its stock."""
STIFFNESS = 0.1
"""Relative change of the cutting stiffness for the borders beside."""
_DB = 20.0 * math.log10(math.e)


@dataclass(frozen=True, slots=True, kw_only=True)
class Robustness:
    """The map, the points on it, and the borders.

    Attributes
    ----------
    phase_pi, diameter_mm
        Columns and rows, shape (columns,), (rows,).
    gain_db, softer_db, stiffer_db
        Gain of a small wave over the pass, as it is and with 10 % less and more stiffness, shape (rows, columns).
    growth
        Of the strongest root over the pass (1/s), shape (rows, columns).
    at_points
        Gain (dB) at the eight cuts, each by collocation, rake included.
    doubts
        What lies outside the range of the model, in words.
    """

    phase_pi: Floats
    diameter_mm: Floats
    gain_db: Floats
    softer_db: Floats
    stiffer_db: Floats
    growth: Floats
    at_points: tuple[float, ...]
    doubts: tuple[str, ...]

    def borders(self, diameter_mm: float, gain_db: Floats | None = None) -> tuple[float, float]:
        """Return the lower and the upper border (pi) of the stable stretch that holds 0.9 pi, at one diameter."""
        cells = self.gain_db if gain_db is None else gain_db
        gain = np.array([np.interp(diameter_mm, self.diameter_mm, column) for column in cells.T])
        middle = int(np.abs(self.phase_pi - 0.9).argmin())
        edges: list[float] = []
        for step in (-1, 1):
            at = middle
            while 0 <= at + step < gain.size and gain[at + step] <= CHATTER_DB:
                at += step
            if not 0 <= at + step < gain.size:
                edges.append(math.nan)
                continue
            part = (CHATTER_DB - gain[at]) / (gain[at + step] - gain[at])
            edges.append(float(self.phase_pi[at] + part * (self.phase_pi[at + step] - self.phase_pi[at])))
        return edges[0], edges[1]


def study_robustness(plant: PlantName, progress: Progress | None = None) -> Robustness:
    """Return the map of `thesis-652` over phase difference and diameter.

    Parameters
    ----------
    plant
        Which plant cuts.
    progress
        Told the share that is done, 0...1.
    """
    tell = progress or (lambda _: None)
    phase, diameter = np.linspace(*PHASES), np.linspace(*DIAMETERS)
    gains: tuple[list[Floats], ...] = ([], [], [])
    growth: list[Floats] = []
    for number, size in enumerate(diameter.tolist()):
        case = _case(plant, size)
        roots = _growth(case, phase)
        for rows, of_factor in zip(gains, roots, strict=True):
            passes = of_factor.astype(np.complex128).T.tolist()
            rows.append(np.array([_DB * gain_of_pass(case, one, PLACES) for one in passes]))
        growth.append(roots[1].max(axis=0))
        tell(0.7 * (number + 1) / diameter.size)
    points: list[float] = []
    for column in thesis.TABLE_6_4:
        case = _case(plant, column.diameter_mm)
        roots = roots_of_pass(case, math.radians(column.half_angle_deg), PLACES)
        points.append(_DB * gain_of_pass(case, roots, PLACES))
        tell(0.7 + 0.3 * len(points) / len(thesis.TABLE_6_4))
    softer, same, stiffer = (np.array(rows) for rows in gains)
    return Robustness(
        phase_pi=phase, diameter_mm=diameter, gain_db=same, softer_db=softer, stiffer_db=stiffer,
        growth=np.array(growth), at_points=tuple(points),
        doubts=doubts_of(_case(plant, DIAMETERS[0]), 0.5 * _difference(1.2), LENGTH),
    )  # fmt: skip


def _case(plant: PlantName, diameter_mm: float) -> Case:
    changes = {"workpiece.turned_diameter_mm": min(diameter_mm, STOCK_MM), "case.start_position_mm": 0.0}
    return prepared_case(plant, "thesis-652", changes)


def _difference(phase_pi: float) -> float:
    """Return the pitch difference (rad) that a nominal phase stands for."""
    return phase_pi * math.pi * thesis.SPEED_RPM / 60.0 / thesis.NOMINAL_HZ


def _growth(case: Case, phase_pi: Floats) -> Floats:
    """Return the growth (1/s) with less, the same and more stiffness, shape (3, places, phases).

    The rake of tool 1 raises its stiffness with the shift; both tools take half of the rise, which is the same to the
    first order.
    """
    shift = 0.5 * np.array([_difference(p) for p in phase_pi])
    factors = (1.0 - STIFFNESS, 1.0, 1.0 + STIFFNESS)
    found = np.empty((3, len(PLACES), shift.size))
    for number, place in enumerate(PLACES):
        one = linear_parameters(case.workpiece, case.cutting, place)
        process = ProcessBelief(
            modal_mass=one.mass_at_tools, natural_frequency_hz=one.natural_frequency_hz,
            damping_ratio=one.damping_ratio, cutting_stiffness=one.cutting_stiffness, overlap=one.overlap,
            process_damping=one.process_damping,
        )  # fmt: skip
        for which, factor in enumerate(factors):
            rows = np.repeat(process.nominal()[None, :], shift.size, axis=0)
            rows[:, 4] *= factor * (1.0 + 0.5 * case.cutting.rake_gain * shift)
            found[which, number] = strongest_roots(rows, shift, case.cutting.spindle_hz)[:, 0]
    return found


def robustness_rows(study: Robustness) -> list[Row]:
    """Return the verdict at each published cut, and where the borders lie."""
    rows: list[Row] = []
    for column, gain in zip(thesis.TABLE_6_4, study.at_points, strict=True):
        agrees = (gain > CHATTER_DB) == column.chatter
        low, high = study.borders(column.diameter_mm)
        why = (
            f"{CHATTER_DB:g} dB take the noise to the threshold; at this diameter {low:.2f} to {high:.2f} pi stay below"
        )
        if not agrees:
            nearest = min(abs(column.phase_pi - edge) for edge in (low, high))
            why += f", so that the cut lies {nearest:.2f} pi beyond the border"
        rows.append(
            said(
                "Fig. 6-19, Table 6-4", f"{column.phase_pi:g} pi at {column.diameter_mm:g} mm on the map",
                f"{'>' if column.chatter else '<'} {CHATTER_DB:g}", gain, agrees, why=why, unit="dB",
            )
        )  # fmt: skip
    return doubted([*rows, *_edges(study), _lower(study)], study.doubts)


def _edges(study: Robustness) -> list[Row]:
    """Return the borders between the last quiet and the first chattering cut, at the mean of their diameters."""
    cuts = {cut.phase_pi: cut for cut in thesis.TABLE_6_4}
    rows: list[Row] = []
    for which, (quiet, loud) in enumerate(((0.7, 0.6), (1.1, 1.15))):
        diameter = 0.5 * (cuts[quiet].diameter_mm + cuts[loud].diameter_mm)
        edges = (study.borders(diameter), study.borders(diameter, study.softer_db),
                 study.borders(diameter, study.stiffer_db))  # fmt: skip
        same, softer, stiffer = (pair[which] for pair in edges)
        rows.append(
            near(
                "section 6.5.2", f"{('lower', 'upper')[which]} border of the stable phases at {diameter:g} mm",
                0.5 * (quiet + loud), same, "pi", within=0.5 * abs(quiet - loud) + 1e-9,
                why=f"it was found between {quiet:g} and {loud:g} pi; {softer:.2f} with {100 * STIFFNESS:g} % less "
                f"cutting stiffness, {stiffer:.2f} with as much more",
            )
        )  # fmt: skip
    return rows


def _lower(study: Robustness) -> Row:
    diameter = 0.5 * sum(thesis.TABLE_6_4[k].diameter_mm for k in (2, 5))
    low, high = study.borders(diameter)
    return said(
        "section 6.5.2", "stable stretch below pi over that above it", "> 1", (1.0 - low) / (high - 1.0),
        1.0 - low > high - 1.0, unit="1",
        why=f"at {diameter:g} mm: {low:.2f} to {high:.2f} pi; the process is likely stable below pi",
    )  # fmt: skip
