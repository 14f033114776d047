"""The figure of a force that was estimated from a recording."""

# pyright: reportUnknownMemberType=false

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from services.estimated import Estimated
from services.figures.style import CONTROLLED, FAINT, MUTED, TWIN, draw_band, new_figure, say, styled

_LOW_HZ = 5.0


@styled
def force_figure(found: Estimated, title: str) -> Figure:
    """Draw force, speed, and the spectrum of the force."""
    keys = found.keys()
    heading = f"{title}: {keys['mean_n']:.4g} N in the mean, {keys['std_n']:.3g} N about it"
    figure = new_figure(11.5, 7.6, heading)
    top, middle, bottom = figure.subplots(3, 1, height_ratios=[1.9, 0.8, 1.2])
    force = np.where(np.isfinite(found.force_n), found.force_n, 0.0)
    draw_band(top, found.time_s, force, CONTROLLED)
    if found.time_s.size < 3200:
        top.plot(found.time_s, found.force_n, color=CONTROLLED, linewidth=0.8)
    rate = (found.time_s.size - 1) / max(float(found.time_s[-1] - found.time_s[0]), 1e-12)
    width = max(1, round(rate / _LOW_HZ))
    flat = np.ones(min(width, force.size))
    slow = np.convolve(force, flat, mode="same") / np.convolve(np.ones(force.size), flat, mode="same")
    step = max(1, slow.size // 3000)
    top.plot(found.time_s[::step], slow[::step], color=TWIN, linewidth=1.2)
    if found.predicted_error_n is not None:
        level, error = float(keys["mean_n"]), found.predicted_error_n
        top.axhspan(level - error, level + error, color=FAINT, zorder=0)
        words = f" mean +- {error:.2g} N, the error that is predicted"
        say(top, found.time_s[0], level + error, words, MUTED, va="bottom", fontsize=8.5)
    top.set_ylabel(f"force (N), {found.estimator.replace('_', ' ')}")
    words = f"mean of {1e3 / _LOW_HZ:.0f} ms "
    say(top, found.time_s[-1], float(slow[-1]), words, TWIN, ha="right", va="top", fontsize=8.5)
    middle.plot(found.time_s[::step], 1e3 * found.speed_m_s[::step], color=MUTED, linewidth=1.2)
    middle.set_ylabel("speed (mm/s)")
    middle.set_xlabel(f"time (s), {found.latency_ms:.2f} ms of latency taken off")
    middle.sharex(top)
    size = 1 << max(3, min(14, int(np.log2(max(force.size, 8)))))
    parts = force[: force.size // size * size].reshape(-1, size) - force.mean()
    window = np.hanning(size)
    lines = np.sqrt(np.mean(np.abs(np.fft.rfft(parts * window)) ** 2, axis=0)) * 2.0 / window.sum()
    hz = np.arange(lines.size) * rate / size
    shown = (hz > 0.0) & (hz <= 1.5 * found.cutoff_hz)
    bottom.semilogy(hz[shown], np.maximum(lines[shown], 1e-12), color=CONTROLLED, linewidth=1.0)
    bottom.axvline(found.cutoff_hz, color=MUTED, linewidth=0.8, linestyle=(0, (4, 3)))
    bottom.set_xlabel("frequency (Hz); dashed: edge of the low-pass")
    bottom.set_ylabel("amplitude (N)")
    return figure


def write_force_figure(found: Estimated, directory: Path, title: str) -> Path:
    """Write the figure and return where."""
    path = directory / "force.png"
    force_figure(found, title).savefig(path, metadata={"Software": None})
    return path
