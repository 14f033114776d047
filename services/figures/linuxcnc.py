"""How LinuxCNC moved the turret: requested, applied and simulated on one time axis."""

# pyright: reportUnknownMemberType=false

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from services.figures.style import (
    ALARM,
    CONTROLLED,
    INK,
    MUTED,
    SHIFT,
    TWIN,
    mark_times,
    new_figure,
    say,
    say_nothing,
    slice_of,
    styled,
)
from services.messages import Floats

AXES = (("x1", "slide X1 (mm)"), ("y1", "slide Y1 (mm)"))
BEFORE_S, AFTER_S = 0.08, 0.45


@styled
def linuxcnc_figure(
    trace: Mapping[str, Floats],
    *,
    title: str = "LinuxCNC moves the turret",
    marks: Sequence[tuple[float, str]] = (),
    bounds: Mapping[str, tuple[float, float]] | None = None,
    follower: str = "simulated slide",
) -> Figure:
    """Draw both slides, what is left between request and motion, and the feed; whole and close up.

    Parameters
    ----------
    trace
        As `read_trace` returns it.
    title
        Of the whole.
    marks
        Moments (s) and what happened then; the first one is seen close up.
    bounds
        Of the slides (mm), by axis.
    follower
        What the third line is.
    """
    figure = new_figure(12.4, 8.6)
    grid = figure.subplots(4, 2, sharex="col", width_ratios=[1.25, 1.0], height_ratios=[1.5, 1.5, 1.0, 1.0])
    grid[0, 0].set_title(title)
    if not trace or trace["time_s"].size < 2:
        say_nothing(grid[0, 0], "nothing recorded")
        return figure
    time_s = trace["time_s"]
    close, words = close_up(trace, marks)
    grid[0, 1].set_title(words)
    for column, window in enumerate(((float(time_s[0]), float(time_s[-1])), close)):
        panels: list[Axes] = list(grid[:, column])
        panels[0].set_xlim(*window)
        panels[-1].set_xlabel("time (s)")
        for axes, (name, label) in zip(panels, AXES, strict=False):
            _draw_slide(axes, trace, name, window)
            axes.set_ylabel(label if column == 0 else "")
            for bound in (bounds or {}).get(name, ()):
                axes.axhline(bound, color=ALARM, linewidth=1.0, linestyle=(0, (1, 2)))
        _draw_left(panels[2], trace, window)
        _draw_feed(panels[3], trace, window)
        _draw_fault(panels, trace)
    grid[2, 0].set_ylabel("applied minus\nrequested (µm)")
    grid[3, 0].set_ylabel("feed (mm/s)")
    _name_lines(grid[1, 0], (("requested (dashed)", INK), ("applied by LinuxCNC", CONTROLLED), (follower, TWIN)))
    _name_lines(grid[2, 0], (("X1", SHIFT), ("Y1", MUTED)))
    figure.draw_without_rendering()  # so that the marks know how wide the axes are
    for row in grid:
        for axes in row:
            mark_times(axes, [(at, word, ALARM) for at, word in marks], labelled=axes in grid[0])
    return figure


def close_up(trace: Mapping[str, Floats], marks: Sequence[tuple[float, str]] = ()) -> tuple[tuple[float, float], str]:
    """Return the time (s) around the first mark, else the last fault or the first move, and what it is called."""
    time_s = trace["time_s"]
    fault, move = (np.array([begin for begin, _ in spans(trace)][-1:]), _moves(trace))
    words = "Around the fault" if fault.size else "The first move" if move.size else "The end"
    at = float(time_s[int((fault if fault.size else move if move.size else np.array([time_s.size - 1]))[0])])
    if marks:
        at, words = marks[0][0], "Close up"
    before = 3.0 * BEFORE_S if fault.size and not marks else BEFORE_S
    return (max(at - before, float(time_s[0])), min(at + AFTER_S, float(time_s[-1]))), words


