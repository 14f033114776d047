import math

import numpy as np
import pytest

from tests.reference.plant_slow import SlowPlane
from tests.turning_sim.cases import bar, cut, drives, simulator, smooth_step
from turning_sim import ProcessModel, linear_parameters, slides_of_shift

COUNT = 360


@pytest.mark.parametrize(
    ("mapped", "steady", "speed", "close"),
    [(False, False, 0.0, 1e-10), (False, False, 0.8, 5e-9), (True, False, 0.0, 1e-9), (True, True, 1.2, 1e-7)],
)
def test_kernels_against_the_slow_plane(mapped, steady, speed, close):
    """Most of a turn in cut with turret 1 on the move; struck at the start, the tools leave the cut for a while."""
    noise, depth = (0.1, 0.2e-3) if speed == 0.0 else (0.0, 0.1e-3)
    changes = {"force_noise": noise, "depth_of_cut": depth}
    fine = drives(motor_resolution=1e-13, stage_resolution=1e-13)
    model = ProcessModel(
        cut="surface" if mapped else "linear", directions=2, thrust_direction="steady" if steady else "live", cell=1e-6
    )
    first = math.radians(1.0)
    sim = simulator(
        turret=fine, cut_changes=changes, start_position=6e-3, air_time=0.0, initial_shift=first, seed=3, model=model
    )
    shift = first + smooth_step(COUNT, 20, 300, math.radians(2.0))
    refs = np.array(slides_of_shift(shift, sim.diameter, math.pi / 4.0))
    sim._table = np.repeat(sim.workpiece.table(np.array([6e-3])), sim._table.shape[0], axis=0)
    drawn = np.random.Generator(np.random.Philox(key=[3, 0])).standard_normal((COUNT * 6, 2))
    slow = SlowPlane(
        mapped=mapped, steady=steady, parameters=linear_parameters(bar(), cut(), 6e-3), cutting=cut(**changes),
        drives=fine, diameter=25e-3, rate=9000.0, substeps=6, shift=first, noise=drawn * noise * math.sqrt(27000.0),
    )  # fmt: skip
    sim._state["bar"][0, 1] = slow.bar[1] = speed
    fast = sim.advance(*refs)
    vibration, force_x, force_y, force_2, *readings = slow.run(refs)
    assert (fast.contact1 & fast.contact2)[6:].all() == (speed == 0.0)
    assert fast.vibration == pytest.approx(vibration, abs=close)
    assert fast.force_x1 == pytest.approx(force_x, abs=1e7 * close)
    assert fast.force_y1p == pytest.approx(force_y, abs=1e7 * close)
    assert fast.force_x2 == pytest.approx(force_2, abs=1e7 * close)
    names = [f"{axis}_{what}_position" for axis in ("x1", "y1") for what in ("motor", "stage")]
    for name, reading in zip(names, (readings[1], readings[2], readings[4], readings[5]), strict=True):
        assert getattr(fast, name) == pytest.approx(reading, abs=1e-1 * close), name
