"""The vibration of the two-delay equation once tools lose contact: forces stop, and the surface remembers.

A tool in contact leaves its own depth; one that has lost contact leaves what it met, and the next tool meets that one
nominal cut thicker (multiple regeneration). A flank that is fed too fast into the cut adds damping. Every change of
contact and every kink that it left in the surface is met at its own time, so that the error is that of smooth motion.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from turning_sim import _contact_kernels as kernels
from turning_sim._check import require
from turning_sim.delay_equation import DelayEquation, step_of
from turning_sim.simulator import SimulationDiverged

_Floats = np.ndarray
_PER_SAMPLE, _SPARE = 12, 256


class ContactVibration:
    """A vibration of any size from a given past on, advanced piece by piece; any cutting gives the same numbers.

    Parameters
    ----------
    equation : DelayEquation
        What vibrates.
    nominal_cut : float
        How much a tool may move out before it loses contact: steady force over cutting stiffness (m).
    flank_factor : float
        Added damping of a tool over its process damping, once its flank touches.
    flank_speed : float
        Speed into the cut from which the flank touches: surface speed times tan of the clearance (m/s).
    sample_rate_hz : float
        Samples per second (Hz), at least six for each wave.
    past : callable or None
        Displacement (m) of an array of times (s) up to 0, both tools in contact; None for rest.
    impulse : float
        On the bar at time 0 (N s).

    Attributes
    ----------
    sample : int
        Number of the last sample; sample 0 is at time 0.
    """

    def __init__(
        self,
        equation: DelayEquation,
        *,
        nominal_cut: float,
        flank_factor: float = 0.0,
        flank_speed: float = math.inf,
        sample_rate_hz: float = 9000.0,
        past: Callable[[_Floats], _Floats] | None = None,
        impulse: float = 0.0,
    ) -> None:
        require(nominal_cut > 0.0 and math.isfinite(nominal_cut), "nominal_cut", "positive", nominal_cut)
        require(flank_factor >= 0.0 and math.isfinite(flank_factor), "flank_factor", "at least 0", flank_factor)
        require(flank_speed > 0.0, "flank_speed", "positive", flank_speed)
        require(math.isfinite(impulse), "impulse", "finite", impulse)
        step, h = step_of(equation, sample_rate_hz), 1.0 / sample_rate_hz
        touching = flank_factor if math.isfinite(flank_speed) else 0.0
        self.equation, self.sample_rate_hz, self.sample = equation, sample_rate_hz, 0
        self._cut = kernels.Cut(
            c=equation.damping / equation.modal_mass * h,
            k=equation.stiffness / equation.modal_mass * h * h,
            cp=equation.process_damping / equation.modal_mass * h,
            flank=touching * equation.process_damping / equation.modal_mass * h,
            stiffness=equation.cutting_stiffness / equation.modal_mass * h * h,
            mu=equation.overlap,
            h0=nominal_cut,
            lim=flank_speed * h if touching else 0.0,
            tau1=step.tau1,
            tau2=step.tau2,
            push=step.push,
        )
        self._state = self._begin(past, impulse)

    @property
    def losses(self) -> int:
        """How often a tool has lost contact so far."""
        return int(self._state["k"][kernels.LOSSES])

    def advance(self, samples: int, force: np.ndarray | None = None) -> np.ndarray:
        """Return the displacement (m) at the next samples.

        Parameters
        ----------
        samples : int
            How many.
        force : ndarray or None
            On the bar (N) at these samples, linear between them and 0 up to time 0, shape (samples,).

        Returns
        -------
        ndarray
            Shape (samples,).
        """
        require(samples >= 0, "samples", "at least 0", samples)
        push = np.zeros(samples) if force is None else np.asarray(force, dtype=np.float64)
        require(push.shape == (samples,), "force", f"of shape ({samples},)", push.shape)
        require(bool(np.isfinite(push).all()), "force", "finite", "a force that is not")
        state, moved = self._state, np.empty(samples)
        push = np.concatenate([state["force"], push])
        state["force"] = push[-1:].copy()
        status = kernels.advance(self._cut, push, state["piece"], state["k"], state["f"], np.zeros(kernels.WORK), moved)
        self.sample = int(state["k"][kernels.SAMPLE])
        if status != kernels.Status.OK:
            raise SimulationDiverged(sample=self.sample, hint=_HINTS[kernels.Status(status)])
        return moved

    def snapshot(self) -> dict[str, Any]:
        """Return a copy of the whole state."""
        return {name: value.copy() for name, value in self._state.items()}

    def restore(self, snapshot: dict[str, Any]) -> None:
        """Go back to a state from `snapshot`."""
        self._state = {name: value.copy() for name, value in snapshot.items()}
        self.sample = int(self._state["k"][kernels.SAMPLE])

    def _begin(self, past: Callable[[_Floats], _Floats] | None, impulse: float) -> dict[str, np.ndarray]:
        """Return the state at time 0: the past as one piece for each sample."""
        cut, rate = self._cut, self.sample_rate_hz
        count = math.ceil(max(cut.tau1, cut.tau2)) + 2
        size = 2 ** math.ceil(math.log2(_PER_SAMPLE * count + _SPARE))
        places = np.arange(-count, 0)[:, None] + kernels.AT
        moved = np.zeros(places.shape) if past is None else np.asarray(past(places / rate), dtype=np.float64)
        require(moved.shape == places.shape, "past", "a function of an array of times", moved.shape)
        most, largest = cut.h0 / (1.0 + abs(cut.mu)), float(np.abs(moved).max())
        require(largest < most, "past", f"below {most:.4g} m, so that both tools are in contact", largest)
        piece, k = np.zeros((size, kernels.COLUMNS)), np.zeros(kernels.COUNTS, dtype=np.int64)
        series = moved @ kernels.FIT
        piece[:count, kernels.NUMBER], piece[:count, kernels.END] = np.arange(-count, 0), 1.0
        piece[:count, kernels.SCALE], piece[:count, kernels.KINKS : kernels.LEFT] = 1.0, kernels.SMOOTH
        for tool, sign in enumerate((1.0, -1.0)):
            first = kernels.LEFT + tool * kernels.TERMS
            piece[:count, first : first + kernels.POINTS] = sign * series
        speed = float(np.arange(1, kernels.POINTS) @ series[-1, 1:]) + impulse * cut.push * rate
        k[[kernels.PIECES, kernels.NEXT, kernels.NEXT + 1]] = count
        k[kernels.TOUCHES : kernels.TOUCHES + 2] = 1
        k[kernels.FLANK] = np.sign(speed) if abs(speed) > cut.lim else 0
        k[kernels.BEGAN : kernels.BEGAN + 2] = 1 if impulse else 2
        return {"piece": piece, "k": k, "f": np.array([moved[-1, -1], speed]), "force": np.zeros(1)}


_HINTS = {
    kernels.Status.DIVERGED: "the bar moved more than a metre; check the cutting stiffness and the damping",
    kernels.Status.SURFACE_MEMORY: "contact changes too often for the stored surface",
    kernels.Status.STUCK: "contact changes a hundred times within one sample",
}
