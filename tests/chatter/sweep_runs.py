"""Swept sines on simulated axes: the position loop open, the sweep on a constant feed."""

from dataclasses import replace

import numpy as np

from services.drives import load_drive
from turning_sim import ServoAxis

FEED, AMPLITUDE = 0.0471, 0.01


def swept(name, *, encoders="machine-b", seconds=0.5, periods=6, top_hz=1000.0, real=True):
    """Thrust (N), motor and stage (m), rate (Hz), samples of a period, and the drive as it is."""
    named = load_drive(name)
    drive = named.drive if real else named.drive.ideal()
    if encoders and real:
        other = load_drive(encoders).drive
        names = ("motor_resolution", "stage_resolution", "motor_error", "stage_error", "motor_noise", "stage_noise")
        drive = replace(drive, **{field: getattr(other, field) for field in names})
    rate = named.settings.sample_rate_hz
    period = round(seconds * rate)
    t = np.arange((periods + 1) * period + 1) / rate
    inner = t % seconds
    speed = FEED + AMPLITUDE * np.sin(2 * np.pi * (1.0 * inner + 0.5 * (top_hz - 1.0) / seconds * inner**2))
    axis = ServoAxis(drive, replace(named.control, position_gain=0.0, disturbance_bandwidth=0.0), rate, seed=1)
    command = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1])) / rate])
    block = axis.advance(command, np.zeros(command.size * axis.substeps))
    rest = slice(period, None)
    return block.thrust[rest], block.motor_position[rest], block.stage_position[rest], rate, period, drive
