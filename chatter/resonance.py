"""Whether one line of a comb stands out by more than any structure could lift it."""

import numpy as np
from numpy.typing import NDArray

from chatter.comb import on_comb, tolerance
from chatter.lines import Lines

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

LEAST_DAMPING = 0.005
"""No structure that is cut with is damped less; its resonance can lift one harmonic over its neighbours only so far."""
UNEVEN = 2.0
"""Ratio of amplitudes that neighbours in a force may have."""


def stands_alone(lines: Lines, line: int, fundamental_hz: float, tools: int | None) -> bool:
    """Return whether a line stands out of its neighbours in a comb by more than any mode could lift it.

    The gain of a mode falls from its peak by sqrt(1 + (d / (damping f))^2) over a distance d. In a comb of the spindle
    most of which is tooth passing, a line of run-out is compared with what stands between its own sidebands.

    Parameters
    ----------
    lines : Lines
        Lines.
    line : int
        Index of the line.
    fundamental_hz : float
        Fundamental of the comb (Hz).
    tools : int or None
        Cutting edges that pass per revolution, when the comb is that of the spindle.
    """
    frequency, power = lines.frequency_hz, lines.power
    slack = tolerance(frequency, lines.spacing_hz)
    order, own = np.round(frequency / fundamental_hz), round(float(frequency[line]) / fundamental_hz)
    on = on_comb(frequency, fundamental_hz, 2.0 * slack)
    stride = tools or _stride(order, own, on, power)
    runout = stride > 1 and own % stride != 0
    for step in range(1, 9):
        if runout and step % stride == 0:
            continue
        drop = UNEVEN * np.hypot(1.0, step * fundamental_hz / (LEAST_DAMPING * frequency[line]))
        beside = on & (np.abs(order - own) == step)
        if power[line] <= drop**2 * max(float(power[beside].max(initial=0.0)), float(lines.floor[line])):
            return False
    return True


def _stride(order: Floats, own: int, on: Flags, power: Floats) -> int:
    """Return how many teeth the comb has, when most of it apart from the line's own kin is tooth passing."""
    for teeth in range(8, 1, -1):
        others = on & ((order - own) % teeth != 0)
        if (
            own % teeth
            and others.sum() >= 3
            and power[others & (order % teeth == 0)].sum() >= 0.8 * power[others].sum()
        ):
            return teeth
    return 1
