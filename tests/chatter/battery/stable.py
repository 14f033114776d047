"""Recordings without chatter."""

import numpy as np

from tests.chatter.battery.parts import (
    Sample,
    coloured,
    fluctuating,
    gate,
    hum,
    knocks,
    loguniform,
    mode,
    rms,
    room,
    seconds,
    tones,
    train,
    wandering,
)  # fmt: skip


def _rate(rng, low=4000.0):
    return float(rng.choice([r for r in (1600, 2500, 4000, 5000, 8000, 10000, 12800, 20000, 25600, 44100, 48000, 51200)
                             if r >= low]))  # fmt: skip


def _told(rng, spindle, teeth, known=None):
    """What the judge is told: nothing, the speed, or speed and tools; a tachometer errs a little."""
    choice = rng.integers(3) if known is None else known
    told = {}
    if choice:
        told["spindle_hz"] = spindle * (1.0 + rng.normal(0.0, 0.001))
    if choice == 2:
        told["tools"] = teeth
    return told


def milling_speed(rng, rate):
    teeth = int(rng.integers(1, 7))
    return loguniform(rng, 500.0 / 60.0, min(20000.0 / 60.0, 0.12 * rate / teeth)), teeth


def forced_milling(rng, time, rate, spindle, teeth, turn=None):
    """Tooth passing through one to three modes, which may raise one harmonic over all others."""
    turn = time * spindle if turn is None else turn
    force = train(rng, turn, teeth, rng.choice([0.0, 0.05, 0.2, 0.5]), rng.uniform(0.15, 1.0))
    wave = force * loguniform(rng, 0.05, 1.0)
    for _ in range(rng.integers(1, 4)):
        frequency = loguniform(rng, max(150.0, 0.7 * spindle * teeth), 0.35 * rate)
        if rng.random() < 0.5:  # close to a harmonic of tooth passing
            frequency = teeth * spindle * max(round(frequency / (teeth * spindle)), 1) * (1.0 + rng.normal(0.0, 0.01))
        wave = wave + mode(force, rate, frequency, loguniform(rng, 0.008, 0.05))
    return wave / rms(wave)


def milling(rng):
    """A stable cut, with idle before and after or cut out of the middle."""
    rate = _rate(rng)
    time = seconds(rng.uniform(2.0, 9.0), rate)
    spindle, teeth = milling_speed(rng, rate)
    turn = wandering(rng, time, spindle, rng.choice([0.0, 2e-4, 1e-3]), 0.5)
    wave = forced_milling(rng, time, rate, spindle, teeth, turn) * fluctuating(rng, time, 0.1, 0.3)
    if rng.random() < 0.6:
        wave *= gate(time, rng.uniform(0.1, 0.3) * time[-1], rng.uniform(0.7, 1.2) * time[-1], rng.choice([0.01, 0.3]))
    wave += loguniform(rng, 0.02, 0.7) * coloured(rng, len(time), rng.uniform(0.0, 1.5))
    return Sample(signal=wave, rate_hz=rate, truth="stable", spindle_hz=spindle, tools=teeth,
                  told=_told(rng, spindle, teeth))  # fmt: skip


def milling_sound(rng):
    """A stable cut through a room, over hum and tones of the machine that were there before."""
    rate = float(rng.choice([16000, 22050, 44100, 48000]))
    time = seconds(rng.uniform(4.0, 9.0), rate)
    spindle, teeth = milling_speed(rng, rate)
    turn = wandering(rng, time, spindle, rng.choice([0.0, 2e-4, 1e-3]), 0.5)
    cut = gate(time, 0.2 * time[-1], rng.uniform(0.7, 1.2) * time[-1], 0.05) * fluctuating(rng, time, 0.15, 0.2)
    wave = forced_milling(rng, time, rate, spindle, teeth, turn) * (0.05 + cut)
    wave += cut * loguniform(rng, 0.1, 0.8) * coloured(rng, len(time), rng.uniform(0.0, 1.0))
    wave += tones(rng, time, rate, int(rng.integers(2, 8)), loguniform(rng, 0.03, 0.5))
    wave += hum(rng, time, loguniform(rng, 0.01, 0.3)) + knocks(rng, time, rate, int(rng.integers(0, 4)), 2.0)
    wave = room(rng, wave, rate) + 0.05 * coloured(rng, len(time), 1.0)
    return Sample(signal=wave, rate_hz=rate, truth="stable", spindle_hz=spindle, tools=teeth,
                  told=_told(rng, spindle, teeth))  # fmt: skip


