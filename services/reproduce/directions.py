"""Section 6.3: in which direction the bar shakes, from a plant that bends in both."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from services.closed_loop import open_loop
from services.doubts import doubts_of
from services.linear_theory import linear_process
from services.messages import Floats
from services.metrics import band_passed
from services.nodes.machine import make_plant
from services.reproduce.equal_pitch import NOISE
from services.reproduce.plant import PlantName, feed_speed, prepared_case
from services.reproduce.rows import Row, doubted, said

_AIR_S, _SETTLED_S, _CUT_S = 0.05, 1.0, 4.5
_CASES = (("thesis-652", 160.0), ("thesis-depth-02", 130.0))


@dataclass(frozen=True, slots=True, kw_only=True)
class PlaneCut:
    """A cut with equal pitch whose bar bends along X1 and along Y1'.

    Attributes
    ----------
    case, projection_mm
        The case and how far its bar stands out of the chuck.
    x1_um, y1p_um
        Displacement of the bar in the chatter band once it chatters (um), shape (n,).
    tangential_ratio
        Tangential over radial stiffness of the cut.
    doubts
        What lies outside the range of the model.
    """

    case: str
    projection_mm: float
    rate_hz: float
    x1_um: Floats
    y1p_um: Floats
    tangential_ratio: float
    doubts: tuple[str, ...]

    @property
    def ratio(self) -> float:
        """Amplitude along Y1' over that along X1."""
        return float(np.std(self.y1p_um) / np.std(self.x1_um))


def study_directions(plant: PlantName, seed: int) -> tuple[PlaneCut, ...]:
    """Cut 18 mm of both bars from the tip."""
    return tuple(_cut(plant, name, projection, seed) for name, projection in _CASES)


def _cut(plant: PlantName, name: str, projection: float, seed: int) -> PlaneCut:
    case = prepared_case(plant, name, NOISE, directions=2)
    rate, middle = case.settings.sample_rate_hz, case.settings.reference_chatter_hz
    simulator = make_plant(case, seed, air_time=_AIR_S)
    block = open_loop(case, simulator, round((_AIR_S + _SETTLED_S + _CUT_S) * rate))
    settled = slice(round((_AIR_S + _SETTLED_S) * rate), None)
    cut = linear_process(case, 0.0)
    x1, y1p = (
        1e6 * band_passed(motion, rate, (0.75 * middle, 1.25 * middle))[settled]
        for motion in (block.bar_displacement, block.bar_displacement_y)
    )
    return PlaneCut(
        case=name,
        projection_mm=projection,
        rate_hz=rate,
        x1_um=x1,
        y1p_um=y1p,
        tangential_ratio=cut.tangential_stiffness / cut.cutting_stiffness,
        doubts=doubts_of(case, length=(_SETTLED_S + _CUT_S) * feed_speed(case)),
    )


def direction_rows(cuts: tuple[PlaneCut, ...]) -> list[Row]:
    """Return how much more the bar shakes along Y1' than along X1."""
    rows: list[Row] = []
    for cut in cuts:
        why = (
            f"'largest vibration developed in Y1 direction', said of tools at 130 mm projection; the bar of {cut.case} "
            f"over {_CUT_S:g} s from the tip, Y1' at right angles to X1. The tangential stiffness of the cut, which "
            f"drives Y1', is {cut.tangential_ratio:.2f} times the radial one"
        )
        if cut.ratio <= 1.0:
            why += ": the set that calms 0.3 mm needs a high thrust, and this ratio comes with it"
        what = f"bar along Y1' over X1 with equal pitch, {cut.projection_mm:g} mm"
        rows += doubted([said("section 6.3", what, "> 1", cut.ratio, cut.ratio > 1.0, why=why)], cut.doubts)
    return rows
