"""What becomes of a cut when the controller is lost: shift and vibration, held or returned."""

# pyright: reportUnknownMemberType=false

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from services.figures.style import ALARM, CONTROLLED, MUTED, TWIN, mark_times, new_figure, plain_log, say, styled
from services.guard_limits import GuardLimits
from services.loss import Lost

COLOURS = {"hold": CONTROLLED, "return": TWIN}
WORDS = {"hold": "job says hold", "return": "job says return"}


@styled
def loss_figure(cuts: Sequence[Lost], limits: GuardLimits) -> Figure:
    """Draw shift and vibration over time for each job, with the moments of the loss ladder."""
    figure = new_figure(10.6, 6.4)
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=[1.0, 1.25])
    upper.set_title("The controller falls silent in mid-cut")
    upper.set_ylabel("shift of turret 1 (deg)")
    lower.set_ylabel("vibration (µm rms)")
    lower.set_xlabel("time (s)")
    lost = cuts[0].lost_at_s
    begin, end = max(lost - 1.0, 0.0), cuts[0].time_s[-1]
    lower.set_xlim(begin, end + 0.16 * (end - begin))
    plain_log(lower)
    shown = cuts[0].time_s >= begin
    for cut in cuts:
        colour = COLOURS[cut.on_loss]
        dashes = "solid" if cut.on_loss == "hold" else (0, (5, 1.5))
        for axes, values in ((upper, cut.shift_deg), (lower, cut.vibration_um)):
            axes.plot(cut.time_s[shown], values[shown], color=colour, linestyle=dashes)
            say(axes, end + 0.01 * (end - begin), float(values[-1]), WORDS[cut.on_loss], colour)
    lower.set_ylim(0.4 * min(float(np.median(cut.vibration_um[shown])) for cut in cuts), None)
    steps = ((0.0, "last command", ALARM), (limits.loss_hold, "T1 hold", MUTED),
             (limits.loss_return, "T2 return or feed hold", MUTED), (limits.loss_fault, "T3 fault", MUTED))  # fmt: skip
    mark_times(upper, [(lost + after, word, colour) for after, word, colour in steps])
    mark_times(lower, [(lost + after, word, colour) for after, word, colour in steps], labelled=False)
    return figure


def write_loss_figure(cuts: Sequence[Lost], limits: GuardLimits, directory: Path) -> Path:
    """Write the figure as `loss.png`."""
    path = directory / "loss.png"
    loss_figure(cuts, limits).savefig(path, metadata={"Software": None})
    return path
