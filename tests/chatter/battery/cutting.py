"""Cuts simulated tooth by tooth: modes, delayed surface, loss of contact. Nothing here knows how chatter is detected.

Plain regenerative cutting in the time domain (chip thickness from the surface that earlier teeth left, no force out of
contact), lumped modes in two directions, semi-implicit Euler. Truth comes from a twin without noise and run-out: the
energy that does not repeat from tooth to tooth.
"""

from dataclasses import dataclass, replace

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.signal import butter, sosfiltfilt

Floats = NDArray[np.float64]
RUNAWAY = 1e3
"""Motion over the feed beyond which a cut is no longer one."""
NEITHER = 1e-3
"""Ratio given to what is neither stable nor chatter."""
SUSTAINED = 0.7
"""Energy of the later half over the earlier, from which a vibration keeps itself up."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Cut:
    """One cut; turning is one tooth that never leaves."""

    spindle_hz: float
    teeth: int
    begin: float
    """Angle at which a tooth enters (rad); with `end` 2 pi apart it always cuts."""
    end: float
    stiffness: float
    """Cutting stiffness over modal stiffness of the first mode."""
    modes: tuple[tuple[float, float, float, float], ...]
    """Natural frequency (Hz), damping ratio, modal stiffness relative to the first, direction (rad)."""
    normal: float = 0.35
    """Normal over tangential force."""
    feed: float = 1.0
    runout: tuple[float, ...] = ()
    noise: float = 0.0
    """Relative fluctuation of the force."""
    seconds: float = 4.0
    entry: float = 0.0
    exit: float = np.inf
    seed: int = 0

    @property
    def steps_per_tooth(self) -> int:
        """Steps from one tooth to the next."""
        fastest = max(m[0] for m in self.modes)
        return int(np.ceil(max(25.0 * fastest, 12000.0) / (self.spindle_hz * self.teeth)))

    @property
    def rate(self) -> float:
        """Steps per second."""
        return self.steps_per_tooth * self.spindle_hz * self.teeth


@njit(cache=True)
def _march(steps, per_tooth, teeth, begin, end, stiffness, normal, feed, runout, noise, modes, rate, first, last, out):
    per_rev = per_tooth * teeth
    count = modes.shape[0]
    q = np.zeros(count)
    v = np.zeros(count)
    dt = 1.0 / rate
    wall = np.zeros(per_rev)
    always = end - begin > 6.28
    for i in range(steps):
        x = 0.0
        y = 0.0
        for k in range(count):
            x += q[k] * np.cos(modes[k, 3])
            y += q[k] * np.sin(modes[k, 3])
        fx = 0.0
        fy = 0.0
        if first <= i < last:
            for j in range(teeth):
                place = (i + j * per_tooth) % per_rev
                angle = 6.283185307179586 * place / per_rev
                if always:
                    sine = 1.0
                    cosine = 0.0
                elif begin <= angle < end:
                    sine = np.sin(angle)
                    cosine = np.cos(angle)
                else:
                    continue
                edge = x * sine + y * cosine + runout[j]
                h = feed * sine + edge - wall[place]
                if h > 0.0:
                    tangential = stiffness * h * (1.0 + noise[i])
                    radial = normal * tangential
                    if always:
                        fx -= tangential
                        fy -= radial
                    else:
                        fx += -tangential * cosine - radial * sine
                        fy += tangential * sine - radial * cosine
                    wall[place] = edge
                else:
                    wall[place] -= feed * sine
        for k in range(count):
            omega = 6.283185307179586 * modes[k, 0]
            force = fx * np.cos(modes[k, 3]) + fy * np.sin(modes[k, 3])
            a = omega * omega * (force / modes[k, 2] - q[k]) - 2.0 * modes[k, 1] * omega * v[k]
            v[k] += dt * a
            q[k] += dt * v[k]
        out[0, i] = x
        out[1, i] = y
        out[2, i] = fx
        out[3, i] = fy


def march(cut: Cut) -> Floats:
    """Return x, y, force x, force y, shape (4, n), at the rate of the cut."""
    steps = round(cut.seconds * cut.rate)
    rng = np.random.default_rng(cut.seed)
    noise = cut.noise * rng.normal(size=steps) if cut.noise else np.zeros(steps)
    runout = np.array(cut.runout if cut.runout else (0.0,) * cut.teeth, dtype=float)
    out = np.zeros((4, steps))
    first, last = (int(min(t * cut.rate, 2e9)) for t in (cut.entry, cut.exit))
    modes = np.array(cut.modes, dtype=float)
    _march(steps, cut.steps_per_tooth, cut.teeth, cut.begin, cut.end, cut.stiffness, cut.normal, cut.feed, runout,
           noise, modes, cut.rate, first, last, out)  # fmt: skip
    return out


def truth(cut: Cut, sensor: str) -> tuple[float, float, float]:
    """Return energy that does not repeat over that which does, by revolution and by tooth, and its strongest line (Hz).

    Seen by a sensor, in twins without noise that cut from the start on; the second without run-out too. A vibration
    that repeats with the revolution but not with the tooth is run-out, or chatter locked to it.
    """
    twin = replace(cut, noise=0.0, entry=0.0, exit=np.inf, seconds=2.5)
    by_turn, line = _unsteady(twin, sensor, twin.teeth)
    by_tooth, _ = _unsteady(replace(twin, runout=()), sensor, 1)
    return by_turn, by_tooth, line


def _unsteady(twin: Cut, sensor: str, teeth: int) -> tuple[float, float]:
    motion = march(twin)
    if not np.abs(motion).max() < RUNAWAY * twin.feed:  # the tool digs in for good
        return NEITHER, 0.0
    signal = sense(motion, sensor, twin.rate)
    per = twin.steps_per_tooth * teeth
    kept = signal[len(signal) // 2 :]
    rows = kept[: len(kept) // per * per].reshape(-1, per)
    periodic = rows.mean(axis=0)
    rest = (rows - periodic).ravel()
    forced, free = (float((part**2).mean()) for part in (periodic - periodic.mean(), rest))
    half = len(rest) // 2
    if (rest[half:] ** 2).sum() < SUSTAINED * (rest[:half] ** 2).sum() and free > 1e-6 * forced:
        return NEITHER, 0.0  # a transient that dies slowly
    power = np.abs(np.fft.rfft(rest * np.hanning(len(rest)))) ** 2
    line = float(np.argmax(power[1:]) + 1) * twin.rate / len(rest)
    return free / max(forced, 1e-12 * free, 1e-300), line


def sense(motion: Floats, sensor: str, rate: float) -> Floats:
    """Return what a sensor shows of a motion."""
    x = 0.8 * motion[0] + 0.6 * motion[1]
    if sensor == "displacement":
        return x
    if sensor == "force":
        return 0.8 * motion[2] + 0.6 * motion[3]
    velocity = np.gradient(x) * rate
    if sensor == "velocity":
        return velocity
    return np.gradient(velocity) * rate  # acceleration


def resampled(signal: Floats, rate: float, target: float, seconds: float, jitter: Floats | None = None) -> Floats:
    """Return a signal at another rate, its band limited first; `jitter` (s) moves the samples in time."""
    corner = 0.45 * min(rate, target)
    smooth = sosfiltfilt(butter(6, corner, fs=rate, output="sos"), signal)
    time = np.arange(int(seconds * target) - 2) / target
    if jitter is not None:
        time = np.clip(time + jitter[: len(time)], 0.0, seconds)
    return np.interp(time, np.arange(len(smooth)) / rate, smooth)
