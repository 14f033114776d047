"""Chapter 6 of the thesis drawn again: what was measured, as a statement, beside what the model computes."""

# pyright: reportUnknownMemberType=false

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.signal import resample

from services.figures.spectrum import Spectrogram, draw_spectrogram, spectrogram
from services.figures.style import (
    ALARM,
    CONTROLLED,
    FAINT,
    INK,
    MUTED,
    SHIFT,
    TWIN,
    draw_band,
    new_figure,
    plain_log,
    say,
    styled,
)
from services.messages import Floats
from services.open_cut import OpenCut
from services.reproduce import published as thesis
from services.reproduce.chapter6 import Chapter6
from services.reproduce.formulas import half_angle_deg, phase_pi, shift_error_deg
from services.reproduce.phases import PhaseCut

_SCALE_DB = (-22.0, 33.0)
"""Of all spectrograms: 0.08 to 45 um."""
_TOP_HZ = 1000.0
_ORBIT_S = 0.04


def _picture(vibration_um: Floats, rate_hz: float, end_s: float | None = None, top_hz: float = _TOP_HZ) -> Spectrogram:
    window = (0.0, vibration_um.size / rate_hz if end_s is None else end_s)
    picture = spectrogram(vibration_um, rate_hz, window, top_hz, length_s=0.1)
    if picture is None:
        raise ValueError(f"vibration must last longer than two windows, got {vibration_um.size} samples")
    return picture


def _measured(axes: Axes, words: str) -> None:
    """Write what the thesis says under a panel's title."""
    axes.text(
        0.0, 1.012, words, transform=axes.transAxes, fontsize=8.8, color=MUTED, va="bottom", ha="left", style="italic"
    )


def _title(axes: Axes, title: str, measured: str) -> None:
    axes.set_title(title, pad=8.0 + 12.0 * (measured.count("\n") + 1))
    _measured(axes, measured)


@styled
def error_figure(_: Chapter6) -> Figure:
    """Draw Fig. 6-14: error of the half angle over the error of the frequency."""
    figure = new_figure(6.6, 4.6)
    axes = figure.subplots()
    _title(axes, "Error of Δθ/2 for an error of the chatter frequency", "Fig. 6-14: less than or comparable to 0.1°")
    limit = thesis.ERROR_DEG
    axes.axhspan(-limit, limit, color=FAINT, alpha=0.45, linewidth=0)
    error = np.linspace(-thesis.ERROR_HZ, thesis.ERROR_HZ, 81)
    for frequency, colour in zip(thesis.ERROR_AT_HZ, (TWIN, SHIFT, CONTROLLED), strict=True):
        values = shift_error_deg(frequency, error)
        axes.plot(error, values, color=colour)
        raised = 0.0008 * (thesis.ERROR_AT_HZ[1] - frequency) * 0.25
        say(axes, -10.3, float(values[0]) + raised, f"{frequency:g} Hz", colour, ha="right", fontsize=9)
    axes.set(xlabel="error of $f_c$ (Hz)", ylabel="error of Δθ/2 (deg)", xlim=(-13.0, 10.5), ylim=(-0.125, 0.125))
    axes.set_xticks([-10, -5, 0, 5, 10])
    axes.text(10.2, limit, "±0.1° ", ha="right", va="top", color=MUTED, fontsize=9)
    return figure


