"""Parameters of a machine from its own recordings, each with its confidence; names load on first use."""

from importlib import import_module
from typing import Any

_EXPORTS = {
    "ServoFit": "chatter.identification.servo",
    "identify_servo": "chatter.identification.servo",
    "Taps": "chatter.identification.taps",
    "find_taps": "chatter.identification.taps",
    "Frf": "chatter.identification.frf",
    "frf_of_taps": "chatter.identification.frf",
    "DriveFit": "chatter.identification.sweep",
    "drive_of_sweep": "chatter.identification.sweep",
    "sweep_frf": "chatter.identification.sweep",
    "ResponseFit": "chatter.identification.state_space",
    "model_of_response": "chatter.identification.state_space",
    "Coefficient": "chatter.identification.cutting",
    "cutting_coefficient": "chatter.identification.cutting",
    "slotting_coefficient": "chatter.identification.cutting",
    "Mode": "chatter.identification.modes",
    "modes_of": "chatter.identification.modes",
}

__all__ = sorted(_EXPORTS)  # pyright: ignore[reportUnsupportedDunderAll]


def __getattr__(name: str) -> Any:
    """Import the module that holds a public name when the name is first asked for."""
    if name not in _EXPORTS:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(_EXPORTS[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """Public names, loaded or not."""
    return sorted({*globals(), *_EXPORTS})
