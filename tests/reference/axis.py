"""One servo axis in plain NumPy, without rings and state machines: written from the equations of motion and control.

M_r x_m'' = u' - C_r v_m - K_c (x_m - x_n) - C_c (v_m - v_n) - F_m,  M_n x_n'' = ...,
M_t x_t'' = K (x_n - x_t) + C_k (v_n - v_t) - C_t v_t - F - F_t,     u' the thrust after a first-order lag, if any
"""

import math

import numpy as np
from scipy.interpolate import CubicHermiteSpline
from scipy.linalg import expm


class SlowAxis:
    """The whole past is kept in lists; `drive` and `control` need only the attributes named below."""

    def __init__(self, drive, control, rate, substeps):
        self.d, self.c, self.rate, self.substeps, self.h = drive, control, rate, substeps, 1.0 / (rate * substeps)
        R = drive.lead / (2.0 * math.pi)
        three = drive.screw_inertia is not None
        self.Mr, self.Mn = drive.motor_inertia / R**2, (drive.screw_inertia / R**2 if three else 0.0)
        self.Cr, self.Mt = drive.motor_damping / R**2, drive.stage_mass
        drag_m = self.Cr + (drive.motor_friction.viscous if drive.motor_friction else 0.0)
        drag_t = drive.stage_damping + (drive.stage_friction.viscous if drive.stage_friction else 0.0)
        K, Ck = drive.drive_stiffness, drive.drive_damping
        # states xm vm xn vn xt vt u', inputs u, motor load, stage load
        A, B = np.zeros((7, 7)), np.zeros((7, 3))
        A[0, 1] = A[4, 5] = 1.0
        if three:
            Kc, Cc, Cn = drive.coupling_stiffness, drive.coupling_damping, drive.screw_damping / R**2
            A[2, 3] = 1.0
            A[1] = np.array([-Kc, -Cc - drag_m, Kc, Cc, 0, 0, 0]) / self.Mr
            A[3] = np.array([Kc, Cc, -Kc - K, -Cc - Ck - Cn, K, Ck, 0]) / self.Mn
            A[5] = np.array([0, 0, K, Ck, -K, -Ck - drag_t, 0]) / self.Mt
        else:
            A[1] = np.array([-K, -Ck - drag_m, 0, 0, K, Ck, 0]) / self.Mr
            A[5] = np.array([K, Ck, 0, 0, -K, -Ck - drag_t, 0]) / self.Mt
        B[1, 1], B[5, 2] = -1.0 / self.Mr, -1.0 / self.Mt
        self.lag = drive.current_bandwidth < math.inf
        if self.lag:
            A[1, 6], A[6, 6], B[6, 0] = 1.0 / self.Mr, -drive.current_bandwidth, drive.current_bandwidth
        else:
            B[1, 0] = 1.0 / self.Mr
        self.big = np.block([[A, B], [np.zeros((3, 10))]])
        self.step, self.push = self._exact(self.h)
        self.z = np.zeros(7)
        self.commands, self.past = [], []
        self.sides = [self._side(drive.motor_friction), self._side(drive.stage_friction)]
        self.vm = self.vt = self.low = self.u = self.ref = self.ref_before = 0.0
        self.past.append(self.z)
        self.xm = self._read(0.0, 0, drive.motor_error, drive.motor_resolution)
        self.xt = self._read(0.0, 4, drive.stage_error, drive.stage_resolution) if drive.stage_encoder else self.xm
        self.past.pop()

    def _exact(self, h):
        both = expm(self.big * h)
        return both[:7, :7], both[:7, 7:]

    @staticmethod
    def _side(friction):
        return {"f": friction, "z": 0.0, "v": 0.0, "force": 0.0}

    def _read(self, delay, place, errors, q):
        """Position `delay` seconds ago, with the waves of its encoder, in its steps."""
        steps = round(delay / self.h, 6)
        k, part = len(self.past) - 1 - math.floor(steps), steps % 1.0
        rest = np.zeros(7)
        new, old = (self.past[i] if i >= 0 else rest for i in (k, k - 1))
        cubic = CubicHermiteSpline([0.0, self.h], [old[place], new[place]], [old[place + 1], new[place + 1]])
        x = float(cubic((1.0 - part) * self.h)) if part else new[place]
        x += sum(w.amplitude * math.sin(2.0 * math.pi * x / w.wavelength + w.phase) for w in errors)
        return math.floor(x / q + 0.5) * q if q else x

    def _law(self, ref, xm, xt):
        """Position-P velocity-P with velocity and acceleration fed forward, and a first-order two-encoder observer."""
        T, c = 1.0 / self.rate, self.c
        g, gd = c.derivative_bandwidth, c.disturbance_bandwidth
        a = (g * T - 2.0) / (g * T + 2.0)  # bilinear g s/(s + g)
        self.vm = -a * self.vm + 2.0 * g / (2.0 + g * T) * (xm - self.xm)
        self.vt = -a * self.vt + 2.0 * g / (2.0 + g * T) * (xt - self.xt)
        self.xm, self.xt = xm, xt
        M, Ct = self.Mr + self.Mn, self.d.stage_damping
        momentum = gd * (M * self.vm + self.Mt * self.vt)
        keep = math.exp(-gd * T)
        self.low = keep * self.low + (1.0 - keep) * (self.u + momentum - self.Cr * self.vm - Ct * self.vt)
        speed, pace = (ref - self.ref) / T, (ref - 2.0 * self.ref + self.ref_before) / T**2
        self.ref_before, self.ref = self.ref, ref
        wanted = c.velocity_gain * (c.position_gain * (ref - xt) + speed - self.vm) + pace
        self.u = (M + self.Mt) * wanted + self.low - momentum
        return self.u

    def _limit(self, f, v):
        top = f.coulomb if f.static is None else f.static
        return f.coulomb + (top - f.coulomb) * math.exp(-(abs(v / f.stribeck_velocity) ** f.stribeck_exponent))

    def _bend(self, side, v):
        """LuGre with its exact step: half a sub-step behind before, half a sub-step ahead after."""
        f = side["f"]
        g, k = self._limit(f, v), f.bristle_stiffness
        rest = math.copysign(g / k, v)
        side["z"] = rest + (side["z"] - rest) * math.exp(-k * abs(v) * self.h / g)
        ahead = v + 0.5 * (v - side["v"])
        rate = ahead - k * abs(ahead) * side["z"] / self._limit(f, ahead)
        side["v"] = v
        side["force"] = k * side["z"] + f.bristle_damping * rate

    def _grip(self, side, v, end, at, column, place):
        """Hold the side at rest at the end of the sub-step if its friction can; else let it slide."""
        needed = side["force"] - end[at] / self.push[at, column]
        limit = self._limit(side["f"], v)
        holds = abs(needed) <= limit
        force = needed if holds else math.copysign(limit, needed)
        end = end + self.push[:, column] * (force - side["force"])
        side["force"] = force
        if holds:
            end[place] = 0.0
        return end

    def _substep(self, force):
        d, steps = self.d, round(self.d.thrust_delay / self.h, 6)
        k, part = len(self.commands) - 1 - math.floor(steps), steps % 1.0
        new, old = (self.commands[i] if i >= 0 else 0.0 for i in (k, k - 1))
        motor, stage = self.sides
        for side, at in ((motor, 1), (stage, 5)):
            if side["f"] and side["f"].bristle_stiffness:
                self._bend(side, self.z[at])
        middle = self.z[0] + 0.5 * self.h * self.z[1]
        ripple = sum(w.amplitude * math.sin(2.0 * math.pi * middle / w.wavelength + w.phase) for w in d.ripple)
        loads = [ripple + motor["force"], d.load + force + stage["force"]]
        end = self.z
        for piece, command in ((part, old), (1.0 - part, new)):  # the dead time ends within the sub-step
            step, push = self._exact(piece * self.h) if part else (self.step, piece * self.push)
            end = step @ end + push @ [command, *loads] if piece else end
        if not self.lag:
            end[6] = new
        for side, at, column in ((motor, 1, 1), (stage, 5, 2)):
            if side["f"] and not side["f"].bristle_stiffness:
                end = self._grip(side, self.z[at], end, at, column, at)
        self.z = end

    def run(self, commands, forces):
        """Thrust, readings of motor and stage, true motor and stage, friction of both, screw read and true: (9, n)."""
        out = []
        for i, command in enumerate(commands):
            self.past.append(self.z)
            d = self.d
            xm = self._read(d.motor_delay, 0, d.motor_error, d.motor_resolution)
            xt = self._read(d.stage_delay, 4, d.stage_error, d.stage_resolution) if d.stage_encoder else xm
            u = self._law(command, xm, xt) if self.c else command
            viscous = [side["f"].viscous if side["f"] else 0.0 for side in self.sides]
            rub = [side["force"] + c * self.z[at] for side, c, at in zip(self.sides, viscous, (1, 5), strict=True)]
            screw = [np.nan, np.nan]
            if d.screw_inertia is not None:
                screw = [self._read(d.screw_delay, 2, (), d.screw_resolution), self.z[2]]
            out.append([u, xm, xt, self.z[0], self.z[4], *rub, *screw])
            self.past.pop()
            for force in forces[i * self.substeps : (i + 1) * self.substeps]:
                self.past.append(self.z)
                self.commands.append(u)
                self._substep(force)
        return np.array(out).T


