"""Recordings with chatter."""

import numpy as np

from tests.chatter.battery.parts import (
    Sample,
    coloured,
    fluctuating,
    gate,
    growing,
    hum,
    knocks,
    loguniform,
    mode,
    rms,
    room,
    seconds,
    tones,
    wandering,
)  # fmt: skip
from tests.chatter.battery.stable import _rate, _told, forced_milling, milling_speed


def _off_comb(rng, spindle, teeth, low, high):
    """A frequency that no harmonic of tooth passing comes within 2 % of tooth passing of."""
    while True:
        line = loguniform(rng, low, high)
        tooth = spindle * teeth
        if abs(line / tooth - round(line / tooth)) > 0.03:
            return line


def _family(rng, phase, tooth_phase, sidebands, harmonics):
    wave = np.sin(2 * np.pi * phase)
    for k in (-2, -1, 1, 2):
        wave = wave + sidebands * rng.uniform(0.2, 1.0) / abs(k) * np.sin(2 * np.pi * (phase + k * tooth_phase) + k)
    for k in (2, 3, 4):
        wave = wave + harmonics ** (k - 1) * np.sin(2 * np.pi * k * phase + rng.uniform(0, 6.28))
    return wave / rms(wave)


def milling(rng):
    """Chatter with sidebands at tooth passing over forced vibration; begins within, or all along."""
    rate = _rate(rng)
    time = seconds(rng.uniform(2.5, 9.0), rate)
    spindle, teeth = milling_speed(rng, rate)
    line = _off_comb(rng, spindle, teeth, 150.0, min(0.3 * rate, 4500.0))
    whole = rng.random() < 0.35
    start, end = (-1.0, 99.0) if whole else (rng.uniform(0.2, 0.5) * time[-1], rng.uniform(0.75, 1.2) * time[-1])
    turn = wandering(rng, time, spindle, rng.choice([0.0, 2e-4, 1e-3]), 0.5)
    phase = wandering(rng, time, line, rng.choice([2e-4, 1e-3, 3e-3]), 0.3)
    envelope = gate(time, start, end, 0.05) * fluctuating(rng, time, 0.15, 0.1)
    wave = forced_milling(rng, time, rate, spindle, teeth, turn)
    if rng.random() < 0.5:
        wave *= gate(time, 0.1 * time[-1], 0.95 * time[-1], 0.05)
    size = loguniform(rng, 1.0, 5.0) if whole else loguniform(rng, 0.7, 5.0)
    wave += size * envelope * _family(rng, phase, teeth * turn, rng.uniform(0, 0.5), rng.uniform(0, 0.3))
    wave += loguniform(rng, 0.02, 0.5) * coloured(rng, len(time), rng.uniform(0.0, 1.5))
    if rng.random() < 0.3:
        wave += knocks(rng, time, rate, 3, 5.0)
    return Sample(signal=wave, rate_hz=rate, truth="chatter", frequencies_hz=(line,),
                  span=(max(start, 0.0), min(end, time[-1])), spindle_hz=spindle, tools=teeth,
                  told=_told(rng, spindle, teeth))  # fmt: skip


def milling_sound(rng):
    """The same through a room, over hum and tones of the machine."""
    rate = float(rng.choice([16000, 22050, 44100, 48000]))
    time = seconds(rng.uniform(4.0, 9.0), rate)
    spindle, teeth = milling_speed(rng, rate)
    line = _off_comb(rng, spindle, teeth, 200.0, 4500.0)
    start, end = rng.uniform(0.2, 0.4) * time[-1], rng.uniform(0.7, 1.2) * time[-1]
    phase = wandering(rng, time, line, rng.choice([2e-4, 1e-3, 3e-3]), 0.3)
    cut = gate(time, 0.15 * time[-1], end + 0.1, 0.05)
    wave = forced_milling(rng, time, rate, spindle, teeth) * (0.05 + cut * fluctuating(rng, time, 0.15, 0.2))
    wave = room(rng, wave, rate)
    wave += cut * loguniform(rng, 0.05, 0.5) * coloured(rng, len(time), rng.uniform(0.0, 1.0))
    envelope = gate(time, start, end, 0.1) * fluctuating(rng, time, 0.2, 0.1)
    family = _family(rng, phase, teeth * spindle * time, rng.uniform(0, 0.5), rng.uniform(0, 0.3))
    wave += loguniform(rng, 1.0, 6.0) * rms(wave) * envelope * family
    wave += tones(rng, time, rate, int(rng.integers(2, 8)), loguniform(rng, 0.03, 0.4))
    wave += hum(rng, time, loguniform(rng, 0.01, 0.3)) + knocks(rng, time, rate, int(rng.integers(0, 4)), 2.0)
    return Sample(signal=wave, rate_hz=rate, truth="chatter", frequencies_hz=(line,), span=(start, min(end, time[-1])),
                  spindle_hz=spindle, tools=teeth, told=_told(rng, spindle, teeth))  # fmt: skip


