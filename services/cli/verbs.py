"""Importing this module registers every verb."""

from services.cli import analysis, bench, loop, recordings, reproduce, services, upkeep

__all__ = ["analysis", "bench", "loop", "recordings", "reproduce", "services", "upkeep"]
