"""Importing this module registers every verb."""

from services.cli import analysis, bench, estimators, loop, recordings, reproduce, services, upkeep

__all__ = ["analysis", "bench", "estimators", "loop", "recordings", "reproduce", "services", "upkeep"]
