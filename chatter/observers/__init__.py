"""Cutting force from the signals of a feed drive, by nominal models only."""
