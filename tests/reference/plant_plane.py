"""Linear theory of a bar that bends in two directions between two tools, several modes in each.

With q(s) the bar at the tools, G(s) = sum phi_k^2 / (m_k (s^2 + 2 zeta_k w_k s + w_k^2)) the same in both directions,

    F_i = -(K_i e_i D_i + Kt_i w_i D'_i) - cp s e_i (e_i . q),    D_i = e_i . q - mu exp(-s tau_i) e_j . q,

D'_i with the overlap of the tangential force, the roots are those of det(I + G(s) A(s)) = 0, where F = -A q.
"""

import cmath
import math
from typing import NamedTuple

import numpy as np


class Plane(NamedTuple):
    modes: tuple
    stiffness: float
    tangential: float
    overlap: float
    tangential_overlap: float
    process_damping: float
    rake_gain: float = 0.0
    spindle_hz: float = 20.0
    shift: float = 0.0
    swapped: bool = False  # tau_1 and tau_2 exchanged

    def tools(self):
        """Radial direction, direction of the surface, rise of the force and delay of each tool."""
        h, omega = self.shift, 2.0 * math.pi * self.spindle_hz
        one = np.array([math.cos(h), math.sin(h)]), np.array([-math.sin(h), math.cos(h)])
        two = np.array([-1.0, 0.0]), np.array([0.0, -1.0])
        delays = [(math.pi + h) / omega, (math.pi - h) / omega]
        if self.swapped:
            delays.reverse()
        return [(*one, 1.0 + self.rake_gain * h, delays[0]), (*two, 1.0, delays[1])]

    def compliance(self, s):
        return sum(k.shape**2 / (k.modal_mass * self.bend(k, s)) for k in self.modes)

    @staticmethod
    def bend(mode, s):
        w = 2.0 * math.pi * mode.natural_frequency_hz
        return s * s + 2.0 * mode.damping_ratio * w * s + w * w

    def cut(self, s):
        """A(s): the force of both tools on the bar is -A q."""
        total, tools = np.zeros((2, 2), dtype=complex), self.tools()
        for i, (e, w, rise, delay) in enumerate(tools):
            other, late = tools[1 - i][0], cmath.exp(-s * delay)
            total += rise * self.stiffness * np.outer(e, e - self.overlap * late * other)
            total += rise * self.tangential * np.outer(w, e - self.tangential_overlap * late * other)
            total += self.process_damping * s * np.outer(e, e)
        return total

    def determinant(self, s):
        return np.linalg.det(np.eye(2) + self.compliance(s) * self.cut(s))

    def roots(self, low_hz=350.0, high_hz=900.0, spacing_hz=8.0):
        """Roots (1/s) with positive frequency, the rightmost first; Newton from a row of starts."""
        found = []
        for start in np.arange(low_hz, high_hz, spacing_hz):
            s = complex(15.0, 2.0 * math.pi * start)
            for _ in range(60):
                value = self.determinant(s)
                slope = (self.determinant(s + 1e-3) - self.determinant(s - 1e-3)) / 2e-3
                change = value / slope
                s -= change * min(1.0, 60.0 / abs(change))
                if not abs(s.real) < 300.0:
                    break
                if abs(change) < 1e-9 * abs(s):
                    if all(abs(s - other) > 1e-3 for other in found):
                        found.append(s)
                    break
        return sorted(found, key=lambda root: -root.real)

    def eigenvector(self, root):
        """Bar at the tools, largest component 1."""
        _, _, right = np.linalg.svd(np.eye(2) + self.compliance(root) * self.cut(root))
        q = right[-1].conj()
        return q / q[np.argmax(np.abs(q))]
