"""Frequency responses of the force estimators, with the numbers of the thesis marked."""

# pyright: reportUnknownMemberType=false

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from chatter.observers.analytic import analytic_response
from services.figures.style import ALARM, CONTROLLED, FAINT, INK, MUTED, SHIFT, TWIN, new_figure, plain_log, say, styled
from services.messages import Floats
from services.reproduce.estimators import independent
from services.reproduce.estimators import published as print_
from services.reproduce.estimators.kit import believed, drive_of
from services.reproduce.estimators.others import triple_gains
from services.reproduce.estimators.response import gain_of, good_up_to
from services.reproduce.estimators.study import Estimators

HZ: Floats = np.geomspace(10.0, 1000.0, 1500)
_PHASES = np.arange(-180.0, 181.0, 90.0)
Curve = tuple[str, np.ndarray, str, str]
"""Words, response, colour, dashes."""


def said_there(axes: Axes, title: str, words: str) -> None:
    """Title a panel and write what the source says under the title."""
    axes.set_title(title, pad=8.0 + 12.0 * (words.count("\n") + 1))
    note = axes.text(
        0.0, 1.012, words, transform=axes.transAxes, fontsize=8.8, color=MUTED, va="bottom", style="italic"
    )
    note.set_in_layout(False)


def decades(axes: Axes, ticks: Sequence[int]) -> None:
    """Give an axis of frequencies a logarithmic scale with these numbers."""
    axes.set(xscale="log", xlim=(ticks[0], ticks[-1]))
    axes.set_xticks(ticks, [f"{tick}" for tick in ticks])
    axes.xaxis.set_minor_formatter(NullFormatter())


@styled
def bode_figure(_: Estimators) -> Figure:
    """Draw what a rigid model, dead times and a wrong mass do to gain and phase."""
    figure = new_figure(13.0, 6.6)
    panels = figure.subplots(2, 3, sharex=True, height_ratios=[1.7, 1.0])
    _rigid(panels[:, 0])
    _dead_times(panels[:, 1])
    _mass(panels[:, 2])
    panels[0, 0].set_ylabel("estimate over force")
    panels[1, 0].set_ylabel("phase (deg)")
    for axes in panels[1]:
        axes.set_xlabel("frequency (Hz)")
    return figure


def _curves(panels: np.ndarray, curves: list[Curve], limits: tuple[float, float]) -> None:
    gain, phase = panels
    gain.axhspan(0.9, 1.1, color=FAINT, alpha=0.7, linewidth=0)
    for _, response, colour, dashes in curves:
        gain.plot(HZ, np.abs(response), color=colour, linestyle=dashes)
        angle = np.degrees(np.angle(response))
        angle[1:][np.abs(np.diff(angle)) > 180.0] = np.nan
        phase.plot(HZ, angle, color=colour, linestyle=dashes, linewidth=1.2)
    plain_log(gain)
    decades(gain, (10, 20, 50, 100, 200, 500, 1000))
    gain.set_ylim(limits)
    phase.set(ylim=(-190.0, 190.0), yticks=_PHASES)


def _rigid(panels: np.ndarray) -> None:
    gain = panels[0]
    curves: list[Curve] = []
    for name, colour in (("machine-a", TWIN), ("machine-b", ALARM)):
        drive = believed(drive_of(name), lags=False, counts=False)
        curves.append((print_.TITLE[name], analytic_response("dob", drive, drive, HZ), colour, "-"))
    _curves(panels, curves, (0.05, 9.0))
    said_there(gain, "One inertia: DOB", "Fig. 2-3: right at low frequency, wrong at the resonance,\n"
               "335 and 408 Hz (dotted); rings: independent calculation")  # fmt: skip
    for (name, _, colour, _), machine in zip(curves, print_.MACHINES, strict=True):
        size, at, ten = independent.DOB_PEAK[machine]
        for axes in panels:
            axes.axvline(print_.PRINTED[machine].resonance_hz, color=colour, linewidth=1.0, linestyle=(0, (1, 2)))
        gain.plot([at], [size], "o", markerfacecolor="none", markeredgecolor=INK, markersize=9, zorder=4)
        gain.plot([ten], [1.1], "v", color=colour, markersize=6, zorder=4)
        left = machine == "machine-a"
        say(gain, at * (0.93 if left else 1.06), size * 1.02, name.replace("machine", "").strip(), colour,
            ha="right" if left else "left")  # fmt: skip
    say(gain, 12.0, 0.8, "10 % wrong from 103, 123 Hz", MUTED, ha="left", fontsize=8.8)


