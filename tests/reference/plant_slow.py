"""The plant in two directions once more, slowly: linear cut, or a surface that remembers passes instead of heights."""

import math

import numpy as np

from tests.reference.plant import SlowPlant
from tests.reference.plant_chip import chip_between, forces_of_chip, tool_profile

PASSES = 8


class SlowPlane(SlowPlant):
    """One mode in each direction; `mapped` for the surface, whose steady direction of thrust may be held."""

    def __init__(self, *, mapped, steady=False, dz=0.4e-6, **given):
        super().__init__(**given)
        self.mapped, self.steady = mapped, steady
        self.bar = np.zeros(4)
        self.on_bar = np.zeros(2)
        self.deepest = [np.array([r for _, r in cuts]) for cuts in self.cuts]
        self.phases = [np.array([u for u, _ in cuts]) for cuts in self.cuts]
        feed = self.cutting.feed_per_rev
        self.ahead = [np.full(self.phases[i].size, feed * given["shift"] * (i == 0) / 2 / math.pi) for i in range(2)]
        self.z_grid = np.arange(-0.45e-3, 0.42e-3, dz)

    def _history(self, tool, phase):
        """Depth and lead of what a tool did at a phase; long ago it stood at nominal depth."""
        u, first = self.phases[tool], self.phases[tool][2]
        if phase <= first:
            return 0.0, self.ahead[tool][0]
        i = int(np.searchsorted(u, phase, side="right")) - 1
        near = range(i - 1, min(i + 3, u.size))
        weights = [math.prod((phase - u[b]) / (u[a] - u[b]) for b in near if b != a) for a in near]
        values = np.array([[self.deepest[tool][a], self.ahead[tool][a]] for a in near])
        return tuple(np.array(weights) @ values)

    def _met(self, tool, phase):
        """What a tool meets: all passes before, the lowest at each place, and the stock."""
        cut, z = self.cutting, self.z_grid
        surface = np.full(z.size, cut.depth_of_cut)
        for k in range(1, PASSES):
            depth, ahead = self._history((tool + k) % 2, phase - k * math.pi)
            arc = tool_profile(z + k * cut.feed_per_rev / 2.0 - ahead, cut.nose_radius, cut.approach_angle)
            surface = np.minimum(surface, arc - depth)
        return surface

    def _forces(self, tool, met, edge, depth, speed, rise):
        """Radial and tangential force of one tool without noise."""
        cut, k = self.cutting, self.cutting.cutting_stiffness
        if not self.mapped:
            h0 = cut.steady_forces[0] / k
            chip = h0 + depth - met
            along = rise * (cut.steady_forces[1] + cut.tangential_ratio * k * (chip - h0)) if chip > 0.0 else 0.0
            return self._radial(chip, speed, rise * k), max(along, 0.0)
        area, length, psi = chip_between(self.z_grid, met, edge - depth)
        radial, along = forces_of_chip(cut, area, length, cut.chip.thrust_direction if self.steady else psi)
        limit = self.omega * self.radius * math.tan(cut.flank_clearance)
        damping = cut.process_damping * length / cut.chip.edge_length
        radial = rise * radial + damping * (speed + cut.flank_factor * max(speed - limit, 0.0))
        return (max(radial, 0.0), rise * along) if area > 0.0 else (0.0, 0.0)

    def _cut(self, noise):
        cut, psi = self.cutting, self.drives.axis_angle
        x = self.z[2] + self.h * self.z[3]
        y = self.z[7] + self.h * self.z[8]
        tool = complex(x + y * math.cos(psi) - self.radius, y * math.sin(psi))
        speed = complex(self.z[3] + self.z[8] * math.cos(psi), self.z[8] * math.sin(psi))
        outward = tool / abs(tool)
        shift = math.asin(outward.imag)
        deeper, deeper_speed = self.radius - abs(tool), -(speed * outward.conjugate()).real
        self.angle += self.omega * self.h
        phases = (self.angle - shift, self.angle)
        ahead = (cut.feed_per_rev * shift / 2.0 / math.pi, 0.0)
        if self.mapped:
            met = [self._met(i, phases[i]) for i in range(2)]
            edges = [tool_profile(self.z_grid - ahead[i], cut.nose_radius, cut.approach_angle) for i in range(2)]
        else:
            met, edges = [cut.overlap * self._history(1 - i, phases[i] - math.pi)[0] for i in range(2)], (0.0, 0.0)
        rises = (1.0 + cut.rake_gain * shift, 1.0)
        # in the plane (-X1, Y1'): towards tool 1 and, at right angles, along the surface there
        out1, out2 = complex(-outward.real, outward.imag), complex(-1.0, 0.0)
        free = [self.mode @ self.bar[2 * a : 2 * a + 2] + self.mode_force[:, 0] * self.on_bar[a] for a in range(2)]
        on_bar = self.on_bar
        for _ in range(3 if self.mapped else 12):
            bar = np.concatenate([free[a] + self.mode_force[:, 1] * on_bar[a] for a in range(2)])
            q, qd = self.p.shape * complex(bar[0], bar[2]), self.p.shape * complex(bar[1], bar[3])
            depths = (q * out1.conjugate()).real + deeper, (q * out2.conjugate()).real + cut.setting_difference
            speeds = (qd * out1.conjugate()).real + deeper_speed, (qd * out2.conjugate()).real
            both = [self._forces(i, met[i], edges[i], depths[i], speeds[i], rises[i]) for i in range(2)]
            radial = [f[0] + noise[i] * (f[1] > 0.0) for i, f in enumerate(both)]
            pushed = -sum(out * complex(r, f[1]) for out, r, f in zip((out1, out2), radial, both, strict=True))
            on_bar = np.array([pushed.real, pushed.imag])
        self.bar, self.on_bar = bar, on_bar
        h0 = cut.steady_forces[0] / cut.cutting_stiffness
        left = depths if self.mapped else [max(h0 + depths[i] - met[i], 0.0) - h0 + met[i] for i in range(2)]
        for i in range(2):
            self.phases[i] = np.append(self.phases[i], phases[i])
            self.deepest[i] = np.append(self.deepest[i], left[i])
            self.ahead[i] = np.append(self.ahead[i], ahead[i])
        self.forces = np.array([*radial, both[0][1]])
        onto = radial[0] * outward + both[0][1] * outward * -1j
        return np.array([-onto.real, -onto.real * math.cos(psi) - onto.imag * math.sin(psi)]), onto
