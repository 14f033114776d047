"""Fig. 6-19: one cut for each phase difference, at its own diameter and half angle of Table 6-4."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from services.config import Case
from services.linear_theory import gain_of_pass, roots_of_pass, strongest_of_pass, with_stiffness
from services.metrics import vibration_envelope
from services.open_cut import OpenCut, cut_open
from services.reproduce import published as thesis
from services.reproduce.equal_pitch import NOISE
from services.reproduce.plant import PlantName, Progress, hertz, prepared_case
from services.reproduce.rows import Row, doubted, said

LENGTH = 0.045
PLACES = [0.005 * k for k in range(10)]
_BARELY = 2.0
_DB = 20.0 * math.log10(math.e)
CHATTER_DB = 20.0
"""What lies between the noise (0.5 um) and the threshold (3.75 um), and a little more."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PhaseCut:
    """What one phase difference did.

    Attributes
    ----------
    column
        Of Table 6-4.
    root
        Strongest over the pass: growth (1/s), angular frequency (rad/s).
    gain_db
        By how much a small wave grows at most while the tools pass, by linear theory.
    nearby
        Growth (1/s) with 5 % less and 5 % more cutting stiffness, where the border is close; empty elsewhere.
    cuts
        One for each seed.
    noisy
        A cut with the first seed and the force noise of the hops, 0.1 N/sqrt(Hz).
    peak_um
        Largest amplitude of the first cut after two revolutions, over 0.2 s.
    """

    column: thesis.Phase
    root: complex
    gain_db: float
    nearby: tuple[float, ...]
    cuts: tuple[OpenCut, ...]
    noisy: OpenCut
    peak_um: float

    @property
    def chatters(self) -> bool:
        """Whether most of the seeds chattered."""
        return 2 * sum(cut.chatter for cut in self.cuts) > len(self.cuts)


def study_phases(plant: PlantName, seed: int, progress: Progress, *, seeds: int = 3) -> tuple[PhaseCut, ...]:
    """Cut with every column of Table 6-4."""
    found: list[PhaseCut] = []
    for column in thesis.TABLE_6_4:
        found.append(cut_phase(plant, column, seed, seeds))
        progress(len(found) / len(thesis.TABLE_6_4))
    return tuple(found)


def cut_phase(plant: PlantName, column: thesis.Phase, seed: int, seeds: int) -> PhaseCut:
    """Cut with one column of Table 6-4, from the tip."""
    bar = {"workpiece.turned_diameter_mm": column.diameter_mm, "case.start_position_mm": 0.0}
    case = prepared_case(plant, "thesis-652", bar)
    shift = math.radians(column.half_angle_deg)
    cuts = tuple(cut_open(case, seed + number, shift, LENGTH) for number in range(seeds))
    middle = case.settings.reference_chatter_hz
    envelope = vibration_envelope(cuts[0].vibration_um, cuts[0].rate_hz, (0.75 * middle, 1.25 * middle))
    roots = roots_of_pass(case, shift, PLACES)
    root = max(roots, key=lambda root: root.real)
    window = round(0.2 * cuts[0].rate_hz)
    parts = envelope[round(0.15 * cuts[0].rate_hz) :]
    parts = parts[: parts.size // window * window].reshape(-1, window)
    return PhaseCut(
        column=column,
        root=root,
        gain_db=_DB * gain_of_pass(case, roots, PLACES),
        nearby=_nearby(case, shift) if abs(root.real) < _BARELY else (),
        cuts=cuts,
        noisy=cut_open(prepared_case(plant, "thesis-652", NOISE | bar), seed, shift, LENGTH),
        peak_um=float(np.median(parts, axis=1).max()),
    )


def _nearby(case: Case, shift: float) -> tuple[float, ...]:
    return tuple(strongest_of_pass(with_stiffness(case, factor), shift, PLACES).real for factor in (0.95, 1.05))


def phase_rows(cuts: tuple[PhaseCut, ...]) -> list[Row]:
    """Return linear growth and simulated verdict for each phase."""
    return [row for cut in cuts for row in doubted((_linear(cut), _simulated(cut)), cut.cuts[0].doubts)]


def _word(chatter: bool) -> str:
    return "chatter" if chatter else "quiet"


def _linear(cut: PhaseCut) -> Row:
    printed = cut.column.chatter
    agrees = (cut.gain_db > CHATTER_DB) == printed
    why = (
        f"{CHATTER_DB:g} dB take the noise to the threshold; largest growth {cut.root.real:+.2f} 1/s over 45 mm from "
        f"the tip, at {hertz(cut.root):.0f} Hz"
    )
    if cut.nearby:
        low, high = cut.nearby
        why += f"; close to the border: {low:+.1f} 1/s with 5 % less cutting stiffness, {high:+.1f} with 5 % more"
    if not agrees and cut.column.phase_pi > 1.0:
        why += "; above pi the strongest root belongs to another family, which a thicker bar calms"
    return said(
        "Fig. 6-19, Table 6-4", f"{cut.column.phase_pi:g} pi at {cut.column.diameter_mm:g} mm: gain of a small wave",
        f"{'>' if printed else '<'} {CHATTER_DB:g}", cut.gain_db, agrees, why=why, unit="dB",
    )  # fmt: skip


def _simulated(cut: PhaseCut) -> Row:
    printed = cut.column.chatter
    count, total = sum(one.chatter for one in cut.cuts), len(cut.cuts)
    why = (
        "vibration held above 5 % of the feed per tool for two revolutions at force noise 0.02 N/sqrt(Hz); "
        f"{count} of {total} seeds chatter, loudest {cut.peak_um:.1f} um"
    )
    if cut.noisy.chatter != cut.chatters:
        why += (
            f". The noise decides: at 0.1 N/sqrt(Hz) it counts as {_word(cut.noisy.chatter)} "
            f"({cut.noisy.amplitude_um or 0.0:.1f} um, median)"
        )
    if cut.chatters != printed:
        why += f". Linear growth is {cut.root.real:+.1f} 1/s, nearly neutral, and the vibration stays small"
    return said(
        "Fig. 6-19", f"{cut.column.phase_pi:g} pi at {cut.column.diameter_mm:g} mm: simulated pass",
        _word(printed), _word(cut.chatters), cut.chatters == printed, why=why,
    )  # fmt: skip
