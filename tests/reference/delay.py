"""The two-delay equation by the method of steps: DOP853 from break to break, contact found as events of the solver."""

import bisect
import math

import numpy as np
from scipy.integrate import solve_ivp

TOLERANCE = {"rtol": 1e-11, "atol": 1e-17, "method": "DOP853"}


class SlowDelay:
    """A chain of dense solutions; what a tool left is looked up by contact, however long ago.

    Without `nominal_cut` contact is never lost. `past` is a function of one time, `force` likewise.
    """

    def __init__(self, equation, *, past=lambda t: 0.0, velocity=0.0, force=lambda t: 0.0, nominal_cut=math.inf,
                 flank_factor=0.0, flank_speed=math.inf):  # fmt: skip
        self.e, self.past, self.force = equation, past, force
        self.h0, self.flank_factor, self.flank_speed = nominal_cut, flank_factor, flank_speed
        self.delays = (equation.delay_1, equation.delay_2)
        self.starts, self.pieces, self.touches = [], [], []
        self.kinks = [0.0]
        self.state = np.array([past(0.0), velocity])
        self.touch, self.flank = [True, True], 0 if abs(velocity) <= flank_speed else int(math.copysign(1, velocity))
        self.longest_step = 1e-3 if math.isinf(nominal_cut) else 2e-5  # an event is seen when it lasts that long

    def displacement(self, time):
        """What the bar did at a time."""
        if time <= 0.0:
            return self.past(time)
        return self.pieces[self._piece(time)](time)[0]

    def left(self, tool, time):
        """What a tool left at a time, deeper than nominal is positive."""
        sign = 1.0 if tool == 0 else -1.0
        if time <= 0.0 or self.touches[self._piece(time)][tool]:
            return sign * self.displacement(time)
        return self.met(tool, time) - self.h0

    def met(self, tool, time):
        return self.e.overlap * self.left(1 - tool, time - self.delays[tool])

    def run(self, times):
        """Displacement at rising times from 0 on."""
        now = 0.0
        while now < times[-1]:
            now = self._advance(now, times[-1])
        return np.array([self.displacement(t) for t in times])

    def _piece(self, time):
        return max(bisect.bisect_right(self.starts, time) - 1, 0)

    def _advance(self, now, until):
        ahead = [k + d for k in self.kinks for d in self.delays if k + d > now + 1e-12]
        end = min([*ahead, until, now + 0.9 * min(self.delays)])
        events = [
            self._event(lambda t, y: self._chip(0, t, y), not self.touch[0]),
            self._event(lambda t, y: self._chip(1, t, y), not self.touch[1]),
            self._event(lambda t, y: y[1] - self.flank_speed, self.flank != 1),
            self._event(lambda t, y: -y[1] - self.flank_speed, self.flank != -1),
        ]
        active = [math.isfinite(self.h0)] * 2 + [self.flank_factor > 0.0 and touch for touch in self.touch]
        chosen = [i for i in range(4) if active[i]]
        done = solve_ivp(
            self._slope, (now, end), self.state, dense_output=True, max_step=self.longest_step,
            events=[events[i] for i in chosen] or None, **TOLERANCE,
        )  # fmt: skip
        assert done.success, done.message
        self.starts.append(now)
        self.pieces.append(done.sol)
        self.touches.append(tuple(self.touch))
        self.state, now = done.y[:, -1], done.t[-1]
        if done.status == 1:
            self._change(next(i for i, t in zip(chosen, done.t_events, strict=True) if t.size))
            self.state = done.sol(now)
        self.kinks = [k for k in [*self.kinks, now] if k + max(self.delays) > now - 1e-9]
        return now

    def _change(self, what):
        speed = self.state[1]
        if what < 2:
            self.touch[what] = not self.touch[what]
            self.flank = 1 if self.touch[0] and speed > self.flank_speed else 0
            self.flank = -1 if self.touch[1] and -speed > self.flank_speed else self.flank
        else:
            self.flank = 0 if self.flank else (1 if what == 2 else -1)

    def _chip(self, tool, time, state):
        return self.h0 + (state[0] if tool == 0 else -state[0]) - self.met(tool, time)

    def _slope(self, time, state):
        e, push = self.e, self.force(time) - self.e.damping * state[1] - self.e.stiffness * state[0]
        for tool, sign in ((0, 1.0), (1, -1.0)):
            if self.touch[tool]:
                depth = sign * state[0] - self.met(tool, time)
                steady = self.h0 if math.isfinite(self.h0) else 0.0
                push -= sign * (e.cutting_stiffness * (steady + depth) + sign * e.process_damping * state[1])
        if self.flank:
            push -= self.flank_factor * e.process_damping * (state[1] - self.flank * self.flank_speed)
        return [state[1], push / e.modal_mass]

    @staticmethod
    def _event(function, rising):
        function.terminal, function.direction = True, 1.0 if rising else -1.0
        return function