def turning(rng):
    """Noise through lightly damped modes, and a few harmonics of the spindle."""
    rate = _rate(rng, 1600.0)
    time = seconds(rng.uniform(2.0, 9.0), rate)
    spindle = loguniform(rng, 3.0, 50.0)
    force = coloured(rng, len(time), rng.uniform(0.0, 1.0)) * fluctuating(rng, time, 0.2, 0.2)
    wave = loguniform(rng, 0.1, 1.0) * force
    for _ in range(rng.integers(1, 4)):
        wave = wave + mode(force, rate, loguniform(rng, 100.0, 0.35 * rate), loguniform(rng, 0.006, 0.05))
    wave = wave / rms(wave)
    if rng.random() < 0.5:
        wave *= 0.1 + gate(time, 0.25 * time[-1], rng.uniform(0.7, 1.2) * time[-1], 0.05)
    for k in range(1, 12):
        wave += rng.uniform(0.0, 0.5) / k * np.sin(2 * np.pi * (k * spindle * time + rng.random()))
    return Sample(signal=wave, rate_hz=rate, truth="stable", spindle_hz=spindle, tools=1, told=_told(rng, spindle, 1))


def interrupted(rng):
    """One to four blows a revolution, each ringing in a mode."""
    rate = _rate(rng)
    time = seconds(rng.uniform(3.0, 8.0), rate)
    spindle, blows = loguniform(rng, 5.0, 40.0), int(rng.integers(1, 5))
    turn = wandering(rng, time, spindle, rng.choice([2e-4, 1e-3, 5e-3]), 0.5)
    force = train(rng, turn, blows, 0.1, rng.uniform(0.02, 0.5))
    wave = 0.3 * force / rms(force)
    for _ in range(rng.integers(1, 3)):
        ring = mode(force, rate, loguniform(rng, 150.0, 0.35 * rate), loguniform(rng, 0.008, 0.05))
        wave = wave + ring / rms(ring) * loguniform(rng, 0.3, 1.5)
    if rng.random() < 0.5:
        wave *= gate(time, 0.25 * time[-1], 0.9 * time[-1], 0.05)
    wave += loguniform(rng, 0.03, 0.5) * coloured(rng, len(time), rng.uniform(0.0, 1.0))
    return Sample(signal=wave, rate_hz=rate, truth="stable", spindle_hz=spindle, tools=1, told=_told(rng, spindle, 1))


def idle(rng):
    """The spindle runs and nothing cuts."""
    rate = _rate(rng)
    time = seconds(rng.uniform(2.0, 9.0), rate)
    spindle = loguniform(rng, 8.0, 300.0)
    wave = sum(
        (loguniform(rng, 0.05, 1.0) / k**0.5 * np.sin(2 * np.pi * (k * spindle * time + rng.random()))
         for k in range(1, 9)), np.zeros_like(time),
    )  # fmt: skip
    wave += tones(rng, time, rate, int(rng.integers(3, 7)), 0.7) + hum(rng, time, loguniform(rng, 0.03, 0.5))
    wave += loguniform(rng, 0.3, 1.5) * coloured(rng, len(time), rng.uniform(0.0, 1.5))
    return Sample(signal=wave, rate_hz=rate, truth="stable", spindle_hz=spindle, tools=1,
                  told=_told(rng, spindle, 1, int(rng.integers(2))))  # fmt: skip


def noise(rng):
    """Nothing but noise of some colour, perhaps swelling."""
    rate = _rate(rng, 1600.0)
    time = seconds(rng.uniform(0.6, 8.0), rate)
    wave = coloured(rng, len(time), rng.uniform(-0.5, 2.0)) * (1.0 + 5.0 * rng.random() * gate(time, 1.0, 4.0, 0.2))
    return Sample(signal=wave, rate_hz=rate, truth="stable")


def blows(rng):
    """Knocks, entries and exits over noise or a quiet cut."""
    rate = _rate(rng)
    time = seconds(rng.uniform(2.0, 8.0), rate)
    wave = knocks(rng, time, rate, int(rng.integers(1, 12)), loguniform(rng, 2.0, 30.0))
    spindle, teeth = milling_speed(rng, rate)
    if rng.random() < 0.5:
        wave += forced_milling(rng, time, rate, spindle, teeth) * gate(time, 0.2 * time[-1], 0.8 * time[-1], 0.01)
    wave += loguniform(rng, 0.1, 1.0) * coloured(rng, len(time), rng.uniform(0.0, 1.0))
    return Sample(signal=wave, rate_hz=rate, truth="stable", spindle_hz=spindle, tools=teeth,
                  told=_told(rng, spindle, teeth))  # fmt: skip