def spans(trace: Mapping[str, Floats]) -> list[tuple[int, int]]:
    """Return the first and the last cycle of every latched fault."""
    edges = np.flatnonzero(np.diff(np.concatenate(([0.0], trace["fault"] > 0.5, [0.0]))))
    return [(int(a), int(b) - 1) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def _moves(trace: Mapping[str, Floats]) -> NDArray[np.intp]:
    asked = np.hypot(np.diff(trace["requested_x1_mm"]), np.diff(trace["requested_y1_mm"]))
    return np.flatnonzero(asked > 0.0)


def write_linuxcnc_figure(trace: Mapping[str, Floats], path: Path, **words: Any) -> Path:
    """Write the figure as PNG and return where it is; `words` as `linuxcnc_figure` takes them."""
    linuxcnc_figure(trace, **words).savefig(path, metadata={"Software": None})
    return path


def _draw_slide(axes: Axes, trace: Mapping[str, Floats], name: str, window: tuple[float, float]) -> None:
    part = slice_of(trace["time_s"], window)
    time_s = trace["time_s"][part]
    axes.plot(time_s, trace[f"simulated_{name}_mm"][part], color=TWIN, linewidth=2.4, alpha=0.75)
    axes.plot(time_s, trace[f"applied_{name}_mm"][part], color=CONTROLLED, linewidth=1.4)
    axes.plot(time_s, trace[f"requested_{name}_mm"][part], color=INK, linewidth=1.2, linestyle=(0, (4, 2)))
    _at_least(axes, 0.02)


def _at_least(axes: Axes, height: float) -> None:
    """Keep noise from filling the panel."""
    low, high = axes.get_ylim()
    if high - low < height:
        middle = 0.5 * (low + high)
        axes.set_ylim(middle - 0.5 * height, middle + 0.5 * height)


def _draw_left(axes: Axes, trace: Mapping[str, Floats], window: tuple[float, float]) -> None:
    part = slice_of(trace["time_s"], window)
    for (name, _), colour in zip(AXES, (SHIFT, MUTED), strict=True):
        left = 1e3 * (trace[f"applied_{name}_mm"] - trace[f"requested_{name}_mm"])[part]
        axes.plot(trace["time_s"][part], left, color=colour, linewidth=1.2)
    _at_least(axes, 2.0)


def _draw_feed(axes: Axes, trace: Mapping[str, Floats], window: tuple[float, float]) -> None:
    """Draw the speed of the feed axis over 20 servo cycles, by their count."""
    span = 20
    if trace["cycle"].size <= span:
        return
    cycles = trace["cycle"][span:] - trace["cycle"][:-span]
    speed = -(trace["feed_mm"][span:] - trace["feed_mm"][:-span]) / (1e-3 * np.maximum(cycles, 1.0))
    time_s = trace["time_s"][span:]
    part = slice_of(time_s, window)
    axes.plot(time_s[part], speed[part], color=CONTROLLED, linewidth=1.2)
    axes.set_ylim(-0.12 * max(float(speed.max()), 1.0), 1.25 * max(float(speed.max()), 1.0))


def _draw_fault(panels: list[Axes], trace: Mapping[str, Floats]) -> None:
    low, high = panels[0].get_xlim()
    for span in spans(trace):
        begin, end = (float(trace["time_s"][k]) for k in span)
        for axes in panels:
            axes.axvspan(begin, end, color="#f6e8ef", linewidth=0, zorder=0)
        if low <= begin <= high:
            say(panels[3], begin, 0.88, " fault latched", ALARM, transform=panels[3].get_xaxis_transform(), fontsize=9)


def _name_lines(axes: Axes, names: Sequence[tuple[str, str]]) -> None:
    """Write words in the colours of the lines above the axes, where no line runs."""
    left = 0.0
    for word, colour in names:
        say(axes, left, 1.06, word, colour, fontsize=9, transform=axes.transAxes)
        left += 0.014 * len(word) + 0.03
