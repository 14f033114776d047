"""An open-loop cut: turret 1 stands at one shift, and what the bar does is measured from the truth."""

from __future__ import annotations

import json
import math
import pathlib
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from scipy import ndimage, signal

from services.closed_loop import open_loop
from services.config import Case
from services.doubts import doubts_of, refusing
from services.linear_theory import strongest_root
from services.messages import Floats
from services.metrics import first_held, vibration_envelope
from services.nodes.machine import make_plant
from services.tape import plant_surface

HELD_REVOLUTIONS = 2.0
"""Vibration that stays above the threshold for so long is chatter."""
PLATEAU_S = 0.25
"""A frequency that stands for so long is a plateau."""
SAME_HZ = 12.0
"""Frequencies nearer than this belong to one plateau: hops are 40 Hz at 1200 1/min."""


KEYS = ("chatter", "chatter_hz", "growth_rate_1_s", "amplitude_um", "ra_um", "plateaus", "doubts")
"""Of the command line."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Plateau:
    """A stretch of feed over which the chatter frequency stood still."""

    start_mm: float
    end_mm: float
    hz: float


@dataclass(frozen=True, slots=True, kw_only=True)
class OpenCut:
    """What an open-loop cut showed.

    Attributes
    ----------
    chatter
        Whether the vibration stayed above the threshold for two revolutions.
    chatter_hz
        Strongest line of the chatter; None without.
    growth_rate_1_s
        Of the rightmost root of the linear process where the tools enter, for comparison.
    amplitude_um
        Median amplitude of the vibration in the chatter band, while it chattered or over the whole cut.
    ra_um
        Mean roughness of the whole cut.
    plateaus
        Where which frequency stood.
    doubts
        What lies outside the range of the model.
    """

    chatter: bool
    chatter_hz: float | None
    growth_rate_1_s: float
    amplitude_um: float | None
    ra_um: float | None
    plateaus: tuple[Plateau, ...]
    doubts: tuple[str, ...]
    length_mm: float
    rate_hz: float
    vibration_um: Floats

    def as_dict(self) -> dict[str, object]:
        """Return the keys of the command line."""
        values: dict[str, object] = {key: getattr(self, key) for key in KEYS}
        return values | {"plateaus": [asdict(plateau) for plateau in self.plateaus], "doubts": list(self.doubts)}

    def words(self) -> str:
        """Return the same for people."""
        ra = "unknown" if self.ra_um is None else f"{self.ra_um:.2f} um"
        if not self.chatter:
            return f"No chatter over {self.length_mm:.1f} mm. Vibration {self.amplitude_um or 0:.2f} um, Ra {ra}."
        lines = [f"Chatter at {self.chatter_hz:.1f} Hz, {self.amplitude_um:.1f} um, Ra {ra}."]
        lines += [f"  {p.start_mm:6.1f} .. {p.end_mm:6.1f} mm  {p.hz:7.1f} Hz" for p in self.plateaus]
        return "\n".join(lines)

    def write(self, out: pathlib.Path) -> list[pathlib.Path]:
        """Write the numbers and a figure of the vibration."""
        from services.figures import detection_figure, write_detection_figure

        out.mkdir(parents=True, exist_ok=True)
        numbers = out / "simulate.json"
        numbers.write_text(json.dumps(self.as_dict(), indent=2) + "\n", encoding="utf-8")
        verdict = "chatter" if self.chatter else "stable"
        band = (0.0, 2.0 * self.chatter_hz) if self.chatter_hz else None
        figure = detection_figure(
            self.vibration_um, self.rate_hz, verdict=verdict, events=(), band_hz=band, title="Bar at tool 1", unit="um"
        )
        return [numbers, write_detection_figure(figure, out / "simulate.png")]


def cut_open(case: Case, seed: int, shift: float, length: float) -> OpenCut:
    """Cut with turret 1 at a shift.

    Parameters
    ----------
    case
        The case; its time in air is cut to 50 ms.
    seed
        Of the noise.
    shift
        Where turret 1 stands (rad).
    length
        Feed in the cut (m).
    """
    plant = make_plant(case, seed, initial_shift=shift, air_time=0.05)
    rate, cutting = case.settings.sample_rate_hz, case.cutting
    samples = round((0.05 + length / (cutting.feed_per_rev * cutting.spindle_hz)) * rate)
    with refusing(case, KEYS, shift):
        block = open_loop(case, plant, samples, shift)
    entry = int(np.argmax(block.in_cut)) + math.ceil(rate / cutting.spindle_hz)
    vibration, position = 1e6 * block.vibration, 1e3 * block.tool_position
    middle = case.settings.reference_chatter_hz
    envelope = vibration_envelope(vibration, rate, (0.75 * middle, 1.25 * middle))
    threshold = 1e6 * case.settings.threshold * 0.5 * cutting.feed_per_rev
    onset = first_held(envelope > threshold, round(HELD_REVOLUTIONS * rate / cutting.spindle_hz), entry)
    start = entry if onset is None else onset
    amplitude = float(np.median(envelope[start:])) if envelope.size > start else None
    ra = plant_surface(case, block).roughness(float(block.tool_position[0]), float(block.tool_position[-1]))
    growth = strongest_root(case, case.settings.start_position, shift).real
    common: dict[str, Any] = {
        "growth_rate_1_s": growth,
        "doubts": doubts_of(case, shift, length),
        "length_mm": 1e3 * length,
        "rate_hz": rate,
        "vibration_um": 1e6 * block.vibration,
    }
    ra_um = 1e6 * ra if math.isfinite(ra) else None
    if onset is None:
        return OpenCut(
            chatter=False, chatter_hz=None, amplitude_um=amplitude, ra_um=ra_um, plateaus=(),
            **common,
        )  # fmt: skip
    return OpenCut(
        chatter=True,
        chatter_hz=_strongest_line(vibration[onset:], rate, middle),
        amplitude_um=amplitude,
        ra_um=ra_um,
        plateaus=_plateaus(vibration[onset:], position[onset:], rate, middle),
        **common,
    )


def _strongest_line(vibration: Floats, rate: float, middle: float) -> float:
    frequency, power = signal.periodogram(vibration, rate, window="hann", nfft=max(4 * vibration.size, 1 << 16))
    power[(frequency < 0.6 * middle) | (frequency > 1.4 * middle)] = 0.0
    return float(frequency[np.argmax(power)])


def _plateaus(vibration: Floats, position: Floats, rate: float, middle: float) -> tuple[Plateau, ...]:
    """Follow the strongest line through the pass and join what stands still."""
    window, hop = round(0.2 * rate), round(0.05 * rate)
    if vibration.size < window:
        return ()
    frequency, time, power = signal.spectrogram(
        vibration, rate, window="hann", nperseg=window, noverlap=window - hop, nfft=8 * window
    )
    inside = (frequency > 0.6 * middle) & (frequency < 1.4 * middle)
    line = ndimage.median_filter(frequency[inside][np.argmax(power[inside], axis=0)], 5, mode="nearest")
    breaks = np.flatnonzero(np.abs(np.diff(line)) > SAME_HZ) + 1
    groups = np.split(np.arange(line.size), breaks)
    where = np.interp(time, np.arange(vibration.size) / rate, position)
    half = 0.5 * (where[1] - where[0]) if where.size > 1 else 0.0
    return tuple(
        Plateau(start_mm=float(where[g[0]] - half), end_mm=float(where[g[-1]] + half), hz=float(np.median(line[g])))
        for g in groups
        if (g.size * hop) / rate >= PLATEAU_S
    )
