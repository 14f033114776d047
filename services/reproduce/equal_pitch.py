"""The pass of Fig. 6-16 and 6-17: equal pitch, then one pitch difference for the whole bar."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pitch import optimal_pitch_difference
from services.linear_theory import strongest_of_pass, strongest_root
from services.open_cut import OpenCut, cut_open
from services.reproduce import published as thesis
from services.reproduce.plant import PlantName, Progress, hertz, prepared_case
from services.reproduce.rows import Row, doubted, near, said

LENGTH = 0.063
NOISE = {"case.start_position_mm": 0.0, "cutting.force_noise_n_per_rthz": 0.1}
"""From the tip, with the force noise that lets the frequency hop."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PassStudy:
    """Roots along the pass, and cuts with as many seeds: without shift and with it."""

    shift: float
    roots: tuple[complex, ...]
    shifted_root: complex
    equal: tuple[OpenCut, ...]
    shifted: tuple[OpenCut, ...]

    def lines_hz(self) -> tuple[float, ...]:
        """Return the frequencies of the strongest roots along the pass (Hz)."""
        return tuple(hertz(root) for root in self.roots)


def study_pass(
    plant: PlantName, seed: int, progress: Progress, *, seeds: int = 20, shifted_seeds: int = 8
) -> PassStudy:
    """Cut the pass without and with the shift for 652 Hz."""
    case = prepared_case(plant, "thesis-652", NOISE)
    shift = optimal_pitch_difference(thesis.NOMINAL_HZ, case.cutting.spindle_hz) / 2.0
    equal: list[OpenCut] = []
    for number in range(seeds):
        equal.append(cut_open(case, seed + number, 0.0, LENGTH))
        progress((number + 1) / (seeds + shifted_seeds))
    shifted: list[OpenCut] = []
    for number in range(shifted_seeds):
        shifted.append(cut_open(case, seed + number, shift, LENGTH))
        progress((seeds + number + 1) / (seeds + shifted_seeds))
    return PassStudy(
        shift=shift,
        roots=tuple(strongest_root(case, position, 0.0) for position in thesis.LINES_AT_M),
        shifted_root=strongest_of_pass(case, shift, [0.005 * k for k in range(13)]),
        equal=tuple(equal),
        shifted=tuple(shifted),
    )


def pass_rows(study: PassStudy) -> list[Row]:
    """Return the frequencies, the hops, and the roughness."""
    rows = [*_linear(study), *_plateaus(study), *_after(study), *_roughness(study)]
    return doubted(rows, (doubt for cut in (*study.equal, *study.shifted) for doubt in cut.doubts))


_FITTED_GROWTH_1_S = (30.2, 27.1, 22.6, 16.5)
"""Not printed: what the constants of the case, fitted as one set, give where the lines stand. Held to 0.5 %."""


def _linear(study: PassStudy) -> list[Row]:
    lines = study.lines_hz()
    rows = [
        near(
            "Fig. 6-16 (a)", f"strongest root, tools {1e3 * position:g} mm from the tip", printed, line, "Hz",
            within=0.005 * printed, why="0.5 %: a spectrogram is read to 3 Hz; where along the pass is not printed",
        )
        for printed, position, line in zip(thesis.LINES_HZ, thesis.LINES_AT_M, lines, strict=True)
    ]  # fmt: skip
    for fitted, position, root in zip(_FITTED_GROWTH_1_S, thesis.LINES_AT_M, study.roots, strict=True):
        what = f"growth of the strongest root, tools {1e3 * position:g} mm from the tip"
        agrees = root.real > 0.0 and abs(root.real / fitted - 1.0) <= 0.005
        why = f"chatter was seen, its growth is not printed; within 0.5 % of {fitted:g} 1/s, to which all constants fit"
        rows.append(said("Fig. 6-16 (a)", what, "> 0", root.real, agrees, why=why, unit="1/s"))
    hop = float(np.mean(-np.diff(lines)))
    printed = float(np.mean(-np.diff(thesis.LINES_HZ)))
    why = "two spindle frequencies: each tool meets the wave of the other, which changes sign with each half turn"
    rows.append(near("Fig. 6-16 (a)", "mean hop of the strongest root", printed, hop, "Hz", within=1.0, why=why))
    return rows


