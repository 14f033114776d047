"""The plant: two opposed tools on one flexible bar, and the drives of turret 1."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from turning_sim.axis_drive import AxisDrive, Wave
    from turning_sim.chip import Chip, ForceLaw, steady_chip
    from turning_sim.chuck_fit import HammerTest, identify_chuck
    from turning_sim.condition import ConditionChange, chip_derivatives, condition_change
    from turning_sim.contact_vibration import ContactVibration
    from turning_sim.cutting import Cutting
    from turning_sim.delay_equation import DelayEquation, LinearVibration
    from turning_sim.delay_growth import Growth, growth_of
    from turning_sim.doubts import Doubt, validity
    from turning_sim.feed_drive import AxisControl, FeedDrive, TurretDrives
    from turning_sim.finished import FinishedSurface
    from turning_sim.friction import Friction
    from turning_sim.linear import LinearParameters, linear_parameters
    from turning_sim.milling_force import Milling, thesis_condition
    from turning_sim.plant_block import PlantBlock
    from turning_sim.process import CutDerivatives, ProcessModel, cut_derivatives
    from turning_sim.servo_axis import AxisBlock, ServoAxis
    from turning_sim.simulator import SimulationDiverged, Simulator
    from turning_sim.surface import SurfaceTrace, finished_roughness
    from turning_sim.turrets import loads_of_force, shift_of_tool, slides_of_shift, tool_of_slides
    from turning_sim.workpiece import Chuck, Mode, Workpiece, cantilever_frequency_hz

__all__ = [
    "AxisBlock",
    "AxisControl",
    "AxisDrive",
    "Chip",
    "Chuck",
    "ConditionChange",
    "ContactVibration",
    "CutDerivatives",
    "Cutting",
    "DelayEquation",
    "Doubt",
    "FeedDrive",
    "FinishedSurface",
    "ForceLaw",
    "Friction",
    "Growth",
    "HammerTest",
    "LinearParameters",
    "LinearVibration",
    "Milling",
    "Mode",
    "PlantBlock",
    "ProcessModel",
    "ServoAxis",
    "SimulationDiverged",
    "Simulator",
    "SurfaceTrace",
    "TurretDrives",
    "Wave",
    "Workpiece",
    "cantilever_frequency_hz",
    "chip_derivatives",
    "condition_change",
    "cut_derivatives",
    "finished_roughness",
    "growth_of",
    "identify_chuck",
    "linear_parameters",
    "loads_of_force",
    "shift_of_tool",
    "slides_of_shift",
    "steady_chip",
    "thesis_condition",
    "tool_of_slides",
    "validity",
]

_HOME = {
    "axis_drive": ("AxisDrive", "Wave"),
    "friction": ("Friction",),
    "milling_force": ("Milling", "thesis_condition"),
    "servo_axis": ("AxisBlock", "ServoAxis"),
    "surface": ("SurfaceTrace", "finished_roughness"),
    "chuck_fit": ("HammerTest", "identify_chuck"),
    "doubts": ("Doubt", "validity"),
    "chip": ("Chip", "ForceLaw", "steady_chip"),
    "condition": ("ConditionChange", "chip_derivatives", "condition_change"),
    "contact_vibration": ("ContactVibration",),
    "cutting": ("Cutting",),
    "delay_equation": ("DelayEquation", "LinearVibration"),
    "delay_growth": ("Growth", "growth_of"),
    "feed_drive": ("AxisControl", "FeedDrive", "TurretDrives"),
    "finished": ("FinishedSurface",),
    "linear": ("LinearParameters", "linear_parameters"),
    "plant_block": ("PlantBlock",),
    "process": ("CutDerivatives", "ProcessModel", "cut_derivatives"),
    "simulator": ("SimulationDiverged", "Simulator"),
    "turrets": ("loads_of_force", "shift_of_tool", "slides_of_shift", "tool_of_slides"),
    "workpiece": ("Chuck", "Mode", "Workpiece", "cantilever_frequency_hz"),
}


def __getattr__(name: str) -> Any:
    for module, names in _HOME.items():
        if name in names:
            return getattr(import_module(f"turning_sim.{module}"), name)
    raise AttributeError(f"module 'turning_sim' has no attribute {name!r}")


def __dir__() -> list[str]:
    return __all__
