"""Figures of a sweep: how far a case stays stable."""

# pyright: reportUnknownMemberType=false

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from services.figures.charts import MEASURED_PI
from services.figures.style import ALARM, CONTROLLED, FAINT, INK, POWER, TWIN, new_figure, say, say_nothing, styled
from services.sweep.axes import Axis
from services.sweep.sweep import Sweep

SHOWN = {
    "open": ("amplitude_um", "vibration (µm)"),
    "closed": ("ra_after_um", "roughness Ra after (µm)"),
    "linear": ("growth_rate_1_s", "growth rate (1/s)"),
}
HOW = {"open": "turret 1 standing", "closed": "in closed loop", "linear": "linear theory"}


@styled
def sweep_figure(sweep: Sweep) -> Figure:
    """Draw the first axis, or the first two as a map, with what is stable."""
    figure = new_figure(10.6, 5.4)
    axes = figure.subplots()
    axes.set_title(f"{sweep.task.name}: {len(sweep.results)} cells, {HOW[sweep.task.mode]}")
    long = [k for k, axis in enumerate(sweep.axes) if len(axis.values) > 1]
    if not long:
        say_nothing(axes, "one cell has no map")
        return figure
    name, label = SHOWN[sweep.task.mode]
    values, stable = sweep.values(name), sweep.values("stable")
    rest = tuple(k for k in range(len(sweep.axes)) if k not in long[:2])
    with np.errstate(all="ignore"):
        values, stable = _worst(values, rest), _least(stable, rest)
    if len(long) == 1:
        _line(axes, sweep.axes[long[0]], values, stable, label)
    else:
        _map(figure, axes, sweep.axes[long[0]], sweep.axes[long[1]], values, stable, label)
    if sweep.axes[long[0]].kind.name == "phase_pi":
        for edge in MEASURED_PI:
            axes.axvline(edge, color=CONTROLLED, linewidth=1.0, linestyle=(0, (4, 3)))
        say(axes, 0.5 * sum(MEASURED_PI), 1.0, "measured stable", CONTROLLED, transform=axes.get_xaxis_transform(),
            ha="center", va="top", fontsize=9)  # fmt: skip
    return figure


def _worst(values: np.ndarray, over: tuple[int, ...]) -> np.ndarray:
    return np.where(np.isnan(values).all(axis=over), np.nan, np.nanmax(np.nan_to_num(values, nan=-np.inf), axis=over))


def _least(values: np.ndarray, over: tuple[int, ...]) -> np.ndarray:
    return np.where(np.isnan(values).all(axis=over), np.nan, np.nanmin(np.nan_to_num(values, nan=np.inf), axis=over))


def _places(axis: Axis) -> tuple[np.ndarray, list[str] | None]:
    if axis.kind.words:
        return np.arange(len(axis.values), dtype=float), [str(value) for value in axis.values]
    return np.array([float(value) for value in axis.values]), None


def _line(axes: Axes, axis: Axis, values: np.ndarray, stable: np.ndarray, label: str) -> None:
    at, words = _places(axis)
    axes.plot(at, values, color=FAINT, linewidth=2.0, zorder=1)
    for good, colour in ((1.0, CONTROLLED), (0.0, TWIN)):
        chosen = stable == good
        axes.plot(at[chosen], values[chosen], "o", color=colour, markersize=6)
    missing = np.isnan(values)
    axes.plot(at[missing], np.zeros(int(missing.sum())), "x", color=ALARM, markersize=7)
    if words:
        axes.set_xticks(at, words)
    axes.set_xlabel(axis.kind.label)
    axes.set_ylabel(label)
    axes.margins(y=0.15)
    if np.nanmin(values, initial=0.0) >= 0.0:
        axes.set_ylim(bottom=0.0)
    axes.text(0.01, 0.97, "blue: stable   orange: chatters   ×: not run or failed", transform=axes.transAxes,
              va="top", fontsize=9, color=INK)  # fmt: skip


def _map(
    figure: Figure, axes: Axes, first: Axis, second: Axis, values: np.ndarray, stable: np.ndarray, label: str
) -> None:
    x, x_words = _places(first)
    y, y_words = _places(second)
    positive = values[np.isfinite(values) & (values > 0.0)]
    spread = positive.size > 1 and positive.max() > 30.0 * positive.min() and "growth" not in label
    norm = LogNorm(positive.min(), positive.max()) if spread else None
    mesh = axes.pcolormesh(x, y, values.T, cmap=POWER, norm=norm, shading="nearest", rasterized=True)
    figure.colorbar(mesh, ax=axes, label=label)
    if np.isfinite(stable).all() and 0.0 < stable.mean() < 1.0 and min(stable.shape) > 1:
        axes.contour(x, y, stable.T, levels=[0.5], colors=[TWIN], linewidths=2.0)
    gaps = np.argwhere(np.isnan(stable))
    axes.plot(x[gaps[:, 0]], y[gaps[:, 1]], "x", color=ALARM, markersize=5)
    if x_words:
        axes.set_xticks(x, x_words)
    if y_words:
        axes.set_yticks(y, y_words)
    axes.grid(False)
    axes.set_xlabel(first.kind.label)
    axes.set_ylabel(second.kind.label)


def write_sweep_figure(sweep: Sweep, folder: Path) -> str:
    """Write the figure, and return its path."""
    path = folder / "sweep.png"
    sweep_figure(sweep).savefig(path, metadata={"Software": None})
    return str(path)
