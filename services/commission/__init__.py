"""Commissioning of a machine, step by step."""
