"""Cutting force from the speed of the stage alone, near the resonance of the drive, where damping balances it.

Yamada and Kakinuma: F = -G (C_k + C_t) v_t / A, A = (C_k + C_t)/(C_t + alpha^2 C_r + (alpha + 1)^2 C_k), with a minus
sign because the force opposes the motion. Away from the resonance inertia and spring weigh as well; the correction
(s^2 + 2 zeta omega_s s + omega_s^2)/(2 zeta omega_s s) puts them in.
"""

from dataclasses import dataclass
from math import pi, sqrt

import numpy as np

from chatter.filters import butterworth
from chatter.observers.balance import LEVEL
from chatter.observers.linear import LinearObserver, SingleAxis
from chatter.observers.nominal import NominalFeedDrive

WIDTH = 0.25
"""Half of the band around the resonance, as a part of it, when none is given."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Resonance:
    """The vibration of motor against stage.

    Parameters
    ----------
    frequency_hz : float
        omega_s, undamped (Hz).
    damping_ratio : float
        zeta (-).
    damping : float
        C_t + alpha^2 C_r + (alpha + 1)^2 C_k: what the speed of the stage is resisted by there (N s/m).
    share : float
        A: how much of C_k + C_t that is (-).
    """

    frequency_hz: float
    damping_ratio: float
    damping: float
    share: float


def resonance(drive: NominalFeedDrive) -> Resonance:
    """Return the resonance of a drive.

    Parameters
    ----------
    drive : NominalFeedDrive
        Nominal drive.
    """
    alpha = drive.mass_ratio
    omega = sqrt((1.0 + alpha) * drive.screw_stiffness / drive.stage_mass)
    damping = drive.stage_damping + alpha**2 * drive.rotor_viscosity + (1.0 + alpha) ** 2 * drive.screw_damping
    ratio = damping / (2.0 * drive.stage_mass * (1.0 + alpha) * omega)
    share = (drive.screw_damping + drive.stage_damping) / damping
    return Resonance(frequency_hz=omega / (2.0 * pi), damping_ratio=ratio, damping=damping, share=share)


def damping_observer(
    drive: NominalFeedDrive, sample_rate_hz: float, *, band_hz: tuple[float, float] | None = None, order: int = 2,
    corrected: bool = True,
) -> LinearObserver:  # fmt: skip
    """Return the estimate from the speed of the stage.

    Parameters
    ----------
    drive : NominalFeedDrive
        Nominal drive.
    sample_rate_hz : float
        Sampling rate (Hz).
    band_hz : (float, float) or None
        Band of the filter G (Hz); None for a quarter of the resonance to either side.
    order : int
        Order of its low-pass prototype.
    corrected : bool
        Whether inertia and spring are put in.
    """
    mode = resonance(drive)
    edges = band_hz or ((1.0 - WIDTH) * mode.frequency_hz, (1.0 + WIDTH) * mode.frequency_hz)
    sections = butterworth(order, np.array(edges), sample_rate_hz, "bandpass")
    omega = 2.0 * pi * mode.frequency_hz
    gains = np.zeros((3, 1, 3))
    gains[1, 0, 1] = -mode.damping * 0.5 * sample_rate_hz
    if corrected:
        inertia = mode.damping / (2.0 * mode.damping_ratio * omega)
        gains[1, 0, 2] -= inertia * sample_rate_hz**2
        gains[1, 0] -= inertia * omega**2 * LEVEL
    observer = LinearObserver(
        "damping", SingleAxis(drive=drive), sample_rate_hz, gains, sections=sections, cutoff_hz=edges[1],
        centre_hz=sqrt(edges[0] * edges[1]),
    )  # fmt: skip
    observer.bandwidth_hz = edges[1]
    return observer
