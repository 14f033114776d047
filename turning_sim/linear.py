"""The one-mode numbers behind the cut, for stability theory."""

from __future__ import annotations

from dataclasses import dataclass

from turning_sim.cutting import Cutting
from turning_sim.workpiece import Workpiece


@dataclass(frozen=True, slots=True, kw_only=True)
class LinearParameters:
    """One mode of the bar, referred to the tip, and the cut felt there.

    Attributes
    ----------
    modal_mass : float
        (kg)
    natural_frequency_hz : float
        (Hz)
    damping_ratio : float
        Of the bar.
    shape : float
        Displacement at the tools per unit at the tip.
    cutting_stiffness : float
        Of one tool at the tools (N/m).
    overlap : float
        Weight of the other tool's wave.
    process_damping : float
        Of one tool at the tools (N s/m).
    """

    modal_mass: float
    natural_frequency_hz: float
    damping_ratio: float
    shape: float
    cutting_stiffness: float
    overlap: float
    process_damping: float

    @property
    def mass_at_tools(self) -> float:
        """Modal mass with the displacement at the tools as coordinate (kg): what the one-mode equation takes."""
        return self.modal_mass / self.shape**2


def linear_parameters(workpiece: Workpiece, cutting: Cutting, tool_position: float) -> LinearParameters:
    """Return the first mode and the cut with the tools at `tool_position` (m from the tip)."""
    mode = workpiece.modes(tool_position)[0]
    return LinearParameters(
        modal_mass=mode.modal_mass,
        natural_frequency_hz=mode.natural_frequency_hz,
        damping_ratio=mode.damping_ratio,
        shape=mode.shape,
        cutting_stiffness=cutting.cutting_stiffness,
        overlap=cutting.overlap,
        process_damping=cutting.process_damping,
    )
