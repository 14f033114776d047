"""Importing this module registers every verb."""

from services.cli import analysis, loop, recordings

__all__ = ["analysis", "loop", "recordings"]
