"""The plant once more in plain NumPy, written from the equations and not from the kernels.

Delays are looked up by time or by angle in plain lists, exact steps come from scipy's matrix exponential, and the force
at the end of a step from a fixed-point iteration to convergence. Slow, and meant to be.
"""

import math

import numpy as np
from scipy.linalg import expm


def characteristic_roots(parameters, spindle_hz, shift, low_hz=300.0, high_hz=1000.0):
    """Roots (1/s) of the one-mode process with positive frequency, the rightmost first.

    m s^2 + (c + 2 cp) s + k + 2 K (1 + mu exp(-s pi/Omega) cosh(s shift/Omega)) = 0, all referred to the tools.
    """
    m = parameters.modal_mass / parameters.shape**2
    w, omega = 2.0 * math.pi * parameters.natural_frequency_hz, 2.0 * math.pi * spindle_hz
    c = 2.0 * m * parameters.damping_ratio * w + 2.0 * parameters.process_damping
    stiffness, mu, half = parameters.cutting_stiffness, parameters.overlap, math.pi / omega
    found = []
    for start_hz in np.arange(low_hz, high_hz, 8.0):
        s = complex(20.0, 2.0 * math.pi * start_hz)
        for _ in range(80):
            e, a = np.exp(-s * half), shift / omega
            value = m * s * s + c * s + m * w * w + 2.0 * stiffness * (1.0 + mu * e * np.cosh(s * a))
            slope = 2.0 * m * s + c + 2.0 * stiffness * mu * e * (a * np.sinh(s * a) - half * np.cosh(s * a))
            s -= value / slope
            if not (abs(s.real) < 400.0 and abs(s.imag) < 2e4):
                break
            if abs(value / slope) < 1e-9 * abs(s):
                if s.imag > 0.0 and all(abs(s - other) > 1e-4 for other in found):
                    found.append(complex(s))
                break
    return sorted(found, key=lambda root: -root.real)


class SlowAxis:
    """One servo loop as printed: position and velocity loop, first-order observer, bilinear derivative."""

    def __init__(self, drive, gains, rate, start):
        self.drive, self.gains, self.rate, self.start = drive, gains, rate, start
        self.motor, self.stage, self.refs = [], [], [start, start]
        self.motor_speed = self.stage_speed = self.observer = self.thrust = 0.0

    def read(self, motor, stage):
        drive = self.drive
        self.motor.append(math.floor(motor / drive.motor_resolution + 0.5) * drive.motor_resolution)
        self.stage.append(math.floor(stage / drive.stage_resolution + 0.5) * drive.stage_resolution)

    def command(self, ref):
        g, gd, t, d = self.gains.derivative_bandwidth, self.gains.disturbance_bandwidth, 1.0 / self.rate, self.drive
        rotor, viscous = d.motor_inertia / (d.lead / 2 / math.pi) ** 2, d.motor_damping / (d.lead / 2 / math.pi) ** 2
        steps = [x[-1] - x[-2] if len(x) > 1 else 0.0 for x in (self.motor, self.stage)]
        keep, gain = (2.0 - g * t) / (2.0 + g * t), 2.0 * g / (2.0 + g * t)
        self.motor_speed = keep * self.motor_speed + gain * steps[0]
        self.stage_speed = keep * self.stage_speed + gain * steps[1]
        momentum = rotor * self.motor_speed + d.stage_mass * self.stage_speed
        loss = viscous * self.motor_speed + d.stage_damping * self.stage_speed
        self.observer += (1.0 - math.exp(-gd * t)) * (self.thrust - loss + gd * momentum - self.observer)
        disturbance = self.observer - gd * momentum
        self.refs.append(ref)
        speed = (self.refs[-1] - self.refs[-2]) * self.rate
        acceleration = (self.refs[-1] - 2.0 * self.refs[-2] + self.refs[-3]) * self.rate**2
        kp, kv = self.gains.position_gain, self.gains.velocity_gain
        wish = kv * (kp * (ref - self.stage[-1]) + speed - self.motor_speed) + acceleration
        self.thrust = (rotor + d.stage_mass) * wish + disturbance
        return self.thrust