def turning(rng):
    """A line that grows out of noise through modes, or is there all along; harmonics when the tool leaves the cut."""
    rate = _rate(rng, 1600.0)
    time = seconds(rng.uniform(2.0, 9.0), rate)
    spindle = loguniform(rng, 3.0, 50.0)
    line = loguniform(rng, 110.0, min(2000.0, 0.33 * rate))
    force = coloured(rng, len(time), rng.uniform(0.0, 1.0))
    hump = mode(force, rate, line * (1.0 + rng.normal(0.0, 0.02)), loguniform(rng, 0.01, 0.05))
    wave = loguniform(rng, 0.1, 0.7) * force + loguniform(rng, 0.1, 0.5) * hump / rms(hump)
    for k in range(1, 12):
        wave = wave + rng.uniform(0.0, 0.5) / k * np.sin(2 * np.pi * (k * spindle * time + rng.random()))
    whole = rng.random() < 0.4
    start = -9.0 if whole else rng.uniform(0.15, 0.5) * time[-1]
    phase = wandering(rng, time, line, rng.choice([2e-4, 1e-3, 3e-3]), 0.3)
    phase = phase + 0.01 * np.sin(2 * np.pi * spindle * time) * line / 100.0 * rng.random()
    growth = loguniform(rng, 3.0, 60.0)
    envelope = growing(time, start, growth) * fluctuating(rng, time, rng.uniform(0.05, 0.3), rng.uniform(0.05, 0.3))
    wave += loguniform(rng, 1.5, 10.0) * envelope * _family(rng, phase, 0.0 * time, 0.0, rng.uniform(0.0, 0.35))
    visible = max(start + (6.9 - 1.5) / growth, 0.0)
    return Sample(signal=wave, rate_hz=rate, truth="chatter", frequencies_hz=(line,), span=(visible, float(time[-1])),
                  spindle_hz=spindle, tools=1, told=_told(rng, spindle, 1))  # fmt: skip


def short(rng):
    """Half a second to two of nothing but chatter."""
    rate = _rate(rng, 2500.0)
    time = seconds(rng.uniform(0.5, 2.0), rate)
    spindle, teeth = milling_speed(rng, rate)
    line = _off_comb(rng, spindle, teeth, 150.0, min(0.33 * rate, 4500.0))
    phase = wandering(rng, time, line, 5e-4, 0.3)
    wave = fluctuating(rng, time, 0.1, 0.1) * _family(rng, phase, teeth * spindle * time, rng.uniform(0, 0.4), 0.1)
    wave += loguniform(rng, 0.05, 0.5) * forced_milling(rng, time, rate, spindle, teeth)
    wave += loguniform(rng, 0.05, 0.5) * coloured(rng, len(time), rng.uniform(0.0, 1.0))
    return Sample(signal=wave, rate_hz=rate, truth="chatter", frequencies_hz=(line,), span=(0.0, float(time[-1])),
                  spindle_hz=spindle, tools=teeth, told=_told(rng, spindle, teeth))  # fmt: skip


def intermittent(rng):
    """Chatter that comes and goes."""
    rate = _rate(rng)
    time = seconds(rng.uniform(4.0, 9.0), rate)
    spindle, teeth = milling_speed(rng, rate)
    line = _off_comb(rng, spindle, teeth, 150.0, min(0.3 * rate, 4500.0))
    period = rng.uniform(0.8, 2.5)
    envelope = sum(gate(time, t, t + rng.uniform(0.4, 0.7) * period, 0.05) for t in np.arange(0.5, time[-1], period))
    wave = 0.4 * forced_milling(rng, time, rate, spindle, teeth)
    phase = wandering(rng, time, line, 1e-3, 0.3)
    wave += loguniform(rng, 0.7, 4.0) * envelope * _family(rng, phase, teeth * spindle * time, 0.2, 0.1)
    wave += loguniform(rng, 0.05, 0.4) * coloured(rng, len(time), rng.uniform(0.0, 1.0))
    return Sample(signal=wave, rate_hz=rate, truth="chatter", frequencies_hz=(line,), spindle_hz=spindle, tools=teeth,
                  told=_told(rng, spindle, teeth))  # fmt: skip


