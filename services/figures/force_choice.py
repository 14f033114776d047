"""Which force estimator to take: a table to read at a glance, and what the weight of the motor balance trades."""

# pyright: reportUnknownMemberType=false

from __future__ import annotations

import math

from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from services.figures.force_bode import said_there
from services.figures.style import ALARM, CONTROLLED, INK, MUTED, PAPER, SHIFT, TWIN, new_figure, plain_log, say, styled
from services.reproduce.estimators.choice import NAMES, Situation, Trade
from services.reproduce.estimators.study import Choice

GOOD = LinearSegmentedColormap.from_list("good", ["#0b63a5", "#a9cbdf", "#f3f5f6", "#f2c9a8", "#c8500a"])
"""Blue: the error is small against the force; vermilion: larger than it. Okabe and Ito, so all can tell them apart."""
_NEEDS = {
    "load_side": "scale and motor encoder",
    "standing": "both and current; motor that hunts",
    "blended": "both and current; idling run",
    "optimal": "both and current; what is uncertain",
    "vibration": "both and current",
    "medob": "both and current",
    "kalman": "current; loop, tooth passing",
    "dob": "current and motor encoder",
    "thrust": "current",
}


@styled
def which_figure(choice: Choice) -> Figure:
    """Draw the error of every estimator in every situation."""
    figure = new_figure(10.4, 5.4)
    axes = figure.subplots()
    scale = Normalize(math.log10(0.04), math.log10(4.0))
    for column, situation in enumerate(choice.situations):
        _column(axes, column, situation, scale)
    for row, name in enumerate(NAMES):
        axes.text(-0.62, row - 0.13, name, ha="right", va="center", fontsize=10.5, fontweight="bold", color=INK)
        axes.text(-0.62, row + 0.2, _NEEDS[name], ha="right", va="center", fontsize=8.0, color=MUTED)
    axes.set(xlim=(-0.5, len(choice.situations) - 0.5), ylim=(len(NAMES) - 0.5, -0.5))
    axes.set_axis_off()
    figure.suptitle("Which estimator? Error over force, simulated", x=0.012, ha="left", fontsize=14, fontweight="bold",
                    color=INK)  # fmt: skip
    note = "Counts, dead times and friction as they are; believed: mass +3 %, inertia +2 %, stiffness -7 %."
    figure.supxlabel(f"{note} Framed: best, or within a tenth of it.", x=0.012, ha="left", fontsize=8.8, color=MUTED)
    return figure


def _column(axes: Axes, column: int, situation: Situation, scale: Normalize) -> None:
    best = min(situation.error.values())
    for row, name in enumerate(NAMES):
        error = situation.error[name]
        shade = float(scale(math.log10(error)))
        axes.add_patch(Rectangle((column - 0.48, row - 0.46), 0.96, 0.92, color=GOOD(min(max(shade, 0.0), 1.0)),
                                 linewidth=0))  # fmt: skip
        if error < 1.1 * best:
            axes.add_patch(Rectangle((column - 0.46, row - 0.43), 0.92, 0.86, fill=False, edgecolor=INK, linewidth=1.8))
        words = f"{100.0 * error:.0f} %" if error < 1.0 else f"{error:.1f} x"
        red, green, blue, _ = GOOD(min(max(shade, 0.0), 1.0))
        dark = 0.3 * red + 0.59 * green + 0.11 * blue < 0.53
        axes.text(column, row, words, ha="center", va="center", fontsize=11, color=PAPER if dark else INK,
                  fontweight="bold" if error < 1.1 * best else "normal")  # fmt: skip
    title = situation.title.replace(", ", "\n", 1)
    axes.text(column, -0.92, title, ha="center", va="bottom", fontsize=9.5, fontweight="bold", color=INK)
    axes.text(column, -0.6, situation.note.split(",")[0], ha="center", va="bottom", fontsize=8.0, color=MUTED)


@styled
def trade_figure(choice: Choice) -> Figure:
    """Draw the predicted error of the two-encoder family over its weight, with its parts and the optimum."""
    figure = new_figure(13.0, 4.8)
    for axes, trade in zip(figure.subplots(1, 3), choice.trades, strict=True):
        _trade(axes, trade)
    return figure


def _trade(axes: Axes, trade: Trade) -> None:
    parts = {"quantisation": (ALARM, "counts"), "friction": (TWIN, "friction"), "parameters": (SHIFT, "parameters")}
    floor = 0.2 * trade.best_n
    for part, (colour, word) in parts.items():
        values = trade.parts_n[part]
        axes.plot(trade.weight, values.clip(floor), color=colour, linewidth=1.2)
        place = int((0.5 if part == "quantisation" else 0.66) * trade.weight.size)
        if values[place] > 1.3 * floor:
            say(axes, float(trade.weight[place]), float(values[place]) * 0.84, word, colour, ha="left", fontsize=8.8)
    axes.plot(trade.weight, trade.parts_n["total"], color=INK, linewidth=2.2)
    plain_log(axes)
    for word, weight in trade.fixed.items():
        axes.plot([weight], [trade.fixed_n[word]], "o", color=INK, markersize=6, zorder=4)
        side = {"MEDOB": "right", "load side": "left", "vibration": "right"}[word]
        aside = {"left": 0.05, "right": -0.05}[side]
        say(axes, weight + aside, trade.fixed_n[word] * 1.1, word, INK, ha=side, fontsize=8.8)
    axes.plot([trade.best], [trade.best_n], "*", color=CONTROLLED, markersize=15, zorder=5)
    gain = 1.0 - trade.best_n / min(trade.fixed_n.values())
    axes.set(xlabel="weight λ of the motor balance", ylabel="predicted error (N)")
    axes.set_ylim(floor, 1.6 * float(trade.parts_n["total"].max()))
    axes.set_xlim(float(trade.weight[0]), float(trade.weight[-1]))
    best = f"{trade.best:.2f}" if abs(trade.best) > 0.01 else f"{trade.best:.4f}"
    said_there(axes, trade.title, f"{trade.note};\noptimum λ {best}: {100.0 * gain:.0f} % below the best fixed choice")
