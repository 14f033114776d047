"""What chapter 6 of the thesis prints: Yamada, PhD thesis, Keio University, 2017, sections 6.2 to 6.5.

Only this file holds printed values; everything else is computed.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Phase:
    """A column of Table 6-4, and what Fig. 6-19 shows for it."""

    phase_pi: float
    half_angle_deg: float
    diameter_mm: float
    dx1_um: float
    dy1p_um: float
    chatter: bool


TABLE_6_4 = tuple(
    Phase(phase_pi=p, half_angle_deg=h, diameter_mm=d, dx1_um=x, dy1p_um=y, chatter=c)
    for p, h, d, x, y, c in (
        (0.5, 1.38, 23.4, 3.4, 281.8, True),
        (0.6, 1.66, 23.7, 5.0, 343.3, True),
        (0.7, 1.94, 24.1, 6.9, 407.9, False),
        (0.8, 2.21, 24.5, 9.1, 472.4, False),
        (0.9, 2.49, 24.5, 11.6, 532.2, False),
        (1.1, 3.05, 22.9, 16.2, 609.2, False),
        (1.15, 3.19, 22.5, 17.4, 626.0, True),
        (1.2, 3.32, 24.9, 20.9, 721.0, True),
    )
)
"""Chatter from section 6.5.2: "avoided when the phase difference was from 0.7 pi to 1.1 pi"."""

SPEED_RPM = 1200.0  # Table 6-2, 6-3, 6-5
NOMINAL_HZ = 652.0  # section 6.5.2: the frequency that Table 6-4 assumes
PITCH_DIFFERENCE_DEG = 5.52  # section 6.5.1
NATURAL_HZ = ((24.9, 180.0, 533.0, "section 6.4.3"), (22.1, 160.0, 599.0, "Table 6-5"))  # mm, mm, Hz
HAMMER_HZ = (592.0, 3611.0)  # Fig. 6-4
HAMMER_BAR_MM = (25.0, 130.0)  # Table 6-2: diameter and projection
LINES_HZ = (652.0, 612.0, 572.0, 532.0)  # Fig. 6-16 (a)
LINES_AT_M = (0.0, 0.015, 0.030, 0.045)  # where the model has each of them as its strongest root
RA_BEFORE_UM, RA_AFTER_UM = 6.02, 1.54  # section 6.5.1
ERROR_HZ, ERROR_DEG = 10.0, 0.1  # Fig. 6-14: calculation error of the half angle
ERROR_AT_HZ = (560.0, 600.0, 640.0)
ODD_HALF_ANGLES_DEG = {3: 8.2, 5: 13.8, 7: 19.3}  # section 6.5.2, Fig. 6-18
IN_PROCESS_HZ = 738.0  # Fig. 6-21
IN_PROCESS_MOVE_MM = 0.5  # section 6.5.3: "approximately 0.5 mm"
UPDATES_HZ, CONTROL_S = 2.25, 1.0  # Table 6-5
SEARCHED_HZ = (550, 750)  # Table 6-5
STABLE_BAND_PI = (0.7, 1.1)  # section 6.5.2
