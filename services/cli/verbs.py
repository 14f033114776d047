"""Importing this module registers every verb."""

from services.cli import (
    analysis,
    bench,
    charts,
    dashboard,
    estimators,
    identify,
    loop,
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
    "bench",
    "charts",
    "dashboard",
    "estimators",
    "identify",
    "loop",
    "recorder",
    "recordings",
    "reproduce",
    "services",
    "soak",
    "sweep",
    "upkeep",
]