@styled
def relation_figure(_: Chapter6) -> Figure:
    """Draw Fig. 6-20: phase over pitch difference for several speeds and frequencies."""
    figure = new_figure(7.4, 5.0)
    axes = figure.subplots()
    low, high = thesis.STABLE_BAND_PI
    statement = "652 Hz (solid), 532 Hz (dashed). Section 6.5.2: chatter avoided from 0.7π to 1.1π (grey)"
    _title(axes, "Phase difference over pitch difference", statement)
    axes.axhspan(low, high, color=FAINT, alpha=0.6, linewidth=0)
    axes.axhline(1.0, color=MUTED, linewidth=0.8, linestyle=(0, (4, 3)))
    difference = np.linspace(0.0, 8.0, 81)
    shown = ((600.0, TWIN), (thesis.SPEED_RPM, CONTROLLED), (2400.0, SHIFT))
    for speed, colour in shown:
        for frequency, style in ((thesis.NOMINAL_HZ, "-"), (thesis.LINES_HZ[-1], (0, (5, 2)))):
            phase = np.array([phase_pi(frequency, float(value), speed) for value in difference])
            axes.plot(difference, phase, color=colour, linestyle=style)
        end = min(7.0, 1.8 / phase_pi(thesis.NOMINAL_HZ, 1.0, speed))
        place = phase_pi(thesis.NOMINAL_HZ, end, speed)
        say(axes, end - 0.15, place + 0.05, f"{speed:g} min⁻¹", colour, ha="right")
    axes.plot([thesis.PITCH_DIFFERENCE_DEG], [1.0], "o", color=INK, markersize=6, zorder=4)
    axes.annotate(
        "5.52° (section 6.5.1)", (thesis.PITCH_DIFFERENCE_DEG, 1.0), (5.4, 1.055), color=INK, fontsize=9,
        fontweight="bold", va="center", ha="right",
    )  # fmt: skip
    axes.set(xlabel="pitch difference Δθ (deg)", ylabel="phase difference Δε (π rad)", xlim=(0, 8), ylim=(0, 2))
    return figure


@styled
def directions_figure(chapter: Chapter6) -> Figure:
    """Draw what section 6.3 says of the directions: the path of the bar between the tools."""
    figure = new_figure(10.0, 5.4)
    panels = figure.subplots(1, 2)
    for axes, cut in zip(panels, chapter.directions, strict=True):
        _title(
            axes, f"{cut.projection_mm:g} mm out of the chuck",
            "Section 6.3, tools at 130 mm: largest vibration in Y1 direction",
        )  # fmt: skip
        widest = 1.35 * float(np.abs([cut.x1_um, cut.y1p_um]).max())
        count = round(_ORBIT_S * cut.rate_hz)
        middle = slice(8 * count, 16 * count)
        x1, y1p = (np.asarray(resample(one[: 3 * count], 24 * count))[middle] for one in (cut.x1_um, cut.y1p_um))
        axes.plot(x1, y1p, color=TWIN, linewidth=0.9, alpha=0.8)
        for side, name in ((-1.0, "tool 1"), (1.0, "tool 2")):
            axes.plot([0.9 * side * widest], [0.0], marker="<" if side > 0.0 else ">", color=INK, markersize=11)
            say(axes, 0.9 * side * widest, -0.12 * widest, name, INK, ha="center", fontsize=9)
        colour = CONTROLLED if cut.ratio > 1.0 else TWIN
        words = f"Y1' {cut.ratio:.2f} times X1\ncut: tangential {cut.tangential_ratio:.2f} times radial"
        say(axes, 0.03, 0.97, words, colour, transform=axes.transAxes, va="top", fontsize=9.5)
        axes.set(xlim=(-widest, widest), ylim=(-widest, widest), aspect="equal")
        axes.set(xlabel="bar along X1 (µm)", ylabel="bar along Y1' (µm)")
    return figure


@styled
def pass_figure(chapter: Chapter6) -> Figure:
    """Draw Fig. 6-16 and 6-17: the pass with equal and with unequal pitch, and the roughness."""
    study = chapter.equal_pitch
    figure = new_figure(11.6, 7.0)
    panels = figure.subplots(2, 2, width_ratios=[2.2, 1.0])
    typical = max(study.equal, key=_likeness)
    lines = ", ".join(f"{line:g}" for line in thesis.LINES_HZ)
    _spectrum_of_pass(panels[0, 0], typical)
    _title(panels[0, 0], "Equal pitch", f"Fig. 6-16 (a): {lines} Hz one after the other (marks at the left)")
    for line in thesis.LINES_HZ:
        panels[0, 0].plot([-0.012, 0.0], [line, line], color=TWIN, linewidth=2.4, clip_on=False,
                          transform=panels[0, 0].get_yaxis_transform())  # fmt: skip
    for plateau in typical.plateaus:
        middle = 0.5 * (plateau.start_mm + plateau.end_mm)
        say(panels[0, 0], middle, plateau.hz + 45.0, f"{plateau.hz:.0f} Hz", TWIN, ha="center")
    _spectrum_of_pass(panels[1, 0], study.shifted[0])
    shift = math.degrees(study.shift)
    _title(
        panels[1, 0], f"Unequal pitch, turret 1 shifted by {shift:.2f}°",
        "Fig. 6-16 (b): characteristic frequency components were not observed",
    )  # fmt: skip
    panels[1, 0].set_xlabel("tools from the tip (mm)")
    _roots_of_pass(panels[0, 1], chapter)
    _roughness(panels[1, 1], chapter)
    return figure


