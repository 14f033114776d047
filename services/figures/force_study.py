"""Figures of the study of force estimators: counts, milling, guides, idling; and all of them as files."""

# pyright: reportUnknownMemberType=false

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from services.figures.force_bode import bode_figure, inertias_figure, said_there
from services.figures.force_choice import trade_figure, which_figure
from services.figures.style import (
    ALARM,
    CONTROLLED,
    DPI,
    FAINT,
    INK,
    MUTED,
    SHIFT,
    TWIN,
    draw_band,
    new_figure,
    say,
    styled,
)
from services.reproduce.estimators import independent
from services.reproduce.estimators.guide import AXES, CHATTER_HZ, ONSET_S, GuideScene, scene_of
from services.reproduce.estimators.idling import COGGING, LONG, SIGNAL
from services.reproduce.estimators.kit import drive_of
from services.reproduce.estimators.milling import CONDITIONS
from services.reproduce.estimators.resolution import STEPS_NM
from services.reproduce.estimators.study import Choice, Estimators

COLOURS = {"thrust": MUTED, "dob": TWIN, "medob": ALARM, "vibration": SHIFT, "load_side": CONTROLLED}
NAMES = {"thrust": "thrust", "dob": "DOB", "medob": "MEDOB", "vibration": "vibration mode", "load_side": "load side"}
_WHAT = {1: "1 mm deep, 67 Hz", 2: "1 mm deep, 200 Hz", 3: "slot, 67 Hz", 4: "slot, 200 Hz"}


@styled
def resolution_figure(study: Estimators) -> Figure:
    """Draw Fig. 4-7 with all three two-encoder estimators: error over the count of each encoder."""
    figure = new_figure(12.0, 5.2)
    panels = figure.subplots(1, 2, sharey=True)
    found = study.resolution
    bounds = {
        "rotary": ((38.1, 10.0, "> 10 N"), (1.0, 1.0, "< 1 N")),
        "linear": ((20.0, 1.0, "< 1 N"), (5.0, 0.5, "< 0.5 N")),
    }
    cases = {
        "rotary": ((38.1, "rotary 38 nm"), (1.0, "rotary 1 nm")),
        "linear": ((20.0, "scale 20 nm"), (5.0, "scale 5 nm")),
    }
    for axes, encoder in zip(panels, ("rotary", "linear"), strict=True):
        for name in ("medob", "vibration", "load_side"):
            axes.plot(STEPS_NM, found.curves_n[name, encoder], color=COLOURS[name])
            axes.plot(STEPS_NM, found.points_n[name, encoder], "o", color=COLOURS[name], markersize=5)
        for step, case in cases[encoder]:
            axes.plot([step], [found.sweep_n[case].max()], "D", color=INK, markersize=6, zorder=4)
        for step, bound, words in bounds[encoder]:
            axes.plot([step / 1.35, step * 1.35], [bound, bound], color=INK, linewidth=2.2, zorder=4)
            say(axes, step / 1.45, bound, words, INK, ha="right", fontsize=8.8)
        axes.set(xscale="log", yscale="log", xlabel=f"count of the {encoder} encoder (nm at the stage)")
        axes.set(xlim=(0.08, 130.0), ylim=(2e-4, 60.0))
        axes.set_xticks([0.1, 1.0, 10.0, 100.0], ["0.1", "1", "10", "100"])
        axes.set_yticks([1e-3, 1e-2, 0.1, 1.0, 10.0], ["0.001", "0.01", "0.1", "1", "10"])
    panels[0].set_ylabel("standard deviation of the error (N)")
    _counts_of_drives(panels[0])
    said_there(
        panels[0], "Counts of the motor encoder", "machine A: predicted (lines), simulated (dots); Fig. 4-7: bars,\n"
        "MEDOB with the filters of the thesis; diamonds: the same simulated",
    )  # fmt: skip
    said_there(panels[1], "Counts of the linear scale", "the same; a count of the scale weighs\nalike in all three")
    for name, (at, level) in {"medob": (9.0, 2.3), "vibration": (9.0, 0.21), "load_side": (12.0, 0.016)}.items():
        say(panels[0], at, level, NAMES[name], COLOURS[name], ha="right" if name != "load_side" else "left")
    return figure


def _counts_of_drives(axes: Axes) -> None:
    for name, words in (("machine-a", "A"), ("machine-b", "B"), ("nty3-x1", "X1"), ("nty3-y1", "Y1")):
        step = 1e9 * drive_of(name).drive.motor_resolution
        axes.axvline(step, color=FAINT, linewidth=1.2, zorder=0)
        height = 2.6e-4 if words != "A" else 4.6e-4
        say(axes, step, height, words, MUTED, ha="center", fontsize=8.8)


