"""The bar, the cut and the drives that the tests of the plant share."""

import dataclasses
import math

import numpy as np

from turning_sim import (
    AxisControl,
    Chuck,
    Cutting,
    FeedDrive,
    Simulator,
    SurfaceTrace,
    TurretDrives,
    Workpiece,
    finished_roughness,
    slides_of_shift,
)

CHUCK = Chuck(lateral_stiffness=1.43e8, tilt_stiffness=6.36e4)


def bar(**changes):
    return Workpiece(**({"diameter": 25e-3, "length": 160e-3, "chuck": CHUCK} | changes))


def cut(**changes):
    usual = {
        "spindle_hz": 20.0, "feed_per_rev": 0.15e-3, "depth_of_cut": 0.2e-3, "cutting_stiffness": 1.06e6,
        "tangential_ratio": 1.36, "overlap": 0.859, "process_damping": 33.0, "nose_radius": 0.4e-3,
        "rake_gain": math.degrees(0.015), "setting_difference": 8e-6, "force_noise": 0.02,
    }  # fmt: skip
    return Cutting(**(usual | changes))


def drives(**both):
    """NTY3 X1 and Y1; `both` goes to each axis."""
    control = AxisControl(
        position_gain=40.0, velocity_gain=160.0, disturbance_bandwidth=300.0, derivative_bandwidth=6283.0
    )
    sample = 1.0 / 9000.0
    shared = {
        "drive_stiffness": 1.5e8, "drive_damping": 2e4, "current_bandwidth": 3000.0, "thrust_delay": sample,
        "motor_delay": sample, "stage_delay": sample, "stage_resolution": 1e-9,
    } | both  # fmt: skip
    x1 = FeedDrive(
        **{"lead": 8e-3, "motor_inertia": 4e-3, "motor_damping": 3e-2, "stage_mass": 250.0, "stage_damping": 4e3,
           "motor_resolution": 66.7e-9} | shared
    )  # fmt: skip
    y1 = FeedDrive(
        **{"lead": 6e-3, "motor_inertia": 3e-3, "motor_damping": 2e-2, "stage_mass": 150.0, "stage_damping": 1.2e4,
           "motor_resolution": 37.5e-9} | shared
    )  # fmt: skip
    return TurretDrives(x1=x1, y1=y1, x1_control=control, y1_control=control, upper_mass=150.0)


def immovable():
    """Slides that no cutting force moves, so that only bar and surface are left."""
    usual = drives(motor_resolution=0.0, stage_resolution=0.0, stage_mass=1e6, motor_inertia=4e3, drive_stiffness=1e13)
    return dataclasses.replace(usual, upper_mass=0.0)


def simulator(*, bar_changes=None, cut_changes=None, turret=None, **changes):
    usual = {"start_position": 6e-3, "air_time": 0.1, "seed": 1}
    return Simulator(
        workpiece=bar(**(bar_changes or {})),
        cutting=cut(**(cut_changes or {})),
        drives=turret or drives(),
        **(usual | changes),
    )


def run(sim, seconds, shift=0.0, block=90):
    """Hold turret 1 at a shift (rad, one or one per sample) and return the signals of all blocks joined."""
    count = round(seconds * sim.sample_rate_hz)
    x, y = (np.array(np.broadcast_to(r, count)) for r in slides_of_shift(shift, sim.diameter, sim.drives.axis_angle))
    blocks = [sim.advance(x[i : i + block], y[i : i + block]) for i in range(0, count, block)]
    names = [f.name for f in dataclasses.fields(blocks[0]) if f.name not in ("first_sample", "sample_rate_hz")]
    return {name: np.concatenate([getattr(b, name) for b in blocks]) for name in names}


def roughness(sim, out, start, stop):
    """Ra of what `run` cut between two positions (m)."""
    names = ("left1", "left2", "phase1", "phase2", "tool_position")
    trace = SurfaceTrace(*(out[name][out["in_cut"]] for name in names))
    cut = sim.cutting
    return finished_roughness(trace, start, stop, nose_radius=cut.nose_radius, feed_per_rev=cut.feed_per_rev)


def smooth_step(count, start, length, height):
    """A path that rises by `height` within `length` samples, limited in jerk (three moving averages)."""
    path = np.where(np.arange(count) >= start, height, 0.0)
    part = length // 3
    for _ in range(3):
        path = np.convolve(np.concatenate([np.zeros(part - 1), path]), np.full(part, 1.0 / part), "valid")
    return path


def strongest_line_hz(signal, rate, low_hz, high_hz):
    """Frequency of the highest peak of the windowed spectrum, refined by a parabola through its logarithm."""
    power = np.abs(np.fft.rfft((signal - signal.mean()) * np.hanning(signal.size)))
    spacing = rate / signal.size
    low = round(low_hz / spacing)
    i = low + int(np.argmax(power[low : round(high_hz / spacing)]))
    a, b, c = np.log(power[i - 1 : i + 2])
    return (i + 0.5 * (a - c) / (a - 2.0 * b + c)) * spacing
