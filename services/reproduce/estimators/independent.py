"""What an independent calculation from the corrected equations gave, where no source prints a number.

The values stand where a row has no print; they were not made with this code.
"""

from __future__ import annotations

NATURAL_HZ: dict[str, float] = {"machine-a": 340.36, "machine-b": 409.79}
"""Of Table 3-3, undamped."""
DAMPING_RATIO: dict[str, float] = {"machine-a": 0.118, "machine-b": 0.0814}
RELATIVE_PEAK_HZ: dict[str, float] = {"machine-a": 335.6, "machine-b": 407.1}
"""Peak of motor minus stage position."""
MASS_RATIO: dict[str, float] = {"machine-a": 0.10332, "machine-b": 0.08038}
LEAST_VIBRATION_N: dict[str, tuple[float, float, float]] = {
    "machine-a": (49.6, 1.25, 0.57),
    "machine-b": (0.161, 0.0068, 0.011),
}
"""Inertia, damping, spring in the vibration mode, as cutting force."""
DOB_PEAK: dict[str, tuple[float, float, float]] = {"machine-a": (4.36, 335.8, 103.0), "machine-b": (6.21, 407.1, 123.0)}
"""Peak of the gain, where (Hz), 10 % wrong from (Hz); open loop, no low-pass."""
DOB_500HZ: dict[str, tuple[float, float]] = {"closed": (0.834, -149.0), "open": (0.865, -146.3)}
"""Gain and phase (deg) of machine A, with and without its loop."""
MISPRINT_2_19 = (0.01, 0.025)
"""At the peak and at 1 kHz, machine A."""
MISPRINT_B_5: dict[str, float] = {"machine-a": 0.06, "machine-b": 0.1}
"""At 500 Hz, half the mass."""
MASS_ERROR: dict[float, tuple[float, float]] = {0.5: (2.12, -60.0), 1.5: (2.06, 63.0)}
"""Believed over true mass -> gain, phase (deg) at 335 Hz in the loop, machine A."""
STIFFNESS_ERROR: dict[float, float] = {0.5: 0.448, 1.5: 1.552}
"""Believed over true stiffness -> gain of the vibration mode at 0 Hz, machine A."""
GOOD_TO_HZ: dict[str, float] = {"none": 62.0, "thrust": 152.0, "full": 1000.0, "thrust alone": 27.0}
"""Gain within 10 %, machine A."""
ERROR_BOUNDS_N = {"rotary 38 nm": 21.0, "rotary 1 nm": 0.54, "scale 20 nm": 1.17, "scale 5 nm": 0.31}
"""Largest standard deviation, 20 N, filters of the thesis."""
NOISE_RATIO = {"medob": 53.0, "vibration": 4.9, "load_side": 1.0}
"""By counts of the rotary encoder."""
MILLING_THRUST = {1: 0.7, 2: 1.11, 3: 0.4, 4: 1.06}
"""Error over force in conditions 1 to 4."""
MILLING_DOB = {1: 0.55, 2: 1.73, 3: 0.044, 4: 0.54}
MILLING_HALF_MASS = {1: 0.25, 2: 0.81, 3: 0.03, 4: 0.23}
MILLING_TWO_ENCODER = 0.04
"""At most."""
MILLING_DELAYS = 10.0
"""Without over with compensation, at least."""
FIT_SQUARE_SUM = 0.3187
"""N 10, N_max 4, 1300 1/min, 1 ms."""
FIT_STD_RATIO = {150.0: 0.279, 300.0: 0.121, 450.0: 0.09}
"""Edge of Q (Hz) -> ratio."""
FIT_VARIANCE = {"rotary": 3347000000000.0, "linear": 5.008e16}
"""12 over count squared; N2/rad2 and N2/m2, Q at 150 Hz."""
DAMPING_SHARE = 0.7364
DAMPING_HZ = 400.5
DAMPING_GAIN = (0.837, 26.7)
"""Gain, phase (deg) at 367 Hz."""
DAMPING_CORRECTED = (0.97, -4.0)
"""The same with inertia and spring."""
KALMAN = (0.17, 0.6)
"""Error over force with and without lines in the model."""
KALMAN_MODES_HZ = (32.0, 88.0)
KALMAN_TOOTH_PASS_HZ = 55.0
CROSS_FEED = {"vibration": 0.15, "load_side": 0.02}
"""Error over that of MEDOB, at most."""
TRIPLE_SHAPE = (-9.1645, 0.9653)
"""Phi_t of both vibration modes."""
PRESLIDING = 1.16
"""A spring of 3e8 N/m under 150 kg at 612 Hz, read as force."""
