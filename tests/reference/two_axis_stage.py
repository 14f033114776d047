"""Two skewed ball-screw slides, each two inertias, coupled by the mass that rides on both: exact in time.

State: x_m, v_m, x_t, v_t of X1, the same of Y1, then sine and cosine of the force. From the balances
M_t a_t + m_c cos(psi) a_t(other) = K (x_m - x_t) + C_k (v_m - v_t) - C_t v_t - Q and
M_r a_m = u - C_r v_m - K (x_m - x_t) - C_k (v_m - v_t), with u = -M K_v (K_p x_t + v_m) to hold the slides in place.
The tool feels the force (-F_x, +F_y') along X1 and at right angles to it; the Y1 slide moves at psi from X1.
"""

import numpy as np
from scipy.linalg import expm


class TwoAxisStage:
    def __init__(self, drives, cross_mass, axis_angle, force, frequency_hz, position_gain=40.0, velocity_gain=160.0):
        omega = 2 * np.pi * frequency_hz
        mass, rest = np.eye(10), np.zeros((10, 10))
        along = np.array([-force[0], force[1]])
        directions = np.array([[1.0, 0.0], [np.cos(axis_angle), np.sin(axis_angle)]])
        for axis, d in enumerate(drives):
            o = 4 * axis
            rotor = d["J"] / (d["lead"] / (2 * np.pi)) ** 2
            rotor_damping = d["D"] / (d["lead"] / (2 * np.pi)) ** 2
            total = rotor + d["M"]
            spring = np.zeros(10)
            spring[[o, o + 1, o + 2, o + 3]] = d["K"], d["Ck"], -d["K"], -d["Ck"]
            rest[o, o + 1] = rest[o + 2, o + 3] = 1.0
            mass[o + 1, o + 1] = rotor
            rest[o + 1] = -spring
            rest[o + 1, o + 1] -= rotor_damping + total * velocity_gain
            rest[o + 1, o + 2] -= total * velocity_gain * position_gain
            mass[o + 3, o + 3] = d["M"]
            mass[o + 3, (o + 4) % 8 + 3] = cross_mass
            rest[o + 3] = spring
            rest[o + 3, o + 3] -= d["Ct"]
            rest[o + 3, 8] += directions[axis] @ along
        rest[8, 9], rest[9, 8] = omega, -omega
        self.matrix = np.linalg.solve(mass, rest)

    def run(self, samples, sample_rate_hz, ages):
        """Positions x_m, y_m, x_t, y_t, each sampled its age (samples) late, after one second to settle."""
        step = expm(self.matrix / sample_rate_hz)
        late = [expm(-self.matrix * age / sample_rate_hz)[row] for age, row in zip(ages, (0, 4, 2, 6), strict=True)]
        state = np.zeros(10)
        state[9] = 1.0
        state = expm(self.matrix * 1.0) @ state
        self.started = state[8:].copy()
        out = np.empty((samples, 4))
        for i in range(samples):
            out[i] = [row @ state for row in late]
            state = step @ state
        return out
