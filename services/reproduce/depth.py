"""Table 6-2: at 130 mm projection 0.2 mm chatters and 0.3 mm does not."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from services.linear_theory import strongest_of_pass
from services.metrics import vibration_envelope
from services.open_cut import OpenCut, cut_open
from services.reproduce.plant import PlantName, hertz, prepared_case
from services.reproduce.rows import Row, doubted, said

LENGTH = 0.020
_PLACES = [0.005 * k for k in range(10)]
_VARIANCE_RATIO = 10.0


@dataclass(frozen=True, slots=True, kw_only=True)
class DepthCut:
    """One depth: strongest root over the pass, and a cut from the tip."""

    case: str
    depth_mm: float
    printed_chatter: bool
    root: complex
    cut: OpenCut
    variance_um2: float


def study_depth(plant: PlantName, seed: int) -> tuple[DepthCut, ...]:
    """Cut both depths."""
    return tuple(_cut(plant, name, chatters, seed) for name, chatters in _PRINTED.items())


_PRINTED = {"thesis-depth-02": True, "thesis-depth-03": False}


def _cut(plant: PlantName, name: str, printed: bool, seed: int) -> DepthCut:
    case = prepared_case(plant, name, {"case.start_position_mm": 0.0})
    cut = cut_open(case, seed, 0.0, LENGTH)
    middle = case.settings.reference_chatter_hz
    envelope = vibration_envelope(cut.vibration_um, cut.rate_hz, (0.75 * middle, 1.25 * middle))
    return DepthCut(
        case=name,
        depth_mm=1e3 * case.cutting.depth_of_cut,
        printed_chatter=printed,
        root=strongest_of_pass(case, 0.0, _PLACES),
        cut=cut,
        variance_um2=float(np.mean(0.5 * envelope[round(0.5 * cut.rate_hz) :] ** 2)),
    )


def depth_rows(cuts: tuple[DepthCut, ...]) -> list[Row]:
    """Return growth and verdict of both depths."""
    rows: list[Row] = []
    for one in cuts:
        at = len(rows)
        growth, chatter = one.root.real, one.cut.chatter
        source, what = "Table 6-2", f"{one.depth_mm:g} mm deep at 130 mm projection"
        why = f"the sign decides; strongest over 45 mm from the tip, at {hertz(one.root):.0f} Hz; the set of {one.case}"
        if abs(growth) < 1.0:
            why += ": close to the border"
        rows.append(
            said(source, f"{what}: largest growth", "> 0" if one.printed_chatter else "< 0", growth,
                 (growth > 0.0) == one.printed_chatter, why=why, unit="1/s")
        )  # fmt: skip
        printed, found = ("chatter" if value else "quiet" for value in (one.printed_chatter, chatter))
        why = f"held above 5 % of the feed per tool; {one.cut.amplitude_um or 0:.1f} um over {1e3 * LENGTH:g} mm"
        rows.append(said(source, f"{what}: simulated", printed, found, chatter == one.printed_chatter, why=why))
        rows[at:] = doubted(rows[at:], one.cut.doubts)
    ratio = cuts[0].variance_um2 / cuts[1].variance_um2
    why = f"at least {_VARIANCE_RATIO:g}: 'significantly different'; of the vibration in the band, not of the force"
    last = said("Fig. 6-9", "variance at 0.2 over at 0.3 mm", ">> 1", ratio, ratio > _VARIANCE_RATIO, why=why)
    return [*rows, *doubted([last], (doubt for one in cuts for doubt in one.cut.doubts))]
