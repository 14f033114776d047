"""What the thesis measured, on the surface map with both directions: sheet of the plant, section 6."""

import math

import numpy as np
import pytest
from scipy.signal import butter, sosfilt

from tests.turning_sim.cases import roughness, run, simulator, smooth_step, strongest_line_hz
from turning_sim import ProcessModel

MAP = ProcessModel(cut="surface", directions=2)


def band(signal, low_hz, high_hz):
    return sosfilt(butter(2, [low_hz, high_hz], "bandpass", fs=9000.0, output="sos"), signal)


def lines_hz(signal):
    """Strongest line of each half second."""
    return np.array(
        [strongest_line_hz(signal[i : i + 4500], 9000.0, 490.0, 760.0) for i in range(0, signal.size, 4500)]
    )


def test_frequency_hops_along_the_pass():
    """Plateaus near 650, 609, 570 and 530 Hz in falling order; mean Ra 5.5...6.5 um; y about 1.4 times x."""
    sim = simulator(model=MAP, cut_changes={"force_noise": 0.1}, air_time=0.0, start_position=0.0, seed=2)
    out = run(sim, 19.0, block=9000)
    found = lines_hz(out["vibration"])[1:]
    for plateau_hz in (650.0, 609.0, 570.0, 530.0):
        assert np.count_nonzero(np.abs(found - plateau_hz) < 6.0) >= 3
    assert (np.diff(found) < 6.0).all()
    assert np.count_nonzero(np.abs(np.diff(found)) > 20.0) == 3
    chatter = slice(4500, 16 * 9000)
    x, y = (band(out[name], 490.0, 815.0)[chatter].std() for name in ("bar_displacement", "bar_displacement_y"))
    assert y / x == pytest.approx(1.4, abs=0.06)
    ra = roughness(sim, out, 2e-3, 46e-3)
    assert 5.5e-6 < ra < 6.5e-6
    # the map holds the finished surface itself; the trace of the tips says the same
    assert sim.finished.roughness(2e-3, 46e-3) == pytest.approx(ra, rel=0.02)


def test_antiphase_is_quiet_over_the_pass():
    shift = math.radians(2.76)
    sim = simulator(
        model=MAP, cut_changes={"force_noise": 0.1}, air_time=0.0, start_position=0.0, initial_shift=shift
    )  # fmt: skip
    out = run(sim, 10.0, shift, block=9000)
    assert 2e-6 < out["vibration"][4500:].std() < 4e-6
    assert np.abs(band(out["vibration"], 490.0, 815.0)[4500:]).max() < 12e-6
    assert 1.4e-6 < sim.finished.roughness(2e-3, 28e-3) < 2e-6


def test_thin_bar_and_its_shift():
    """d = 22.1 mm: limit cycle at 725...740 Hz; 2.44 deg ends it within 0.15 s of the end of the move."""
    path = smooth_step(22500, 11250, 1800, math.radians(2.439024))
    out = run(simulator(bar_changes={"turned_diameter": 22.1e-3}, model=MAP), 2.5, path, block=2250)
    assert 725.0 < strongest_line_hz(out["vibration"][4500:11250], 9000.0, 500.0, 900.0) < 740.0
    chatter = band(out["vibration"], 550.0, 915.0)
    assert chatter[7500:11250].std() > 10e-6
    assert np.abs(chatter[13050 + 1350 :]).max() < 3.75e-6


def test_setting_difference_makes_the_quiet_surface():
    """Without vibration: 8 um between the tools roughen the surface on the map."""
    found = []
    for difference in (0.0, 8e-6):
        sim = simulator(
            model=MAP, air_time=0.0, start_position=0.0, initial_shift=math.radians(2.76),
            cut_changes={"force_noise": 0.0, "setting_difference": difference, "rake_gain": 0.0},
        )  # fmt: skip
        run(sim, 1.2, math.radians(2.76), block=2700)
        found.append(sim.finished.roughness(1e-3, 2.6e-3))
    # the bar gives way to the deeper tool, so the pattern is between that of both tools and that of one alone
    both, one = (feed**2 / (18.0 * math.sqrt(3.0) * 0.4e-3) for feed in (0.075e-3, 0.15e-3))
    assert found[0] == pytest.approx(both, rel=0.12)
    assert 1.2 * found[0] < found[1] < one
