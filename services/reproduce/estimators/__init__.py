"""Cutting force without a sensor: what four sources print beside what is computed."""
