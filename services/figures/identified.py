"""Figures of what was identified: friction and what it leaves; responses, modes and the stabilisation diagram."""

# pyright: reportUnknownMemberType=false

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from services.figures.style import ALARM, CONTROLLED, FAINT, INK, MUTED, TWIN, halo, new_figure, styled

_MOST_POINTS = 4000


@styled
def servo_figure(keys: dict[str, Any], fit: Any, title: str) -> Figure:
    """Draw thrust without inertia over speed with both models of friction, and what they leave over time."""
    figure = new_figure(11.0, 7.2, f"{title}: {_short(keys)}")
    top, bottom = figure.subplots(2, 1, height_ratios=[1.6, 1.0])
    shown = slice(None, None, max(1, fit.series.velocity.size // _MOST_POINTS))
    v, rub = 1e3 * fit.series.velocity, fit.series.friction
    top.plot(v[shown], rub[shown], ".", markersize=2.2, color="#9aa5b1", zorder=1)
    for side in (np.linspace(v.min(), 0.0, 50), np.linspace(0.0, v.max(), 50)):
        if np.ptp(side) == 0.0:
            continue
        sign, two = np.sign(np.mean(side)), fit.forward if np.mean(side) > 0.0 else fit.backward
        parts = [0.0 if math.isnan(p) else p for p in (fit.viscous, fit.coulomb, fit.offset)]
        top.plot(side, parts[0] * side * 1e-3 + sign * parts[1] + parts[2], color=TWIN, linewidth=1.4)
        top.plot(side, two.viscous * side * 1e-3 + sign * two.coulomb, color=CONTROLLED, linewidth=1.4)
    top.set_xlabel("speed (mm/s)")
    top.set_ylabel("thrust less inertia (N)")
    for height, words, colour in (
        (0.93, "friction alike in both directions, and an offset", TWIN),
        (0.84, f"friction of each direction: {100 * fit.asymmetric_error:.1f} % of the thrust are left", CONTROLLED),
    ):
        halo(top.text(0.02, height, words, transform=top.transAxes, color=colour, fontsize=9.5, fontweight="bold"))
    time, left = fit.series.time, fit.series.left
    step = max(1, time.size // (2 * _MOST_POINTS))
    bottom.plot(time[::step], left[::step], ".", markersize=1.5, color=MUTED)
    bottom.set_ylim(*(1.3 * np.percentile(left, [0.5, 99.5])))
    bottom.set_xlabel("time (s)")
    bottom.set_ylabel("left of the thrust (N)")
    return figure


def _short(keys: dict[str, Any]) -> str:
    parts = (("mass_kg", "{:.4g} kg"), ("viscous_n_s_m", "{:.4g} N s/m"), ("coulomb_n", "{:.4g} N"))
    return ", ".join(form.format(keys[key]) for key, form in parts if not math.isnan(keys[key]))


@styled
def modes_figure(keys: dict[str, Any], frf: Any, fit: Any, title: str) -> Figure:
    """Draw the responses with their modes, the coherence, and the poles of all orders."""
    figure = new_figure(11.5, 8.0, f"{title}: {len(fit.modes)} modes")
    rows = figure.subplots(3, 1, sharex=True, height_ratios=[2.2, 0.7, 1.1])
    low, high = fit.band_hz
    low = max(low, 0.7 * min(mode.frequency_hz for mode in fit.modes))
    hz = frf.frequency_hz
    inside = (hz >= low) & (hz <= high)
    colours = [CONTROLLED, TWIN, "#00795c", ALARM, INK]
    for k, row in enumerate(frf.response):
        colour = colours[k % len(colours)]
        rows[0].semilogy(hz[inside], np.abs(row[inside]), color=colour, linewidth=0.9)
        if k < 6:
            name = keys["responses"][k]
            halo(rows[0].text(0.995, 0.95 - 0.07 * k, name, transform=rows[0].transAxes, ha="right", va="top",
                              color=colour, fontsize=9.5, fontweight="bold"))  # fmt: skip
        if frf.coherence is not None:
            rows[1].plot(hz[inside], frf.coherence[k][inside], color=colour, linewidth=0.7)
    for mode in fit.modes:
        for axes in rows:
            axes.axvline(mode.frequency_hz, color=MUTED, linewidth=0.6, linestyle=(0, (3, 3)), zorder=0)
    _name_modes(rows[0], fit.modes, (low, high))
    for order, found in enumerate(fit.diagram.frequency_hz):
        rows[2].plot(found, np.full(found.size, order + 1), ".", color=FAINT, markersize=2.5, zorder=1)
    top = len(fit.diagram.frequency_hz)
    for mode in fit.modes:
        rows[2].plot([mode.frequency_hz] * 2, [0.5 * top, top], color=ALARM, linewidth=1.6, alpha=0.8)
    if frf.coherence is None:
        rows[1].text(0.5, 0.5, "no coherence: one tap, or none told", transform=rows[1].transAxes, ha="center",
                     color=MUTED)  # fmt: skip
    rows[1].set_ylim(0.0, 1.05)
    rows[0].set_ylabel("response over force")
    rows[1].set_ylabel("coherence")
    rows[2].set_ylabel("pairs of poles")
    rows[2].set_xlabel("frequency (Hz); grey: poles of all orders, purple: those that stay and are needed")
    rows[2].set_xscale("log" if high > 20.0 * low else "linear")
    rows[2].xaxis.set_minor_formatter(NullFormatter())
    if high > 20.0 * low:
        ticks = [t for t in (5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000, 10000) if low <= t <= high]
        rows[2].set_xticks(ticks, [str(t) for t in ticks])
    rows[2].set_xlim(low, high)
    return figure


def _name_modes(axes: Any, modes: Any, band: tuple[float, float]) -> None:
    """Write the frequency over each mode; one that would cover its neighbour goes a line higher."""
    log = band[1] > 20.0 * band[0]
    low, high = (math.log(edge) if log else edge for edge in band)
    places = [((math.log(m.frequency_hz) if log else m.frequency_hz) - low) / (high - low) for m in modes]
    last = [-1.0] * 4
    for mode, place in zip(modes, places, strict=True):
        line = next((k for k, right in enumerate(last) if place - right > 0.05), int(np.argmin(last)))
        last[line] = place
        axes.annotate(f"{mode.frequency_hz:.1f}", (place, 1.01 + 0.045 * line), xycoords="axes fraction",
                      ha="center", va="bottom", fontsize=7.5, color=INK, annotation_clip=False)  # fmt: skip


def write_identified(keys: dict[str, Any], made: Any, directory: Path, title: str) -> list[str]:
    """Write the figure, where there is one, and the answer as JSON, and list the files."""
    answer = directory / "identify.json"
    answer.write_text(json.dumps(_finite(keys), indent=2) + "\n", encoding="utf-8")
    if "modes" in keys:
        drawn = modes_figure(keys, made[0], made[1], title)
    elif "mass_kg" in keys:
        drawn = servo_figure(keys, made, title)
    else:
        return [str(answer)]
    picture = directory / "identify.png"
    drawn.savefig(picture, metadata={"Software": None})
    return [str(picture), str(answer)]


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_finite(item) for item in value]
    value = value.item() if isinstance(value, np.generic) else value
    return None if isinstance(value, float) and not math.isfinite(value) else value
