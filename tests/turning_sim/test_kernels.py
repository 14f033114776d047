import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import expm

from tests.reference.plant import SlowPlant
from tests.turning_sim.cases import bar, cut, drives, simulator, smooth_step
from turning_sim import linear_parameters, slides_of_shift
from turning_sim._kernels import modal_step, quantise


@given(st.floats(-1e-3, 1e-3), st.sampled_from([1e-9, 37.5e-9, 66.7e-9]))
def test_encoder_readings_are_the_nearest_count(position, step):
    reading = quantise(position, step)
    assert abs(reading - position) <= 0.5000001 * step
    assert reading / step == pytest.approx(round(reading / step), abs=1e-6)
    assert quantise(position, 0.0) == position


@given(st.floats(500.0, 1e4), st.floats(0.001, 0.9), st.lists(st.floats(-1.0, 1.0), min_size=4, max_size=4))
def test_modal_step_is_exact(omega, zeta, values):
    """Against the matrix exponential of the mode with a linear force; cancellation costs 1e-16/(omega h)^3."""
    h, out = 1.0 / 54000.0, np.empty((2, 4))
    modal_step(omega, zeta, h, out)
    big = np.zeros((4, 4))
    big[0, 1], big[1, :3], big[2, 3] = 1.0, [-(omega**2), -2.0 * zeta * omega, 1.0], 1.0
    x, v, force, end = values
    exact = expm(big * h) @ [x, v / h, force / h**2, (end - force) / h**3]
    assert out @ [x, v / h, force / h**2, end / h**2] == pytest.approx(exact[:2], rel=1e-8, abs=1e-9)


@pytest.mark.parametrize(("first", "height", "noise", "close"), [(0.0, 2.5, 0.02, 1e-10), (2.0, -3.0, 0.3, 2e-9)])
def test_kernel_against_the_slow_plant(first, height, noise, close):
    """More than a turn in cut with the turret on the move, and in the second case with contact lost and found.

    Fine encoders, because a count that falls the other way by rounding would be no error.
    There the three corrector passes of the kernel and the twelve here differ where a chip begins or ends.
    """
    changes = {"feed_per_rev": 0.15e-3, "force_noise": noise}
    fine = drives(motor_resolution=1e-13, stage_resolution=1e-13)
    sim = simulator(
        turret=fine, cut_changes=changes, start_position=6e-3, air_time=0.0, initial_shift=math.radians(first), seed=3
    )
    count = 630
    shift = math.radians(first) + smooth_step(count, 40, 450, math.radians(height))
    refs = np.array(slides_of_shift(shift, sim.diameter, math.pi / 4.0))
    sim._plant = sim._plant._replace(feed=0.0)
    drawn = np.random.Generator(np.random.Philox(key=[3, 0])).standard_normal((count * 6, 2))
    slow = SlowPlant(
        parameters=linear_parameters(bar(), cut(), 6e-3), cutting=cut(**changes), drives=fine, diameter=25e-3,
        rate=9000.0, substeps=6, shift=math.radians(first), noise=drawn * noise * math.sqrt(27000.0),
    )  # fmt: skip
    fast = sim.advance(*refs)
    assert fast.contact1[6:].all() == (noise < 0.1)
    vibration, force_x, force_y, force_2, *readings = slow.run(refs)
    assert fast.vibration == pytest.approx(vibration, abs=close)
    assert fast.force_x1 == pytest.approx(force_x, abs=1e7 * close)
    assert fast.force_y1p == pytest.approx(force_y, abs=1e7 * close)
    assert fast.force_x2 == pytest.approx(force_2, abs=1e7 * close)
    names = [f"{axis}_{what}" for axis in ("x1", "y1") for what in ("thrust", "motor_position", "stage_position")]
    for name, reading in zip(names, readings, strict=True):
        tolerance = 1e7 * close if name.endswith("thrust") else 1e-2 * close
        assert getattr(fast, name) == pytest.approx(reading, abs=tolerance), name