def _likeness(cut: OpenCut) -> tuple[int, int]:
    """Return how many of the measured lines a cut shows, and how few others."""
    shown = {line for line in thesis.LINES_HZ for plateau in cut.plateaus if abs(plateau.hz - line) < 10.0}
    return len(shown), -len(cut.plateaus)


def _spectrum_of_pass(axes: Axes, cut: OpenCut) -> None:
    picture = _picture(cut.vibration_um, cut.rate_hz)
    speed_mm = cut.length_mm / (cut.vibration_um.size / cut.rate_hz - 0.05)
    along = Spectrogram(
        time_s=(picture.time_s - 0.05) * speed_mm, frequency_hz=picture.frequency_hz, level_db=picture.level_db
    )
    draw_spectrogram(axes, along, _SCALE_DB)
    axes.set(ylabel="frequency (Hz)", ylim=(300, 1000), xlim=(0.0, cut.length_mm))


def _roots_of_pass(axes: Axes, chapter: Chapter6) -> None:
    study = chapter.equal_pitch
    _title(axes, "Where each line stands", "strongest root (rings), plateaus of 20 seeds (bars)".replace(
        "20", str(len(study.equal))))  # fmt: skip
    for line in thesis.LINES_HZ:
        axes.axhline(line, color=FAINT, linewidth=3.0, zorder=1)
        axes.text(0.985, line + 4.0, f"{line:g}", color=MUTED, fontsize=8.5, ha="right", va="bottom",
                  transform=axes.get_yaxis_transform())  # fmt: skip
    for cut in study.equal:
        for plateau in cut.plateaus:
            axes.plot([plateau.start_mm, plateau.end_mm], [plateau.hz] * 2, color=TWIN, alpha=0.22, linewidth=3.0)
    places = [1e3 * at for at in thesis.LINES_AT_M]
    axes.plot(places, study.lines_hz(), "o", color=CONTROLLED, markerfacecolor="none", markeredgewidth=1.8, zorder=4)
    axes.set(xlim=(-2.0, 68.0), ylim=(480.0, 710.0), ylabel="frequency (Hz)", xlabel="tools from the tip (mm)")


def _roughness(axes: Axes, chapter: Chapter6) -> None:
    study = chapter.equal_pitch
    axes.set_title("Roughness")
    groups = ((0.0, study.equal, thesis.RA_BEFORE_UM, TWIN), (1.0, study.shifted, thesis.RA_AFTER_UM, CONTROLLED))
    for place, cuts, printed, colour in groups:
        values = np.array([cut.ra_um or np.nan for cut in cuts])
        scatter = place + 0.16 * (np.arange(values.size) / max(values.size - 1, 1) - 0.5)
        axes.plot(scatter, values, "o", color=colour, markersize=4, alpha=0.6)
        axes.plot([place - 0.3, place + 0.3], [printed, printed], color=INK, linewidth=2.2)
        say(axes, place + 0.34, printed, f"measured\n{printed:.2f} µm", INK, fontsize=8.5)
        say(axes, place - 0.16, float(np.median(values)), f"{np.median(values):.2f} ", colour, ha="right", fontsize=9)
    axes.set(ylabel="Ra (µm)", xlim=(-0.6, 1.9), ylim=(0.0, 9.0))
    axes.set_xticks([0.0, 1.0], ["equal", "unequal pitch"])