@styled
def milling_figure(study: Estimators) -> Figure:
    """Draw Fig. 4-9, 4-11 and 4-12: the estimates over the true force in the four conditions."""
    figure = new_figure(12.6, 7.4)
    panels = figure.subplots(2, 2)
    for axes, number in zip(panels.flat, CONDITIONS, strict=True):
        cut, found = study.milling.cuts[number], study.milling.reference[number]
        shown = cut.time_s >= cut.time_s[-1] - 2.0 / cut.spindle_hz
        time = 1e3 * (cut.time_s[shown] - cut.time_s[shown][0])
        true = found["medob"].reference_n[shown]
        axes.plot(time, true, color=FAINT, linewidth=6.0, solid_capstyle="butt")
        for name in ("thrust", "dob", "medob"):
            wide = {"medob": 1.8, "dob": 1.3, "thrust": 1.1}[name]
            axes.plot(time, found[name].estimate_n[shown], color=COLOURS[name], linewidth=wide)
        errors = ", ".join(
            f"{NAMES[name]} {100.0 * found[name].error_ratio:.1f} %" for name in ("thrust", "dob", "medob")
        )
        said_there(axes, f"Condition #{number}: {_WHAT[number]}", f"error over force: {errors}")
        axes.set(xlim=(0.0, float(time[-1])), ylabel="force along the feed (N)")
        low, high = float(true.min()), float(true.max())
        axes.set_ylim(low - 0.75 * (high - low), high + 0.75 * (high - low))
    for axes in panels[1]:
        axes.set_xlabel("time (ms), two turns; grey: the true force through the same low-pass")
    for name, place in {"thrust": 0.03, "dob": 0.16, "medob": 0.26}.items():
        say(panels[0, 0], place, 0.93, NAMES[name], COLOURS[name], transform=panels[0, 0].transAxes, ha="left")
    return figure


@styled
def guide_figure(study: Estimators) -> Figure:
    """Draw Fig. 6-6 to 6-9: traces of the estimates, and their moving variance while the motor stands or creeps."""
    figure = new_figure(12.6, 8.8)
    panels = figure.subplots(3, 2, sharex=True, sharey="row", height_ratios=[1.25, 1.0, 1.0])
    guide = {"nty3-x1": "X1: rolling guide", "nty3-y1": "Y1: sliding guide"}
    for column, axis in enumerate(AXES):
        stands, creeps = (scene_of(study.guides, axis, motor) for motor in ("stands", "creeps"))
        _traces(panels[0, column], stands)
        figures = {"nty3-x1": "Fig. 6-6: chatter in MEDOB, not in DOB", "nty3-y1": "Fig. 6-7: chatter in MEDOB, "
                   "DOB approaches zero"}[axis]  # fmt: skip
        said_there(panels[0, column], guide[axis], figures)
        for row, scene in ((1, stands), (2, creeps)):
            _variance(panels[row, column], scene)
        said_there(
            panels[1, column], "Moving variance, motor stands", "Fig. 6-9: MEDOB significantly different, unlike DOB"
        )
        said_there(panels[2, column], "Moving variance, motor creeps over its counts",
                   "then counts bury the chatter in MEDOB too; the load side keeps it")  # fmt: skip
        panels[2, column].set_xlabel("time (s)")
    panels[0, 0].set_ylabel("force estimate (N)")
    for row in (1, 2):
        panels[row, 0].set_ylabel("moving variance (N²)")
    return figure


def _traces(axes: Axes, scene: GuideScene) -> None:
    for level, name in ((0.0, "dob"), (-320.0, "medob"), (-640.0, "load_side")):
        values = scene.estimate_n[name]
        shifted = values - float(np.median(values[scene.quiet])) + level
        draw_band(axes, scene.time_s, shifted, COLOURS[name])
        say(axes, 1.24, level + 95.0, f"{NAMES[name]}: {100.0 * scene.share(name):.0f} % of the chatter", COLOURS[name],
            ha="left")  # fmt: skip
    axes.axvline(ONSET_S, color=INK, linewidth=1.0, linestyle=(0, (4, 3)))
    say(axes, ONSET_S + 0.02, 250.0, f"chatter grows, {CHATTER_HZ:.0f} Hz", INK, ha="left", fontsize=8.8)
    axes.set(xlim=(1.2, float(scene.time_s[-1])), ylim=(-820.0, 320.0))
    axes.set_yticks([-640.0, -320.0, 0.0], ["0", "0", "0"])
    axes.plot([1.215, 1.215], [150.0, 250.0], color=INK, linewidth=2.0)
    say(axes, 1.235, 200.0, "100 N", INK, ha="left", fontsize=8.8)


def _variance(axes: Axes, scene: GuideScene) -> None:
    end = float(scene.time_s[-1])
    for name, values in scene.variance_n2.items():
        axes.plot(scene.time_s[::9], values[::9], color=COLOURS[name], linewidth=1.4)
    axes.axvline(ONSET_S, color=INK, linewidth=1.0, linestyle=(0, (4, 3)))
    axes.set(yscale="log", ylim=(1e-2, 2e7), xlim=(1.2, end))
    axes.set_yticks([1e-2, 1.0, 1e2, 1e4, 1e6], ["0.01", "1", "100", "$10^4$", "$10^6$"])
    short = {"dob": "DOB", "medob": "MEDOB", "vibration": "vibration", "load_side": "load side"}
    for place, (name, word) in zip((0.02, 0.2, 0.46, 0.74), short.items(), strict=True):
        rise = float(f"{scene.rise(name):.2g}")
        say(
            axes, place, 0.93, f"{word} x{rise:,.15g}", COLOURS[name], transform=axes.transAxes, ha="left", fontsize=8.8
        )


