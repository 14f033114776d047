"""What the studies of the estimators share: drives as they are, what is believed of them, lines of a signal."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from chatter.observers.nominal import NominalFeedDrive
from chatter.observers.stage_model import NominalControl
from services.drives import NamedDrive, load_drive
from services.messages import Floats
from services.reproduce.rows import Row, near, said
from turning_sim import ServoAxis

LOST = "no print, its figure is lost; an independent calculation from the corrected equations"


def drive_of(name: str) -> NamedDrive:
    """Return a named drive."""
    return load_drive(name)


def loop_of(named: NamedDrive) -> NominalControl:
    """Return its loops as an observer knows them."""
    names = [field.name for field in dataclasses.fields(NominalControl)]
    return NominalControl(**{name: getattr(named.control, name) for name in names})


def believed(
    named: NamedDrive, *, lags: bool = True, counts: bool = True, factors: Mapping[str, float] | None = None
) -> NominalFeedDrive:
    """Return what is believed of a drive, with or without its lags and counts; `factors` are nominal over true."""
    drive: NominalFeedDrive = named.nominal(**(factors or {}))
    if not lags:
        drive = dataclasses.replace(drive, motor_delay=0.0, stage_delay=0.0, thrust_delay=0.0, omega_current=math.inf)
    if not counts:
        drive = dataclasses.replace(drive, motor_resolution=0.0, stage_resolution=0.0)
    return drive


def axis_of(
    named: NamedDrive, *, lags: bool = True, seed: int = 1, rate_hz: float | None = None, **changes: Any
) -> Any:
    """Return the axis without friction, ripple, load and encoder errors, then changed; at rest."""
    drive = named.drive.ideal() if lags else named.drive.ideal().without_lags()
    rate = rate_hz or named.settings.sample_rate_hz
    return ServoAxis(dataclasses.replace(drive, **changes), named.control, rate, seed=seed)


def line(values: Floats, frequency_hz: float, rate_hz: float) -> complex:
    """Return the complex amplitude of a line, about the mean."""
    turn = np.exp(-2j * np.pi * frequency_hz / rate_hz * np.arange(values.size))
    return complex(2.0 * np.mean((values - values.mean()) * turn))


def degrees(gain: complex) -> float:
    """Return the phase of a response (deg)."""
    return math.degrees(math.atan2(gain.imag, gain.real))


def checked(
    source: str, quantity: str, expected: float, computed: float, unit: str = "", *, within: float, why: str = ""
) -> Row:
    """Return a row without a print, held against an independent calculation."""
    words = f"{LOST}{'; ' if why else ''}{why}"
    return near(source, quantity, None, computed, unit, within=within, why=words, expected=expected)


def bounded(source: str, quantity: str, most: float, computed: float, unit: str = "", *, why: str = "") -> Row:
    """Return a row without a print that holds if the computed value is at most so much."""
    words = f"{LOST}{'; ' if why else ''}{why}"
    return said(source, quantity, None, computed, computed <= most, why=words, unit=unit, expected=f"<= {most:g}")


def exceeds(source: str, quantity: str, least: float, computed: float, unit: str = "", *, why: str = "") -> Row:
    """Return a row without a print that holds if the computed value is at least so much."""
    words = f"{LOST}{'; ' if why else ''}{why}"
    return said(source, quantity, None, computed, computed >= least, why=words, unit=unit, expected=f">= {least:g}")