def loop_response(drive, control, rate, substeps, frequency_hz, aliases=300):
    """Thrust, motor and stage reading over a sinusoidal force of a controlled axis of two inertias, analytic.

    Thrust and force are held, over samples and sub-steps, and their images beyond the Nyquist frequency fold back.
    """
    T = 1.0 / rate
    w = 2.0 * math.pi * frequency_hz
    R = drive.lead / (2.0 * math.pi)
    Mr, Cr, Mt = drive.motor_inertia / R**2, drive.motor_damping / R**2, drive.stage_mass

    def plant(s):
        a_r, a_t = Mr * s**2 + Cr * s, Mt * s**2 + drive.stage_damping * s
        b = drive.drive_damping * s + drive.drive_stiffness
        delta = a_r * a_t + b * (a_r + a_t)
        return (a_t + b) / delta, b / delta, (a_r + b) / delta

    m = np.arange(-aliases, aliases + 1)
    s = 1j * (w + m * 2.0 * math.pi * rate)
    lag = 1.0 if drive.current_bandwidth == math.inf else drive.current_bandwidth / (s + drive.current_bandwidth)
    hold = -np.expm1(-s * T) / (s * T) * lag * np.exp(-s * drive.thrust_delay)
    mm, tm, _ = plant(s)
    ages = np.exp(-s * drive.motor_delay), np.exp(-s * drive.stage_delay)
    motor_u, stage_u = np.sum(hold * mm * ages[0]), np.sum(hold * tm * ages[1])
    k = np.arange(-20, 21)
    s = 1j * (w + k * 2.0 * math.pi * rate * substeps)
    _, b, rb = plant(s)
    images = -((-1.0) ** k) * np.sinc((w / (2.0 * math.pi * rate * substeps)) + k)
    motor_f = np.sum(images * b * np.exp(-s * drive.motor_delay))
    stage_f = np.sum(images * rb * np.exp(-s * drive.stage_delay))
    # the law: derivative g s/(s+g) by the bilinear rule, first-order observer with exact decay
    back, g, gd = np.exp(-1j * w * T), control.derivative_bandwidth, control.disturbance_bandwidth
    der = 2.0 * g / (2.0 + g * T) * (1.0 - back) / (1.0 + (g * T - 2.0) / (g * T + 2.0) * back)
    keep = math.exp(-gd * T)
    low = (1.0 - keep) / (1.0 - keep * back)
    M = Mr + Mt
    from_m = der * (-M * control.velocity_gain + low * (gd * Mr - Cr) - gd * Mr)
    from_t = der * (low * (gd * Mt - drive.stage_damping) - gd * Mt) - M * control.velocity_gain * control.position_gain
    u = (from_m * motor_f + from_t * stage_f) / (1.0 - low * back - from_m * motor_u - from_t * stage_u)
    return np.array([u, motor_u * u + motor_f, stage_u * u + stage_f])
