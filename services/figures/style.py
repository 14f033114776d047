"""How all figures look: one palette that survives colour blindness and grey printing, labels instead of legends."""

# pyright: reportUnknownMemberType=false

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import wraps
from typing import Any, ParamSpec

import matplotlib as mpl
import numpy as np
from matplotlib import patheffects
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.text import Text
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator
from matplotlib.transforms import ScaledTranslation

from services.messages import Floats

INK, MUTED, FAINT, PAPER = "#1c2733", "#5f6b78", "#d9dee3", "#ffffff"
TWIN, CONTROLLED, SHIFT, ALARM = "#c8500a", "#0b63a5", "#00795c", "#8a1c5b"
"""Without control (vermilion), with control (blue), the turret (green), detection (purple): Okabe and Ito, darkened."""

POWER = LinearSegmentedColormap.from_list(
    "power", ["#f8fafb", "#dce9f0", "#a9cbdf", "#6aa3cb", "#2f74ad", "#174a80", "#0d2b55", "#071530"]
)
"""Light is quiet: readable on paper, and lightness falls evenly, so grey prints keep the order."""

STYLE: dict[Any, Any] = {
    "font.size": 10.0,
    "axes.titlesize": 11.5,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.titlepad": 8.0,
    "axes.labelsize": 10.0,
    "axes.labelcolor": MUTED,
    "axes.edgecolor": "#9aa5b1",
    "axes.linewidth": 0.8,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#e9edf0",
    "grid.linewidth": 0.8,
    "axes.axisbelow": True,
    "xtick.color": MUTED,
    "ytick.color": MUTED,
    "xtick.labelsize": 9.0,
    "ytick.labelsize": 9.0,
    "text.color": INK,
    "axes.titlecolor": INK,
    "figure.facecolor": PAPER,
    "savefig.facecolor": PAPER,
    "lines.linewidth": 1.6,
    "lines.solid_joinstyle": "round",
    "legend.frameon": False,
    "figure.constrained_layout.h_pad": 0.06,
    "figure.constrained_layout.w_pad": 0.08,
}

DPI = 144
Arguments = ParamSpec("Arguments")


def styled(draw: Callable[Arguments, Figure]) -> Callable[Arguments, Figure]:
    """Draw with the house style, leaving the caller's matplotlib settings alone."""

    @wraps(draw)
    def inner(*args: Arguments.args, **kwargs: Arguments.kwargs) -> Figure:
        with mpl.rc_context():
            mpl.rcdefaults()
            mpl.rcParams.update(STYLE)
            return draw(*args, **kwargs)

    return inner


def new_figure(width_in: float, height_in: float, title: str = "") -> Figure:
    """Make an empty figure with a heading; no pyplot, so nothing is remembered between runs."""
    figure = Figure(figsize=(width_in, height_in), layout="constrained", dpi=DPI)
    FigureCanvasAgg(figure)
    if title:
        figure.suptitle(title, x=0.012, ha="left", fontsize=14, fontweight="bold", color=INK)
    return figure


def halo(text: Text, width: float = 3.0) -> Text:
    """Give a text a paper-coloured outline, so that it can stand on anything."""
    text.set_path_effects([patheffects.withStroke(linewidth=width, foreground=PAPER, alpha=0.9)])
    return text


def say(axes: Axes, x: float, y: float, words: str, colour: str, **options: object) -> Text:
    """Write a label straight onto the data; `x` in data units, `y` too unless a transform says otherwise."""
    settings: dict[str, object] = {"color": colour, "fontsize": 9.5, "fontweight": "bold", "va": "center", **options}
    return halo(axes.text(x, y, words, **settings))  # pyright: ignore[reportArgumentType]


def say_nothing(axes: Axes, words: str) -> None:
    """Say in an empty panel why it is empty."""
    axes.text(0.5, 0.5, words, transform=axes.transAxes, ha="center", va="center", color=MUTED, fontsize=11)


def spread(positions: Sequence[float], widths: Sequence[float], low: float, high: float) -> list[float]:
    """Move the left edges of labels, given in order, so that none overlaps and all stay inside [low, high]."""
    left: list[float] = []
    edge = low
    for position, width in zip(positions, widths, strict=True):
        left.append(max(position - 0.5 * width, edge))
        edge = left[-1] + width
    edge = high
    for i in range(len(left) - 1, -1, -1):
        left[i] = max(min(left[i], edge - widths[i]), low)
        edge = left[i]
    return left


def mark_times(axes: Axes, marks: Sequence[tuple[float, str, str]], *, labelled: bool = True) -> None:
    """Draw moments as thin lines, named in a row above the axes however close together they lie.

    `marks` are (time (s), word, colour); the x limits must be final, and the title of the axes makes room.
    """
    low, high = axes.get_xlim()
    shown = sorted(mark for mark in marks if low <= mark[0] <= high)
    if not shown:
        return
    for time_s, _, colour in shown:
        axes.axvline(time_s, color=colour, linewidth=1.0, alpha=0.75, zorder=2.5)
    if not labelled:
        return
    root = axes.get_figure(root=True)
    if root is None:
        return
    inches = max(axes.get_window_extent().width / root.dpi, 1.0)
    widths = [(0.078 * len(word) + 0.14) * (high - low) / inches for _, word, _ in shown]
    lefts = spread([time_s for time_s, _, _ in shown], widths, low, high)
    where = axes.get_xaxis_transform()
    raised = where + ScaledTranslation(0.0, 11.0 / 72.0, root.dpi_scale_trans)
    for (time_s, word, colour), left, width in zip(shown, lefts, widths, strict=True):
        axes.annotate(
            word, (time_s, 1.0), (left + 0.5 * width, 1.0), xycoords=where, textcoords=raised, color=colour,
            fontsize=8.5, fontweight="bold", ha="center", va="bottom", annotation_clip=False,
            arrowprops={"arrowstyle": "-", "color": colour, "linewidth": 0.9, "shrinkA": 0.0, "shrinkB": 0.0,
                        "relpos": (0.5, 0.0)},
        )  # fmt: skip
    axes.set_title(axes.get_title(loc="left"), pad=27.0)


def plain_log(axes: Axes) -> None:
    """Give axes a logarithmic scale with numbers that are read as they stand: 0.5, 1, 2, 5, 10."""
    axes.set_yscale("log")
    axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0), numticks=14))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.yaxis.set_minor_locator(NullLocator())


def outline(time_s: Floats, values: Floats, columns: int = 1600) -> tuple[Floats, Floats, Floats]:
    """Reduce a long series to what a screen can show: time, least and greatest value of each column."""
    step = max(values.size // columns, 1)
    whole = values.size // step * step
    if whole == 0:
        return np.zeros(0), np.zeros(0), np.zeros(0)
    stacked = values[:whole].reshape(-1, step)
    return time_s[:whole:step], stacked.min(axis=1), stacked.max(axis=1)


def draw_band(axes: Axes, time_s: Floats, values: Floats, colour: str, alpha: float = 1.0) -> None:
    """Fill a fast oscillation between its least and greatest values, as an oscilloscope shows it."""
    at, low, high = outline(time_s, values)
    if at.size > 1:
        axes.fill_between(at, low, high, color=colour, alpha=alpha, linewidth=0.4)


def slice_of(time_s: Floats, window_s: tuple[float, float]) -> slice:
    """Find the samples that lie in a stretch of time."""
    return slice(int(np.searchsorted(time_s, window_s[0])), int(np.searchsorted(time_s, window_s[1])))