@styled
def sweep_figure(chapter: Chapter6) -> Figure:
    """Draw Fig. 6-18: the shift grows slowly from 0 to 20 deg."""
    sweep, cut = chapter.sweep, chapter.sweep.cut
    figure = new_figure(11.0, 9.0)
    panels = figure.subplots(4, 1, height_ratios=[1.7, 1.0, 0.7, 1.1])
    begin = int(np.argmax(cut.shift_deg > 0.01))
    start_s, end_s = begin / cut.rate_hz, cut.shift_deg.size / cut.rate_hz
    rate_deg = (cut.shift_deg[-1] - cut.shift_deg[begin]) / (end_s - start_s)
    picture = _picture(cut.vibration_um, cut.rate_hz)
    keep = picture.time_s > start_s - 0.5
    along = Spectrogram(
        time_s=(picture.time_s[keep] - start_s) * rate_deg,
        frequency_hz=picture.frequency_hz,
        level_db=picture.level_db[:, keep],
    )
    draw_spectrogram(panels[0], along, _SCALE_DB)
    panels[0].set(ylabel="frequency (Hz)", ylim=(300, 1000))
    _title(
        panels[0], "Turret 1 moves slowly round the bar while the tools cut 60 mm",
        "Fig. 6-18: avoided in the vicinity of odd multiples of π, at 652 Hz 2.76°, 8.2°, 13.8°, 19.3° (lines); "
        "the momentary frequency falls along the pass",
    )  # fmt: skip
    panels[1].plot(cut.cell_shift_deg, cut.cell_um, color=TWIN)
    panels[1].set_ylabel("amplitude (µm)")
    plain_log(panels[1])
    for odd in (1, 3, 5, 7):
        found = cut.quietest(odd)
        if found is not None:
            say(panels[1], found[0], 1.35, f"{found[1]:.2f} π", SHIFT, ha="center", fontsize=9)
    panels[1].set_ylim(1.0, 90.0)
    panels[2].plot(cut.shift_deg[begin::450], cut.x1_mm[begin::450] - cut.x1_mm[0], color=SHIFT)
    panels[2].set_ylabel("slide X1 (mm)")
    panels[3].axhline(0.0, color=MUTED, linewidth=0.8)
    panels[3].plot(sweep.fixed_shift_deg, sweep.fixed_growth_without_rake, color=CONTROLLED, linewidth=0.9, alpha=0.6)
    panels[3].plot(sweep.fixed_shift_deg, sweep.fixed_growth, color=CONTROLLED)
    panels[3].fill_between(sweep.fixed_shift_deg, sweep.fixed_growth, 0.0, where=(sweep.fixed_growth < 0.0).tolist(),
                           color=CONTROLLED, alpha=0.2, linewidth=0)  # fmt: skip
    panels[3].set(ylabel="growth (1/s)", xlabel="shift of turret 1, Δθ/2 (deg)")
    panels[3].set_title(
        "Linear theory with the tools 6 mm from the tip, where the line is 652 Hz: below zero is quiet "
        "(thin: if the rake did not matter)"
    )
    for axes in panels:
        axes.set_xlim(0.0, 20.0)
        axes.set_xticks(range(0, 21, 2))
        for odd in (1, 3, 5, 7):
            at = thesis.ODD_HALF_ANGLES_DEG.get(odd, thesis.PITCH_DIFFERENCE_DEG / 2.0)
            axes.axvline(at, color=ALARM, linewidth=1.0, alpha=0.65, linestyle=(0, (4, 2)))
    for odd in (1, 3, 5, 7):
        say(panels[0], half_angle_deg(odd, thesis.NOMINAL_HZ) + 0.1, 960.0, f"{odd} π", ALARM, ha="left", fontsize=9)
    return figure


@styled
def phases_figure(chapter: Chapter6) -> Figure:
    """Draw Fig. 6-19: eight spectrograms, one for each phase of Table 6-4."""
    figure = new_figure(13.0, 6.9)
    panels = figure.subplots(2, 4, sharex=True, sharey=True)
    image = None
    for axes, cut, letter in zip(panels.flat, chapter.phases, "abcdefgh", strict=True):
        one = cut.cuts[0]
        image = draw_spectrogram(axes, _picture(one.vibration_um, one.rate_hz), _SCALE_DB)
        axes.set_ylim(300, 1000)
        axes.set_xticks([0, 5, 10, 15])
        _phase_title(axes, cut, letter)
    for axes in panels[:, 0]:
        axes.set_ylabel("frequency (Hz)")
    for axes in panels[1]:
        axes.set_xlabel("time (s)")
    if image is not None:
        bar = figure.colorbar(image, ax=panels, shrink=0.7, pad=0.01)
        bar.set_label("bar against tool 1 (dB over 1 µm)")
        bar.outline.set_visible(False)  # pyright: ignore[reportCallIssue]
    return figure