@styled
def idling_figure(study: Estimators) -> Figure:
    """Draw Fig. 3-15 and 3-16 in the wavelength domain: what a table over position takes off, and where it harms."""
    figure = new_figure(12.0, 4.8)
    panels = figure.subplots(1, 3, sharey=True, sharex=True)
    waves = np.geomspace(2.5e-6, 8e-3, 260)
    marked = {LONG: "lead", 610e-6: "balls", COGGING: "torque", SIGNAL: "encoder"}
    waves = np.unique(np.concatenate([waves, list(marked), [0.5 * COGGING, 0.5 * SIGNAL]]))
    for axes, name in zip(panels, ("thrust", "medob", "vibration"), strict=True):
        one = study.idling.feeding[name]
        before = [one.wave(one.force_n, wave) for wave in waves]
        after = [one.wave(one.left_n["beside"], wave) for wave in waves]
        axes.fill_between(1e3 * waves, 1e-4, before, color=FAINT, linewidth=0)
        axes.plot(1e3 * waves, after, color=INK if name == "thrust" else COLOURS[name], linewidth=1.4)
        axes.set(xscale="log", yscale="log", xlim=(2.5e-3, 8.0), ylim=(1e-3, 30.0), xlabel="wavelength (mm)")
        axes.set_xticks([0.01, 0.1, 1.0], ["0.01", "0.1", "1"])
        axes.set_yticks([1e-3, 1e-2, 0.1, 1.0, 10.0], ["0.001", "0.01", "0.1", "1", "10"])
        for wave, word in marked.items():
            say(axes, 1e3 * wave, 18.0, word, MUTED, ha="center", fontsize=8.5)
    panels[0].set_ylabel("amplitude of the idling force (N)")
    said_there(panels[0], "Thrust", "grey: idling; line: less a table over position,\n2 µm off its place")
    said_there(
        panels[1], "MEDOB", "section 3.4: long waves go, those of the\nencoder (9.8 µm) hardly; they need notches"
    )
    said_there(
        panels[2],
        "Vibration mode",
        "section 5.3: the wave of the lead dominates;\nthe encoder is damped by the inertia ratio",
    )
    return figure


@styled
def kalman_figure(study: Estimators) -> Figure:
    """Draw a force known from the thrust alone, with and without the lines of tooth passing in the model."""
    found = study.kalman
    figure = new_figure(9.0, 4.2)
    axes = figure.subplots()
    shown = (found.time_s > 4.0) & (found.time_s < 4.15)
    time = 1e3 * (found.time_s[shown] - 4.0)
    axes.plot(time, found.true_n[shown], color=FAINT, linewidth=6.0)
    axes.plot(time, found.blind_n[shown], color=TWIN, linewidth=1.3, marker="o", markersize=3)
    axes.plot(time, found.known_n[shown], color=CONTROLLED, linewidth=1.8, marker="o", markersize=3)
    axes.set(xlabel="time (ms), sampled at 250 Hz; grey: the true force", ylabel="force (N)", xlim=(0.0, 150.0))
    axes.set_ylim(0.0, 195.0)
    hz = independent.KALMAN_TOOTH_PASS_HZ
    said_there(axes, "Kalman filter on the thrust alone", f"tooth passing at {hz:g} Hz between modes at 32 and 88 Hz; "
               f"error over force: {found.known:.2f} with its lines, {found.blind:.2f} without")  # fmt: skip
    say(axes, 2.0, 182.0, "lines of tooth passing known", CONTROLLED, ha="left")
    say(axes, 60.0, 182.0, "force as a random walk, its delay taken off", TWIN, ha="left")
    return figure


STUDY_FIGURES = {
    "estimators-bode": bode_figure,
    "estimators-resolution": resolution_figure,
    "estimators-milling": milling_figure,
    "estimators-guides": guide_figure,
    "estimators-idling": idling_figure,
    "estimators-inertias": inertias_figure,
    "estimators-kalman": kalman_figure,
}
README_FIGURE, _SMALL_DPI = "which-estimator", 110
CHOICE_FIGURES = {README_FIGURE: which_figure, "estimators-weight": trade_figure}


def write_estimator_figures(study: Estimators, choice: Choice, directory: Path) -> list[Path]:
    """Write every figure as PNG into `directory` and list the files."""
    directory.mkdir(parents=True, exist_ok=True)
    drawn = {name: draw(study) for name, draw in STUDY_FIGURES.items()}
    drawn |= {name: draw(choice) for name, draw in CHOICE_FIGURES.items()}
    written: list[Path] = []
    for name, figure in drawn.items():
        path = directory / f"{name}.png"
        figure.savefig(path, metadata={"Software": None}, dpi=_SMALL_DPI if name == README_FIGURE else DPI)
        written.append(path)
    return written
