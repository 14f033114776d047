"""Units at the edge: the suffix of a key says the unit, the number becomes SI on the way in."""

from __future__ import annotations

import math

SI: dict[str, float] = {
    "s": 1.0,
    "ms": 1e-3,
    "hz": 1.0,
    "rpm": 1.0 / 60.0,
    "m": 1.0,
    "mm": 1e-3,
    "um": 1e-6,
    "nm": 1e-9,
    "deg": math.pi / 180.0,
    "rad": 1.0,
    "deg_per_s": math.pi / 180.0,
    "deg_per_s2": math.pi / 180.0,
    "deg_per_s3": math.pi / 180.0,
    "mm_per_s": 1e-3,
    "m_per_s2": 1.0,
    "m_per_s3": 1.0,
    "mm_per_rev": 1e-3,
    "rad_per_s": 1.0,
    "1_per_s": 1.0,
    "per_min": 1.0 / 60.0,
    "per_h": 1.0 / 3600.0,
    "n": 1.0,
    "n2": 1.0,
    "n4": 1.0,
    "n_per_m": 1.0,
    "n_s_per_m": 1.0,
    "n_m_per_rad": 1.0,
    "n_m_s_per_rad": 1.0,
    "n_per_rthz": 1.0,
    "kg": 1.0,
    "kg_m2": 1.0,
    "kg_per_m3": 1.0,
    "gpa": 1e9,
    "percent": 1e-2,
    "percent_per_deg": 1e-2 * 180.0 / math.pi,
    "pi": math.pi,
    "ratio": 1.0,
}
"""Suffix of a key and what one unit of it is in SI (rpm becomes revolutions per second)."""


def has_unit(name: str) -> bool:
    """Whether `name` ends in a known unit."""
    return any(name.endswith("_" + unit) for unit in SI)
