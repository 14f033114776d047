"""How late each scheme is, and how often it cries wolf: one curve for each, as its threshold goes up."""

# pyright: reportUnknownMemberType=false

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Protocol

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from services.figures.style import ALARM, CONTROLLED, MUTED, PAPER, SHIFT, TWIN, new_figure, plain_log, say, styled
from services.messages import Floats

COLOURS = (CONTROLLED, TWIN, SHIFT, ALARM)
RANGE_MS = (-60.0, 1000.0)
SHELF = 0.4
"""Where none is drawn, in false alarms in all."""


class Setting(Protocol):
    """One point of a curve: latency, and false alarms in so many hours."""

    @property
    def p50_ms(self) -> float:
        """Median latency (ms)."""
        ...

    @property
    def p95_ms(self) -> float:
        """Latency that 95 % do not exceed (ms)."""
        ...

    @property
    def alarms(self) -> int:
        """False alarms."""
        ...

    @property
    def hours(self) -> float:
        """Hours of stable cutting that they came in (h)."""
        ...


@styled
def detector_figure(curves: Mapping[str, Sequence[Setting]], *, names: Mapping[str, str]) -> Figure:
    """Draw false alarms per hour against latency; the first curve is ours, its first point the default setting.

    A setting without a false alarm stands, hollow, on a shelf below: its rate is at most 3 over the hours heard (95 %).
    The circle is round our default.
    """
    hours = max((point.hours for curve in curves.values() for point in curve), default=1.0)
    figure = new_figure(12.4, 6.2, "How late, and how often in vain")
    left, right = figure.subplots(1, 2, sharey=True)
    for axes, share in ((left, "p50"), (right, "p95")):
        axes.set_title({"p50": "Half of the onsets found", "p95": "95 % of the onsets found"}[share])
        axes.set_xlabel(f"latency from the true onset, {share} (ms)")
        plain_log(axes)
        axes.set_xlim(*RANGE_MS)
        axes.set_ylim(SHELF / hours / 1.9, 6000.0)
        axes.axhspan(SHELF / hours / 1.9, SHELF / hours * 2.2, color="#f0f3f5", linewidth=0, zorder=0)
        for number, (name, curve) in enumerate(curves.items()):
            _draw(axes, curve, share, COLOURS[number], SHELF / hours, ours=number == 0)
            if share == "p50":
                say(axes, 0.98, 0.96 - 0.055 * number, names[name], COLOURS[number], ha="right",
                    transform=axes.transAxes)  # fmt: skip
        none = f"none in {hours:.3g} h: at most {3.0 / hours:.2g} per hour "
        say(axes, RANGE_MS[1], SHELF / hours * 1.3, none, MUTED, ha="right", va="bottom", fontsize=9,
            fontweight="normal")  # fmt: skip
    left.set_ylabel("false alarms per hour of stable cutting")
    return figure


def _draw(axes: Axes, curve: Sequence[Setting], share: str, colour: str, shelf: float, *, ours: bool) -> None:
    late, rate = _numbers(curve, share)
    shown = np.isfinite(late) & (late <= RANGE_MS[1]) & (late >= RANGE_MS[0])
    order = np.argsort(late[shown], kind="stable")
    late, rate = late[shown][order], rate[shown][order]
    if not ours:  # of those without a false alarm only the quickest says something
        last = int(np.argmax(rate == 0.0)) + 1 if (rate == 0.0).any() else rate.size
        late, rate = late[:last], rate[:last]
    none = rate == 0.0
    height = np.where(none, shelf, rate)
    axes.plot(late, height, color=colour, linewidth=2.4 if ours else 1.6, zorder=4 if ours else 3)
    size = 6.5 if ours else 3.5
    axes.plot(late[~none], height[~none], "o", color=colour, markersize=size, zorder=5)
    axes.plot(late[none], height[none], "o", color=colour, markersize=size, markerfacecolor=PAPER, zorder=5)
    default = _numbers(curve[:1], share)
    if ours and np.isfinite(default[0]).all():
        axes.plot(default[0], np.maximum(default[1], shelf), "o", color=colour, markersize=14, markerfacecolor="none",
                  zorder=6)  # fmt: skip


def _numbers(curve: Sequence[Setting], share: str) -> tuple[Floats, Floats]:
    """Return latency (ms) and rate (1/h)."""
    late = np.array([getattr(point, f"{share}_ms") for point in curve], dtype=np.float64)
    return late, np.array([point.alarms / point.hours if point.hours else np.nan for point in curve])
