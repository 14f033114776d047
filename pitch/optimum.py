"""The pitch difference that puts the two regenerative waves in a wanted phase.

All of it is one proportion: in the time by which the two delays differ, the chatter turns by the phase difference.
Yamada, PhD thesis, Keio University, 2017, eq. (6-9) and (6-10).
"""

import math

from pitch._checks import finite, positive, whole


def optimal_pitch_difference(chatter_frequency_hz: float, spindle_hz: float, order: int = 0) -> float:
    """Pitch difference at which the two regenerative waves cancel, eq. (6-10).

    Parameters
    ----------
    chatter_frequency_hz : float
        Chatter frequency (Hz).
    spindle_hz : float
        Spindle speed in revolutions per second (Hz).
    order : int
        Whole turns of phase added to half a turn; 0 is the smallest offset.

    Returns
    -------
    float
        Pitch difference (rad); turret 1 shifts by half of it.
    """
    return pitch_difference_for_phase(chatter_frequency_hz, spindle_hz, (2 * whole("order", order, 0) + 1) * math.pi)


def pitch_difference_for_phase(chatter_frequency_hz: float, spindle_hz: float, phase: float) -> float:
    """Pitch difference that gives any phase between the two regenerative waves, eq. (6-9) solved for it.

    Parameters
    ----------
    chatter_frequency_hz : float
        Chatter frequency (Hz).
    spindle_hz : float
        Spindle speed in revolutions per second (Hz).
    phase : float
        Wanted phase (rad); a negative one shifts against the surface motion.

    Returns
    -------
    float
        Pitch difference (rad).
    """
    return finite("phase", phase) * (
        positive("spindle_hz", spindle_hz) / positive("chatter_frequency_hz", chatter_frequency_hz)
    )


def regenerative_phase(chatter_frequency_hz: float, spindle_hz: float, pitch_difference: float) -> float:
    """Phase between the two regenerative waves at a given pitch difference, eq. (6-9).

    Parameters
    ----------
    chatter_frequency_hz : float
        Chatter frequency (Hz).
    spindle_hz : float
        Spindle speed in revolutions per second (Hz).
    pitch_difference : float
        Pitch difference (rad).

    Returns
    -------
    float
        Phase (rad), not wrapped: pi is the first optimum, 3 pi the second.
    """
    return finite("pitch_difference", pitch_difference) * (
        positive("chatter_frequency_hz", chatter_frequency_hz) / positive("spindle_hz", spindle_hz)
    )
