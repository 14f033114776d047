"""Importing this module registers every verb."""

from services.cli import (
    analysis,
    archive,
    bench,
    charts,
    dashboard,
    estimators,
    identify,
    loop,
    playback,
    recorder,
    recordings,
    reproduce,
    services,
    soak,
    sweep,
    upkeep,
)

__all__ = [
    "analysis",
    "archive",
    "bench",
    "charts",
    "dashboard",
    "estimators",
    "identify",
    "loop",
    "playback",
    "recorder",
    "recordings",
    "reproduce",
    "services",
    "soak",
    "sweep",
    "upkeep",
]
