"""What a page must know of a case before anything was said on the bus."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Self

from services.config import Case, case_from_text, load_case, shipped

WIDEST_DEG = 20.0
"""Shift up to which a tool keeps its angles (deg)."""
Effects = Callable[[float | None], dict[str, Any] | None]


def _unknown(_: float | None) -> None:
    return None


def _remembering(case: Case) -> Effects:
    """Return what tells the effects of a shift, to a hundredth of a degree, and works each out once."""
    from services.effects import effects_of

    @lru_cache(maxsize=64)
    def known(hundredths: int) -> dict[str, Any]:
        return effects_of(case, math.radians(0.01 * hundredths))

    def told(shift_deg: float | None) -> dict[str, Any] | None:
        return None if shift_deg is None or not abs(shift_deg) < WIDEST_DEG else known(round(100.0 * shift_deg))

    return told


@dataclass(frozen=True, slots=True, kw_only=True)
class Facts:
    """The part of a case that is drawn.

    Attributes
    ----------
    machine, case, title
        Names.
    sample_rate_hz
        Of the servo loop; the force says its own.
    band_hz
        Where chatter is looked for.
    tools
        How many cut, for the tooth-pass frequency.
    shift_limits_deg
        Least and greatest target that the guard lets through and the planner chooses.
    effects
        What a shift (deg) leaves on the part, `services.effects.KEYS`; None when nobody can tell.
    """

    machine: str
    case: str
    title: str
    sample_rate_hz: float
    band_hz: tuple[float, float]
    tools: int
    shift_limits_deg: tuple[float, float]
    effects: Effects = _unknown

    @classmethod
    def of(cls, case: Case, machine: str | None = None) -> Self:
        """Return the facts of a case, with another name of the machine if wanted."""
        most = case.limits.target
        limits = max(-most, case.planner.min_shift), min(most, case.planner.max_shift)
        return cls(
            machine=machine or case.settings.machine,
            case=case.name,
            title=case.settings.title,
            sample_rate_hz=case.settings.sample_rate_hz,
            band_hz=(float(case.monitor.band_hz[0]), float(case.monitor.band_hz[1])),
            tools=case.monitor.tools,
            shift_limits_deg=(math.degrees(limits[0]), math.degrees(limits[1])),
            effects=_remembering(case),
        )

    @property
    def top_hz(self) -> float:
        """Highest frequency of the spectrogram (Hz)."""
        return 1.6 * self.band_hz[1]


def told_by(text: str, machine: str) -> Facts:
    """Return the facts of the configuration that a machine tells, as `Case.text` holds it.

    Raises
    ------
    ValueError, LookupError, TypeError
        For what is no configuration.
    """
    digest = hashlib.sha256(text.encode()).hexdigest()
    name = next((name for name in shipped() if load_case(name).digest == digest), "a case of its own")
    return Facts.of(case_from_text(name, text), machine)