def _phase_title(axes: Axes, cut: PhaseCut, letter: str) -> None:
    column = cut.column
    measured = "chatter" if column.chatter else "quiet"
    found = "chatter" if cut.chatters else "quiet"
    title = f"({letter}) {column.phase_pi:g} π, {column.half_angle_deg:g}°, ⌀{column.diameter_mm:g}"
    _title(axes, title, f"Fig. 6-19: {measured}")
    same = cut.chatters == column.chatter
    words = f"{found}\nlinear {cut.root.real:+.1f} 1/s" + ("" if same else "\ndiffers")
    say(axes, 0.03, 0.97, words, CONTROLLED if same else TWIN, transform=axes.transAxes, va="top", fontsize=9)


@styled
def in_process_figure(chapter: Chapter6) -> Figure:
    """Draw Fig. 6-21: chatter at equal pitch, then the move."""
    run = chapter.in_process.typical()
    cut, rate = run.record.controlled, run.record.sample_rate_hz
    figure = new_figure(10.0, 8.0)
    panels = figure.subplots(3, 1, sharex=True, height_ratios=[1.0, 1.5, 1.2])
    time_s = np.arange(cut.vibration_um.size) / rate
    draw_band(panels[0], time_s, cut.vibration_um, TWIN)
    panels[0].set_ylabel("bar against\ntool 1 (µm)")
    _title(
        panels[0], "In-process avoidance, ⌀22.1 mm, guard armed late",
        "Fig. 6-21: chatter with the frequency of 738 Hz, promptly diminished after a move of approximately 0.5 mm",
    )  # fmt: skip
    draw_spectrogram(panels[1], _picture(cut.vibration_um, rate), _SCALE_DB)
    panels[1].set(ylabel="frequency (Hz)", ylim=(300, 1000))
    panels[1].axhline(thesis.IN_PROCESS_HZ, color=TWIN, linewidth=1.0, linestyle=(0, (2, 3)))
    say(panels[1], 2.1, 835.0, f"measured 738 Hz, here {run.before_hz:.0f} Hz", TWIN, ha="left")
    steps = slice(None, None, 45)
    panels[2].plot(time_s[steps], 5.0 * cut.dx1_um[steps] * 1e-3, color=CONTROLLED)
    panels[2].plot(time_s[steps], cut.dy1p_um[steps] * 1e-3, color=SHIFT)
    panels[2].set(ylabel="offset of tool 1 (mm)", xlabel="time (s)", xlim=(1.8, float(time_s[-1])))
    end = float(time_s[-1]) - 0.05
    say(panels[2], end, float(cut.dy1p_um[-1]) * 1e-3 - 0.05, f"Y1' {cut.dy1p_um[-1] * 1e-3:.2f} mm", SHIFT, ha="right")
    say(panels[2], end, 5e-3 * float(cut.dx1_um[-1]) + 0.06, "X1, five times", CONTROLLED, ha="right")
    angle = panels[2].twinx()
    angle.plot(time_s[steps], cut.shift_applied_deg[steps], color=ALARM, linestyle=(0, (3, 2)))
    ratio = float(cut.shift_applied_deg[-1]) / max(float(cut.dy1p_um[-1]) * 1e-3, 1e-9)
    low, high = -0.05, 0.68
    panels[2].set_ylim(low, high)
    angle.set_ylim(low * ratio * 1.0, high * ratio * 0.9)
    angle.set_ylabel("Δθ/2 (deg)", color=ALARM)
    angle.grid(visible=False)
    say(
        angle, end, float(cut.shift_applied_deg[-1]) + 0.22, f"Δθ/2 {cut.shift_applied_deg[-1]:.2f}°", ALARM, ha="right"
    )
    return figure


THESIS_FIGURES = {
    "section-6-3-directions": directions_figure,
    "fig-6-14-error": error_figure,
    "fig-6-16-pass": pass_figure,
    "fig-6-18-sweep": sweep_figure,
    "fig-6-19-phases": phases_figure,
    "fig-6-20-relation": relation_figure,
    "fig-6-21-in-process": in_process_figure,
}


def write_thesis_figures(chapter: Chapter6, directory: Path) -> list[Path]:
    """Write every figure as PNG into `directory` and list the files."""
    directory.mkdir(parents=True, exist_ok=True)
    written: list[Path] = []
    for name, draw in THESIS_FIGURES.items():
        path = directory / f"{name}.png"
        draw(chapter).savefig(path, metadata={"Software": None})
        written.append(path)
    return written