class SlowPlant:
    """One mode, tools in cut from the start at a fixed place on the bar; no dry friction, no noise on the scale.

    Dead times must be whole steps.
    """

    def __init__(self, *, parameters, cutting, drives, diameter, rate, substeps, shift, noise):
        self.p, self.cutting, self.drives, self.radius = parameters, cutting, drives, diameter / 2.0
        self.rate, self.substeps, self.h, self.noise = rate, substeps, 1.0 / (rate * substeps), noise
        self.omega = 2.0 * math.pi * cutting.spindle_hz
        psi = drives.axis_angle
        dx, dy = self.radius * (1.0 - math.cos(shift)), self.radius * math.sin(shift)
        slides = np.array([dx - dy / math.tan(psi), dy / math.sin(psi)])
        self.axes = [
            SlowAxis(drives.x1, drives.x1_control, rate, slides[0]),
            SlowAxis(drives.y1, drives.y1_control, rate, slides[1]),
        ]
        self.z = np.zeros(10)
        self.z[[0, 2, 5, 7]] = slides[[0, 0, 1, 1]]
        self.past = [self.z.copy()]
        self.thrusts = []
        self.bar = np.zeros(2)
        self.forces = np.zeros(3)
        self.loads = np.zeros(2)
        # (angle on the material, depth left) of each tool, from more than half a turn before
        back = np.arange(-math.ceil(0.6 / (cutting.spindle_hz * self.h)), 0) + 1.0
        self.cuts = [[(self.omega * self.h * b - shift * (i == 0), 0.0) for b in back] for i in range(2)]
        self.angle = 0.0
        self.mode, self.mode_force = self._mode_step()
        self.step, self.step_thrust, self.step_load = self._drive_step()

    def _mode_step(self):
        w = 2.0 * math.pi * self.p.natural_frequency_hz
        big = np.zeros((4, 4))
        big[0, 1] = 1.0
        big[1] = [-w * w, -2.0 * self.p.damping_ratio * w, self.p.shape / self.p.modal_mass, 0.0]
        big[2, 3] = 1.0
        full = expm(big * self.h)[:2]
        # force f0 + (f1 - f0) t/h
        ramp = full[:, 3] / self.h
        return full[:, :2], np.stack([full[:, 2] - ramp, ramp], axis=1)

    def _drive_step(self):
        d, mass, rest = self.drives, np.eye(10), np.zeros((10, 10))
        thrust, load = np.zeros((10, 2)), np.zeros((10, 2))
        cross = d.upper_mass * math.cos(d.axis_angle)
        for i, axis in enumerate((d.x1, d.y1)):
            o, ratio = 5 * i, axis.lead / (2.0 * math.pi)
            k, c = axis.drive_stiffness, axis.drive_damping
            mass[o + 1, o + 1], mass[o + 3, o + 3] = axis.motor_inertia / ratio**2, axis.stage_mass
            mass[o + 3, (o + 8) % 10] = cross
            rest[o, o + 1] = rest[o + 2, o + 3] = 1.0
            rest[o + 1, o : o + 5] = [-k, -c - axis.motor_damping / ratio**2, k, c, 1.0]
            rest[o + 3, o : o + 4] = [k, c, -k, -c - axis.stage_damping]
            rest[o + 4, o + 4] = -axis.current_bandwidth
            thrust[o + 4, i], load[o + 3, i] = axis.current_bandwidth, -1.0
        solve = np.linalg.solve
        big = np.zeros((16, 16))
        big[:10] = np.hstack([solve(mass, rest), solve(mass, thrust), solve(mass, load), np.zeros((10, 2))])
        big[12:14, 14:] = np.eye(2)
        full = expm(big * self.h)[:10]
        return full[:, :10], full[:, 10:12], (full[:, 12:14], full[:, 14:] / self.h)

    def _left_by(self, tool, angle):
        nodes = self.cuts[tool]
        i = max(j for j in range(len(nodes) - 2000 if len(nodes) > 2000 else 0, len(nodes)) if nodes[j][0] <= angle)
        near = nodes[i - 1 : i + 3]
        total = 0.0
        for a, (u, r) in enumerate(near):
            total += r * math.prod((angle - v) / (u - v) for b, (v, _) in enumerate(near) if b != a)
        return total

    def _radial(self, chip, speed, stiffness):
        cut, limit = self.cutting, self.omega * self.radius * math.tan(self.cutting.flank_clearance)
        extra = cut.flank_factor * max(speed - limit, 0.0)
        return max(stiffness * chip + cut.process_damping * (speed + extra), 0.0) if chip > 0.0 else 0.0

    def _cut(self, noise):
        cut, psi, k = self.cutting, self.drives.axis_angle, self.cutting.cutting_stiffness
        steady = cut.steady_forces
        h0 = steady[0] / k
        x = self.z[2] + self.h * self.z[3]
        y = self.z[7] + self.h * self.z[8]
        tool = complex(x + y * math.cos(psi) - self.radius, y * math.sin(psi))
        speed = complex(self.z[3] + self.z[8] * math.cos(psi), self.z[8] * math.sin(psi))
        outward = tool / abs(tool)
        shift = math.pi - np.angle(tool) if tool.imag >= 0 else -math.pi - np.angle(tool)
        deeper, deeper_speed = self.radius - abs(tool), -(speed * outward.conjugate()).real
        self.angle += self.omega * self.h
        phases = (self.angle - shift, self.angle)
        old = [cut.overlap * self._left_by(1 - i, phases[i] - math.pi) for i in range(2)]
        rise = 1.0 + cut.rake_gain * shift
        held = self.mode @ self.bar + self.mode_force[:, 0] * (self.forces[1] - self.forces[0])
        forces = self.forces[:2]
        for _ in range(12):
            bar = held + self.mode_force[:, 1] * (forces[1] - forces[0])
            q, qd = self.p.shape * bar
            chips = h0 + q + deeper - old[0], h0 + cut.setting_difference - q - old[1]
            forces = np.array(
                [self._radial(chips[0], qd + deeper_speed, rise * k), self._radial(chips[1], -qd, k)]
            ) + noise * (np.array(chips) > 0.0)
        self.bar = bar
        for i in range(2):
            self.cuts[i].append((phases[i], max(chips[i], 0.0) - h0 + old[i]))
        along = max(rise * (steady[1] + cut.tangential_ratio * k * (chips[0] - h0)), 0.0) if chips[0] > 0.0 else 0.0
        self.forces = np.array([*forces, along])
        # on the tool: outward the radial part, along the motion of the surface the tangential part
        onto = forces[0] * outward + along * outward * -1j
        return np.array([-onto.real, -onto.real * math.cos(psi) - onto.imag * math.sin(psi)]), onto

    def run(self, refs):
        """Return vibration, force on tool 1 and slide readings at each servo sample for `refs`, shape (2, n)."""
        out = []
        lag = {n: round(getattr(self.drives.x1, n) / self.h) for n in ("thrust_delay", "motor_delay", "stage_delay")}
        onto = 0j
        for i in range(refs.shape[1]):
            motor = self.past[max(len(self.past) - 1 - lag["motor_delay"], 0)]
            stage = self.past[max(len(self.past) - 1 - lag["stage_delay"], 0)]
            for a, axis in enumerate(self.axes):
                axis.read(motor[5 * a], stage[5 * a + 2])
            command = np.array([axis.command(refs[a, i]) for a, axis in enumerate(self.axes)])
            psi = self.drives.axis_angle
            tool = complex(self.z[2] + self.z[7] * math.cos(psi) - self.radius, self.z[7] * math.sin(psi))
            vibration = -self.p.shape * self.bar[0] - (self.radius - abs(tool))
            readings = [v for axis in self.axes for v in (axis.thrust, axis.motor[-1], axis.stage[-1])]
            out.append([vibration, -onto.real, onto.imag, self.forces[1], *readings])
            for j in range(self.substeps):
                loads, onto = self._cut(self.noise[i * self.substeps + j])
                self.thrusts.append(command)
                late = len(self.thrusts) - 1 - lag["thrust_delay"]
                thrust = self.thrusts[late] if late >= 0 else np.zeros(2)
                self.z = self.step @ self.z + self.step_thrust @ thrust
                self.z += self.step_load[0] @ self.loads + self.step_load[1] @ (loads - self.loads)
                self.loads = loads
                self.past.append(self.z.copy())
        return np.array(out).T