def ramp(rng):
    """A stable cut while the speed changes, steadily or in a step."""
    rate = _rate(rng)
    time = seconds(rng.uniform(4.0, 9.0), rate)
    spindle, teeth = milling_speed(rng, rate)
    change = rng.choice([-1, 1]) * rng.uniform(0.02, 0.3)
    if rng.random() < 0.5:
        speed = spindle * (1.0 + change * time / time[-1])
    else:
        speed = spindle * (1.0 + change * np.clip((time - 0.5 * time[-1]) / 0.5, 0.0, 1.0))
    wave = forced_milling(rng, time, rate, spindle, teeth, np.cumsum(speed) / rate)
    wave += loguniform(rng, 0.05, 0.5) * coloured(rng, len(time), rng.uniform(0.0, 1.0))
    return Sample(signal=wave, rate_hz=rate, truth="stable", spindle_hz=spindle, tools=teeth,
                  told=_told(rng, spindle, teeth, 0))  # fmt: skip


def feed(rng):
    """Feed and depth change in steps: the forced vibration follows, noise and modes too."""
    rate = _rate(rng)
    time = seconds(rng.uniform(4.0, 9.0), rate)
    spindle, teeth = milling_speed(rng, rate)
    steps = np.repeat(rng.uniform(0.1, 2.0, 8), -(-len(time) // 8))[: len(time)]
    force = coloured(rng, len(time), 0.5)
    hump = mode(force, rate, loguniform(rng, 200.0, 0.3 * rate), loguniform(rng, 0.01, 0.05))
    wave = steps * (forced_milling(rng, time, rate, spindle, teeth) + loguniform(rng, 0.1, 1.0) * hump / rms(hump))
    wave += loguniform(rng, 0.05, 0.3) * coloured(rng, len(time), 0.5)
    return Sample(signal=wave, rate_hz=rate, truth="stable", spindle_hz=spindle, tools=teeth,
                  told=_told(rng, spindle, teeth))  # fmt: skip


def encoder(rng):
    """Servo signal: lines of the encoder at multiples of feed over signal period, as long as the axis moves."""
    rate = float(rng.choice([4000, 5000, 9000, 10000]))
    time = seconds(rng.uniform(3.0, 8.0), rate)
    spindle, teeth = milling_speed(rng, rate)
    line = loguniform(rng, 100.0, 0.15 * rate)
    moves = gate(time, 0.1 * time[-1], 0.95 * time[-1], 0.02)
    wave = forced_milling(rng, time, rate, spindle, teeth) * gate(time, 0.35 * time[-1], 0.85 * time[-1], 0.02)
    phase = wandering(rng, time, line, 1e-3, 0.2)
    size = loguniform(rng, 0.1, 0.6)
    wave += moves * size * sum(np.sin(2 * np.pi * k * phase + k) / k for k in (1, 2, 3))
    wave += loguniform(rng, 0.05, 0.3) * coloured(rng, len(time), 0.5) + rng.normal() + 0.3 * time
    return Sample(signal=wave, rate_hz=rate, truth="stable", spindle_hz=spindle, tools=teeth,
                  told=_told(rng, spindle, teeth))  # fmt: skip


def unfiltered(rng):
    """Short impacts sampled without a filter: harmonics above half the rate appear where they are not."""
    rate = float(rng.choice([1600, 2500, 4000, 5000]))
    time = seconds(rng.uniform(2.0, 6.0), rate)
    teeth = int(rng.integers(1, 5))
    spindle = loguniform(rng, 40.0, 0.12 * rate) / teeth
    angle, steep = (time * spindle * teeth) % 1.0, rng.uniform(0.05, 0.3)
    wave = np.where(angle < steep, np.sin(np.pi * angle / steep), 0.0)
    if rng.random() < 0.5:
        wave = wave * gate(time, 0.2 * time[-1], 0.9 * time[-1], 0.05)
    wave = wave / rms(wave) + loguniform(rng, 0.02, 0.3) * coloured(rng, len(time), rng.uniform(0.0, 1.0))
    return Sample(signal=wave, rate_hz=rate, truth="stable", spindle_hz=spindle, tools=teeth,
                  told=_told(rng, spindle, teeth))  # fmt: skip
