"""The plant: two opposed tools on one flexible bar, and the drives of turret 1."""

from __future__ import annotations

from importlib import import_module

_HOMES = {
    "AxisControl": "feed_drive",
    "Chip": "chip",
    "Chuck": "workpiece",
    "Cutting": "cutting",
    "FeedDrive": "feed_drive",
    "ForceLaw": "chip",
    "LinearParameters": "linear",
    "Mode": "workpiece",
    "PlantBlock": "simulator",
    "SimulationDiverged": "simulator",
    "Simulator": "simulator",
    "TurretDrives": "feed_drive",
    "Workpiece": "workpiece",
    "cantilever_frequency_hz": "workpiece",
    "linear_parameters": "linear",
    "loads_of_force": "turrets",
    "shift_of_tool": "turrets",
    "slides_of_shift": "turrets",
    "steady_chip": "chip",
    "tool_of_slides": "turrets",
}

__all__ = list(_HOMES)  # noqa: PLE0605


def __getattr__(name: str) -> object:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
