"""What the four sources on cutting force without a sensor print, and what stands in place of prints that are wrong.

Thesis: Yamada, Keio University, 2017, chapters 2 to 6. Damping paper: Yamada and Kakinuma. Fitting paper: Hayashi,
Fujimoto and others. Current thesis: Kakkassery and Uthayakumar, Chalmers, 2020.
Only this file holds printed values of these rows.
"""

from __future__ import annotations

from dataclasses import dataclass

MACHINES = ("machine-a", "machine-b")
TITLE = {"machine-a": "machine A", "machine-b": "machine B", "nty3-x1": "X1", "nty3-y1": "Y1"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Machine:
    """What Tables 3-2 to 3-4 print of a machine."""

    resonance_hz: float
    mass_ratio: float
    rotary_nm: float
    linear_nm: float
    rotary_bits: int
    dead_ms: tuple[float, float, float]
    least_n: dict[str, float]
    digits: dict[str, float]


PRINTED = {
    "machine-a": Machine(
        resonance_hz=335.0, mass_ratio=0.103, rotary_nm=38.1, linear_nm=20.0, rotary_bits=17,
        dead_ms=(0.8, 0.0, 0.35),
        least_n={
            "rotor_inertia": 922.4, "stage_inertia": 49.8, "rotor_damping": 2.77, "stage_damping": 0.15,
            "vibration_inertia": 483.6, "vibration_damping": 11.96, "vibration_elastic": 5.51,
        },
        digits={},
    ),
    "machine-b": Machine(
        resonance_hz=408.0, mass_ratio=0.080, rotary_nm=0.596, linear_nm=0.244, rotary_bits=23,
        dead_ms=(0.4, 0.0, 0.0),
        least_n={
            "rotor_inertia": 4.38, "stage_inertia": 0.16, "rotor_damping": 0.06, "stage_damping": 0.002,
            "vibration_inertia": 2.00, "vibration_damping": 0.08, "vibration_elastic": 0.13,
        },
        digits={"rotor_damping": 0.05, "vibration_damping": 0.06, "vibration_elastic": 0.03},
    ),
}  # fmt: skip
"""`digits`: how much of a value its single printed digit leaves open, where that is more than 1.5 %."""
LEAST_CORRECTED_N = {("machine-b", "rotor_inertia"): 4.89}

NOTCH_LINES_HZ = {
    1000: {2: 204.7, 3: 307.1, 4: 409.4},
    2000: {1: 204.7, 2: 409.4, 3: 614.1},
    3000: {1: 307.1, 2: 614.1},
    4000: {1: 409.4, 2: 818.8},
    5000: {1: 512.1, 2: 1023.5},
    6000: {1: 614.1},
    7000: {1: 716.5},
    8000: {1: 818.8},
    9000: {1: 921.2},
    10000: {1: 1023.5},
    11000: {1: 1125.9},
    12000: {1: 1228.2},
}  # Table 4-5: harmonic of 9.8 um -> Hz
NOTCH_FEED_MM = 0.030  # per tooth, two teeth, Table 4-4
SIGNAL_PERIODS = 512  # of the rotary encoders, per turn, Table 3-2
ENCODER_WAVES_UM = {1: 9.77, 2: 4.9, 4: 2.4}  # section 3.4
COGGING_WAVES_MM = {30: 0.167, 60: 0.083}  # section 3.4: periods per turn -> wavelength at 5 mm lead
LEAD_LINE_HZ, LEAD_LINE_AT_MM_S = 4.0, 20.0  # section 5.3
RELATIVE_ERROR_UM, RELATIVE_ERROR_N = 0.2, 8.1  # section 5.3, machine B
STATIC_UM, STATIC_N = 0.60, 24.3  # section 5.4.2, machine B
SCALE_PERIOD_UM, SCALE_STEPS = 4.0, 16384  # Table 3-2, section 3.1, machine B
TURRET_NM = {"nty3-x1": (8.0, 120000, 66.7), "nty3-y1": (6.0, 160000, 37.5)}  # Table 6-1: lead, counts, count
TOOTH_PASS_HZ = {1: 66.7, 2: 200.0, 3: 66.7, 4: 200.0}  # section 4.2.3 (3 and 4; 1 and 2 turn as fast)
SWEEP_N, SMALLEST_ANGLE_HZ = 20.0, 87.0  # section 4.2.1, 4.2.2
CORRECTED_SMALLEST_HZ, SMALLEST_HZ_SPREAD = 450.0, (435.0, 510.0)
TRIPLE_HZ = (366.0, 770.0)  # section 2.6.2
DAMPING_SHARE, DAMPING_TOOTH_PASS_HZ = 0.736, 367.0  # damping paper, sections 3.1 and 3.2
DAMPING_BAND_HZ, DAMPING_SPEED_RPM = (350.0, 450.0), 11000.0
DAMPING_STIFFNESS = 3.59e3  # damping paper, section 3.1
NYQUIST_HZ, SERVO_RATE_HZ = 250.0, 250.0  # current thesis, chapter 10 and section 6.2.1
CORRECTED_NYQUIST_HZ = 125.0
ALIASED_TOOTH_PASS_HZ = 140.0  # current thesis, section 6.2.2
CUT_LINES_HZ = (30.0, 60.0)  # current thesis, section 9.2.2
FIT_TRAVEL_MM, FIT_SPINDLE_HZ = 1.91, 21.7  # fitting paper, Table I and section VI
STICTION_N = 130.0  # section 5.4.2
CROSS_FEED_N = 10.0  # section 5.5
ERROR_BOUNDS_N = {"rotary 38 nm": 10.0, "rotary 1 nm": 1.0, "scale 20 nm": 1.0, "scale 5 nm": 0.5}  # section 4.2.2
SCALE_BOUND_TO_HZ, BOUND_TO_HZ = 700.0, 1000.0