def _dead_times(panels: np.ndarray) -> None:
    cases = (
        ("thrust", "thrust", "full", MUTED, "-"),
        ("none", "medob", "none", TWIN, "-"),
        ("T1 only", "medob", "thrust", ALARM, "-"),
        ("all", "medob", "full", CONTROLLED, "-"),
    )
    curves = [(words, gain_of(name, how, HZ), colour, dashes) for words, name, how, colour, dashes in cases]
    _curves(panels, curves, (0.05, 40.0))
    gain = panels[0]
    said_there(gain, "Dead times, machine A: MEDOB", "Fig. 4-3: compensated it is as without dead times, else wrong\n"
               "around 100 Hz; triangles (Hz): 10 % wrong from there on")  # fmt: skip
    fine = np.linspace(20.0, 1000.0, 4901)
    for _, name, how, colour, _ in cases[:3]:
        at = good_up_to(gain_of(name, how, fine), fine)
        gain.plot([at], [1.1], "v", color=colour, markersize=7, zorder=4)
        say(gain, at, 0.78, f"{at:.0f}", colour, ha="center",
            fontsize=8.8)  # fmt: skip
    say(gain, 205.0, 22.0, "none", TWIN, ha="left")
    say(gain, 290.0, 4.0, "T1 only", ALARM, ha="left")
    say(gain, 11.5, 0.5, "all: within 10 % to 1 kHz", CONTROLLED, ha="left")
    say(gain, 480.0, 0.2, "thrust", MUTED, ha="right")


def _mass(panels: np.ndarray) -> None:
    curves: list[Curve] = []
    for factor, colour in ((0.5, TWIN), (1.5, SHIFT)):
        curves.append((f"times {factor:g}", gain_of("medob", "full", HZ, lags=False, mass=factor), colour, "-"))
        other = gain_of("vibration", "full", HZ, lags=False, mass=factor)
        curves.append(("", other, INK, (0, (1.5, 3.0))))  # pyright: ignore[reportArgumentType]
    _curves(panels, curves, (0.3, 4.0))
    gain, phase = panels
    said_there(gain, "Wrong mass, machine A", "Fig. 4-2, 5-6: matters at high frequency, alike for MEDOB\n"
               "(solid) and vibration mode (dotted); rings: independent")  # fmt: skip
    for factor, (size, angle) in independent.MASS_ERROR.items():
        gain.plot([335.0], [size], "o", markerfacecolor="none", markeredgecolor=INK, markersize=9, zorder=4)
        phase.plot([335.0], [angle], "o", markerfacecolor="none", markeredgecolor=INK, markersize=9, zorder=4)
        colour = TWIN if factor < 1.0 else SHIFT
        say(gain, 160.0 if factor < 1.0 else 480.0, 1.5 if factor < 1.0 else 2.2, f"times {factor:g}", colour,
            ha="right" if factor < 1.0 else "left")  # fmt: skip


@styled
def inertias_figure(_: Estimators) -> Figure:
    """Draw Fig. 2-9: one, two and three inertias in the model of a drive that has three."""
    figure = new_figure(7.4, 4.8)
    axes = figure.subplots()
    hz = np.geomspace(50.0, 1000.0, 1200)
    gains = triple_gains(hz)
    axes.axhspan(0.9, 1.1, color=FAINT, alpha=0.7, linewidth=0)
    shown = {
        "one, DOB": TWIN, "two, MEDOB": ALARM, "two, vibration mode": SHIFT, "three, MEDOB": CONTROLLED,
    }  # fmt: skip
    for name, colour in shown.items():
        axes.plot(hz, np.abs(gains[name]), color=colour)
    plain_log(axes)
    decades(axes, (50, 100, 200, 500, 1000))
    axes.set(ylim=(0.1, 15.0), xlabel="frequency (Hz)", ylabel="estimate over force")
    said_there(axes, "Inertias in the model, drive of three",
               "Fig. 2-9: accuracy decreases at 366 and 770 Hz (dotted) with too few sensors")  # fmt: skip
    for line_hz in print_.TRIPLE_HZ:
        axes.axvline(line_hz, color=MUTED, linewidth=1.0, linestyle=(0, (1, 2)))
    places = {
        "one, DOB": (250.0, 5.0), "two, MEDOB": (470.0, 0.17), "two, vibration mode": (420.0, 0.7),
        "three, MEDOB": (52.0, 0.85),
    }  # fmt: skip
    for name, (at, level) in places.items():
        say(axes, at, level, name, shown[name], ha="right" if name == "one, DOB" else "left")
    return figure