def seen_near(study: PassStudy, line_hz: float, half_hop_hz: float) -> list[float]:
    """Return the plateaus that belong to one line, one for each seed that shows it (Hz)."""
    seen = [[p.hz for p in cut.plateaus if abs(p.hz - line_hz) < half_hop_hz] for cut in study.equal]
    return [float(np.median(plateaus)) for plateaus in seen if plateaus]


def _plateaus(study: PassStudy) -> list[Row]:
    rows: list[Row] = []
    total = len(study.equal)
    for printed, line in zip(thesis.LINES_HZ, study.lines_hz(), strict=True):
        found = seen_near(study, line, 18.0)
        why = (
            f"1 %: median of {len(found)} of {total} seeds that show this plateau (noise may skip one); lost contact "
            "and the flank lower the limit cycle by 2 or 3 Hz under the root"
        )
        rows.append(
            near("Fig. 6-16 (a)", f"plateau of the simulated pass near {printed:g} Hz", printed,
                 float(np.median(found)) if found else None, "Hz", within=0.01 * printed, why=why)
        )  # fmt: skip
    falling = sum(_falls(cut) for cut in study.equal)
    why = "in at least 3 of 4 seeds each plateau is lower than the one before, as 'shifted to 612, 572 and 532 Hz'"
    computed = f"{falling} of {total} seeds"
    rows.append(said("section 6.5.1", "the frequency only falls", "falls", computed, 4 * falling >= 3 * total, why=why))
    return rows


def _falls(cut: OpenCut) -> bool:
    lines = [p.hz for p in cut.plateaus]
    return len(lines) > 1 and all(b < a for a, b in zip(lines, lines[1:], strict=False))


def _after(study: PassStudy) -> list[Row]:
    growth = study.shifted_root.real
    quiet = sum(not cut.chatter for cut in study.shifted)
    total = len(study.shifted)
    why = "largest of 13 places from 0 to 60 mm, all below zero: the shift for 652 Hz silences 612, 572, 532 Hz"
    return [
        said("Fig. 6-16 (b)", "growth with the shift for 652 Hz", "< 0", growth, growth < 0.0, why=why, unit="1/s"),
        said(
            "Fig. 6-16 (b)", "no characteristic frequency over the pass", "quiet",
            "quiet" if quiet == total else "chatter", quiet == total, why=f"{quiet} of {total} seeds quiet",
        ),
    ]  # fmt: skip


def _roughness(study: PassStudy) -> list[Row]:
    before = float(np.median([cut.ra_um or np.nan for cut in study.equal]))
    after = float(np.median([cut.ra_um or np.nan for cut in study.shifted]))
    spread = float(np.ptp([cut.ra_um or np.nan for cut in study.equal]))
    amplitude = float(np.median([cut.amplitude_um or np.nan for cut in study.equal]))
    why = (
        f"one specimen was measured, and Ra differs by {spread:.1f} um between seeds. The limit cycle of this plant "
        f"({amplitude:.0f} um, median) sets it"
    )
    quiet = "what a quiet cut shakes follows the noise, 0.1 N/sqrt(Hz), which was fitted to the hops"
    return [
        near("section 6.5.1, Fig. 6-17", "Ra with equal pitch", thesis.RA_BEFORE_UM, before, "um",
             within=1.0, why=why),
        near("section 6.5.1, Fig. 6-17", "Ra with the shift", thesis.RA_AFTER_UM, after, "um", within=0.4, why=quiet),
        near("section 6.5.1", "Ra before over after", thesis.RA_BEFORE_UM / thesis.RA_AFTER_UM, before / after, "",
             within=1.0, why="from both tolerances above"),
    ]  # fmt: skip