def two_modes(rng):
    """Two lines at once."""
    rate = _rate(rng)
    time = seconds(rng.uniform(3.0, 8.0), rate)
    spindle, teeth = milling_speed(rng, rate)
    lines = tuple(_off_comb(rng, spindle, teeth, 150.0, min(0.3 * rate, 4500.0)) for _ in range(2))
    if rng.random() < 0.5:
        lines = (lines[0], lines[0] + rng.uniform(30.0, 60.0))
    wave = 0.4 * forced_milling(rng, time, rate, spindle, teeth)
    start = rng.uniform(0.2, 0.5) * time[-1]
    for k, line in enumerate(lines):
        phase = wandering(rng, time, line, 5e-4, 0.3)
        wave += (1.5, rng.uniform(0.6, 1.5))[k] * gate(time, start, 99.0, 0.1) * np.sin(2 * np.pi * phase)
    wave += loguniform(rng, 0.05, 0.4) * coloured(rng, len(time), rng.uniform(0.0, 1.0))
    return Sample(signal=wave, rate_hz=rate, truth="chatter", frequencies_hz=lines, span=(start, float(time[-1])),
                  spindle_hz=spindle, tools=teeth, told=_told(rng, spindle, teeth))  # fmt: skip


def ramp(rng):
    """The speed changes and the chatter keeps its frequency."""
    rate = _rate(rng)
    time = seconds(rng.uniform(4.0, 9.0), rate)
    spindle, teeth = milling_speed(rng, rate)
    speed = spindle * (1.0 + rng.choice([-1, 1]) * rng.uniform(0.02, 0.2) * time / time[-1])
    turn = np.cumsum(speed) / rate
    line = _off_comb(rng, spindle, teeth, 150.0, min(0.3 * rate, 4500.0))
    phase = wandering(rng, time, line, 1e-3, 0.5)
    start = rng.choice([-1.0, 0.4 * time[-1]])
    wave = forced_milling(rng, time, rate, spindle, teeth, turn)
    wave += loguniform(rng, 1.5, 5.0) * gate(time, start, 99.0, 0.1) * _family(rng, phase, teeth * turn, 0.3, 0.1)
    wave += loguniform(rng, 0.05, 0.4) * coloured(rng, len(time), rng.uniform(0.0, 1.0))
    return Sample(signal=wave, rate_hz=rate, truth="chatter", frequencies_hz=(line,),
                  span=(max(start, 0.0), float(time[-1])), spindle_hz=spindle, tools=teeth)  # fmt: skip


def servo(rng):
    """Current, force or displacement at 1.6 to 5 kHz: mean, drift, strong low harmonics, a weaker line of chatter."""
    rate = float(rng.choice([1600, 2000, 2500, 5000]))
    time = seconds(rng.uniform(3.0, 9.0), rate)
    spindle, teeth = loguniform(rng, 5.0, 60.0), int(rng.integers(1, 5))
    line = _off_comb(rng, spindle, teeth, 110.0, 0.33 * rate)
    start = rng.uniform(0.2, 0.5) * time[-1]
    force = np.zeros_like(time)
    for k in range(1, 12):
        force += rng.uniform(0.3, 1.0) / k**1.5 * np.sin(2 * np.pi * (k * spindle * teeth * time + rng.random()))
    phase = wandering(rng, time, line, 1e-3, 0.3)
    wave = 3.0 * rng.normal() + rng.normal() * time + force * gate(time, 0.1 * time[-1], 99.0, 0.1)
    wave += loguniform(rng, 0.3, 2.0) * growing(time, start, loguniform(rng, 8.0, 40.0)) * np.sin(2 * np.pi * phase)
    wave += loguniform(rng, 0.02, 0.2) * coloured(rng, len(time), rng.uniform(0.0, 1.0))
    return Sample(signal=wave, rate_hz=rate, truth="chatter", frequencies_hz=(line,), spindle_hz=spindle, tools=teeth,
                  told=_told(rng, spindle, teeth))  # fmt: skip
