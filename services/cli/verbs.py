"""Importing this module registers every verb."""

from services.cli import analysis, loop, recordings, services, upkeep

__all__ = ["analysis", "loop", "recordings", "services", "upkeep"]
