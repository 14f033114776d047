"""Robustness: one case cut again and again over a grid of conditions."""
