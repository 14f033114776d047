"""From servo signals to "is it chattering, at what frequency, of what kind"; names load on first use."""

from importlib import import_module
from typing import Any

_EXPORTS = {
    "BiquadFilter": "chatter.filters",
    "ChatterEstimate": "chatter.estimate",
    "Detector": "chatter.detector",
    "ChatterMonitor": "chatter.monitor",
    "MonitorConfig": "chatter.estimate",
    "ChatterLine": "chatter.estimate",
    "LoadSideObserver": "chatter.observers.load_side",
    "MovingVariance": "chatter.moving_variance",
    "Event": "chatter.recording",
    "RecordingVerdict": "chatter.recording",
    "detect_recording": "chatter.recording",
    "NominalFeedDrive": "chatter.observers.nominal",
    "NominalTurret": "chatter.observers.nominal",
    "SlidingDFT": "chatter.sliding_dft",
    "butterworth": "chatter.filters",
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
