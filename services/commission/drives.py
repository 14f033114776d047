"""What is believed of a drive, from a swept sine: of the simulated drive, or in a file."""

from __future__ import annotations

import math
import pathlib
from dataclasses import dataclass, replace

import numpy as np

from services.config import Case
from services.errors import InputError, RefusalError
from services.importers.recording import Recording
from services.importers.servo import Axis


@dataclass(frozen=True, slots=True, kw_only=True)
class Belief:
    """Keys of a case with value and origin, and what was found in words."""

    values: dict[str, tuple[float, str]]
    words: str


FEED, AMPLITUDE = 0.02, 0.01
"""Constant speed and amplitude of the swept speed (m/s): friction keeps its sign."""
PERIOD_S, PERIODS, BAND_HZ = 0.5, 5, (5.0, 1000.0)
MOST_LEFT = 0.05
"""Share of the responses that may be left unexplained."""
_KEYS = {
    "rotor_mass_kg": "rotor_inertia_kg_m2", "rotor_viscosity_n_s_m": "rotor_damping_n_m_s_per_rad",
    "stage_mass_kg": "stage_mass_kg", "stage_damping_n_s_m": "stage_damping_n_s_per_m",
    "screw_stiffness_n_m": "screw_stiffness_n_per_m", "screw_damping_n_s_m": "screw_damping_n_s_per_m",
    "motor_dead_time_ms": "motor_delay_ms", "stage_dead_time_ms": "stage_delay_ms",
}  # fmt: skip
"""Key of what `identify sweep` answers -> key of what is believed of a drive."""
_KNOWN = 0.1
"""Relative standard deviation up to which a value is taken."""


def swept(case: Case, axis: str, seed: int) -> tuple[Recording, Axis]:
    """Return a sweep of the speed of the simulated drive, its position loop open.

    Parameters
    ----------
    case
        The case.
    axis
        x1 or y1.
    seed
        Of the noise of its encoders.
    """
    from turning_sim import AxisDrive, ServoAxis

    drive, control = getattr(case.drives, axis), getattr(case.drives, f"{axis}_control")
    rate = case.settings.sample_rate_hz
    t = np.arange(round((PERIODS + 1) * PERIOD_S * rate) + 1) / rate
    (low, high), inner = BAND_HZ, t % PERIOD_S
    slope = 0.5 * (high - low) / PERIOD_S
    speed = FEED + AMPLITUDE * np.sin(2.0 * math.pi * (low * inner + slope * inner**2))
    open_loop = replace(control, position_gain=0.0, disturbance_bandwidth=0.0)
    plant = ServoAxis(AxisDrive.of(drive), open_loop, rate, seed=seed)
    command = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1])) / rate])
    block = plant.advance(command, np.zeros(command.size * plant.substeps))
    source = f"the simulated drive of {axis}"
    names, units = ("thrust", "motor position", "stage position"), ("N", "m", "m")
    samples = np.column_stack([block.thrust, block.motor_position, block.stage_position])
    recording = Recording(
        samples=samples, rate_hz=rate, names=names, units=units, source=source, roles=("thrust", "position", "position")
    )
    return recording, Axis(
        position_m=block.motor_position, thrust_n=block.thrust, stage_m=block.stage_position, rate_hz=rate,
        channels={}, notes=(),
    )  # fmt: skip


def recorded(path: pathlib.Path, case: Case, axis: str) -> tuple[Recording, Axis]:
    """Return the sweep in a file; thrust, motor and stage are told by names and units.

    Parameters
    ----------
    path
        File that the importers read.
    case
        Whose rate and lead the file must have.
    axis
        x1 or y1.
    """
    from services.importers.load import load_recording
    from services.importers.roles import with_roles
    from services.importers.servo import Constants, axis_of

    recording = with_roles(load_recording(path), ())
    found = axis_of(recording, Constants(lead_m=getattr(case.belief, axis).lead))
    rate = case.settings.sample_rate_hz
    if abs(found.rate_hz / rate - 1.0) > 1e-3:
        rule = f"sampled as the case says, at {rate:g} Hz (it is at {found.rate_hz:g})"
        raise InputError(f"sweep-{axis}", str(path), rule)
    return recording, found


def believed(case: Case, axis: str, sweep: tuple[Recording, Axis], band_hz: tuple[float, float]) -> Belief:
    """Return what a sweep tells of `[belief.x1]` or `[belief.y1]`.

    Of the dead times it tells two sums; the thrust keeps its own and the encoders take the rest.

    Parameters
    ----------
    case
        For lead and the bandwidth of the current loop.
    axis
        x1 or y1.
    sweep
        From `swept` or `recorded`.
    band_hz
        Of the sweep (Hz).

    Raises
    ------
    RefusalError
        If the sweep does not determine a drive.
    """
    from services.identified_drive import sweep_answer

    belief = getattr(case.belief, axis)
    told = sweep_answer(*sweep, None, band_hz, belief.omega_current).keys
    left = told["relative_error"]
    if not left <= MOST_LEFT:
        raise RefusalError(f"the sweep of {axis} is not that of two inertias and a spring: {100 * left:.0f} % are left")
    values: dict[str, tuple[float, str]] = {}
    turn = (belief.lead / (2.0 * math.pi)) ** 2
    for name, key in _KEYS.items():
        spread = abs(told["std"][name] / told[name]) if told[name] else math.inf
        value = told[name] * (turn if key.startswith("rotor") else 1.0)
        value -= 1e3 * belief.thrust_delay if name in ("motor_dead_time_ms", "stage_dead_time_ms") else 0.0
        if spread <= _KNOWN and value >= 0.0:
            values[f"belief.{axis}.{key}"] = value, f"identified: sweep of {sweep[0].source}, +- {100 * spread:.2g} %"
    said = (
        f"{axis}: {told['stage_mass_kg']:.4g} kg on {told['screw_stiffness_n_m']:.3g} N/m, "
        f"{told['resonance_hz']:.1f} Hz, {100 * left:.1f} % left over"
    )
    return Belief(values=values, words="; ".join((said, *told["flags"], *told["notes"])))
