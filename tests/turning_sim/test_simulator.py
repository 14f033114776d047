import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import least_squares
from scipy.signal import butter, sosfilt

from tests.reference.plant import characteristic_roots
from tests.turning_sim.cases import cut, immovable, roughness, run, simulator, smooth_step, strongest_line_hz
from turning_sim import SimulationDiverged, slides_of_shift

LINEAR = {"force_noise": 0.0, "setting_difference": 0.0, "rake_gain": 0.0, "flank_factor": 0.0}


def band(signal, low_hz, high_hz):
    return sosfilt(butter(2, [low_hz, high_hz], "bandpass", fs=9000.0, output="sos"), signal)


def same(a, b):
    return all(np.array_equal(a[name], b[name]) for name in a)


@settings(max_examples=10)
@given(st.lists(st.integers(1, 400), min_size=1, max_size=6))
def test_any_cutting_of_the_stream_gives_the_same(lengths):
    whole, parts = simulator(air_time=0.01), simulator(air_time=0.01)
    count = sum(lengths)
    path = smooth_step(count, 20, 300, 0.02)
    x, y = slides_of_shift(path, 25e-3, math.pi / 4.0)
    one = whole.advance(x, y)
    ends = np.cumsum([0, *lengths])
    many = [parts.advance(x[a:b], y[a:b]) for a, b in zip(ends[:-1], ends[1:], strict=True)]
    for name in ("vibration", "x1_stage_position", "y1_thrust", "spindle_angle"):
        assert np.array_equal(np.concatenate([getattr(b, name) for b in many]), getattr(one, name))
    assert [b.first_sample for b in many] == list(ends[:-1])


def test_snapshot_brings_everything_back():
    sim = simulator()
    sim.prepare()
    assert sim.sample == 0
    run(sim, 0.3)
    kept = sim.snapshot()
    first = run(sim, 1.0)
    sim.restore(kept)
    assert same(first, run(sim, 1.0))
    fresh = simulator()
    assert same(run(fresh, 0.3), run(simulator(), 0.3))


def test_twin_is_identical_until_the_shift():
    path = smooth_step(4500, 3000, 900, math.radians(2.76))
    moved, held = run(simulator(), 0.5, path), run(simulator(), 0.5)
    assert np.array_equal(moved["vibration"][:3000], held["vibration"][:3000])
    assert not np.array_equal(moved["vibration"][3100:], held["vibration"][3100:])


def grow(position, shift, which, overlap=0.859, substeps=6):
    """Start on an eigenfunction of the linear process; return (root, growth, frequency) fitted to the motion."""
    sim = simulator(
        cut_changes=LINEAR | {"overlap": overlap}, turret=immovable(), air_time=0.0, start_position=position,
        initial_shift=shift, substeps=substeps,
    )  # fmt: skip
    numbers = sim.linear_parameters(position)
    root = characteristic_roots(numbers, 20.0, shift)[which]
    omega, size = 40.0 * math.pi, 1e-11

    def motion(time):
        return size * np.exp(root * time).real

    sim._plant = sim._plant._replace(feed=0.0)
    state, mu = sim._state, overlap
    state["left"][0] = motion((state["phase"][0] + shift) / omega)
    state["left"][1] = -motion(state["phase"][1] / omega)
    state["bar"][0] = np.array([size, size * root.real]) / numbers.shape
    dynamic = [
        sign * (numbers.cutting_stiffness * (size + mu * motion(delay)) + numbers.process_damping * size * root.real)
        for sign, delay in ((1.0, -(math.pi + shift) / omega), (-1.0, -(math.pi - shift) / omega))
    ]
    state["f"][2:4] = cut().steady_forces[0] + np.array(dynamic)
    moved = -run(sim, 0.4, shift)["bar_displacement"][180:]
    time = np.arange(180, 3600) / 9000.0
    weight = np.exp(-root.real * time) / size

    def misfit(change):
        e = np.exp((root + complex(*change)) * time)
        shape = np.stack([e.real, e.imag], axis=1) * weight[:, None]
        return shape @ np.linalg.lstsq(shape, moved * weight, rcond=None)[0] - moved * weight

    found = root + complex(*least_squares(misfit, [0.0, 0.0], xtol=1e-12).x)
    return root, found.real, found.imag / (2.0 * math.pi)


@pytest.mark.parametrize(
    ("position", "degrees", "which"),
    [(0.0, 0.0, 0), (0.0, 0.0, 1), (6e-3, 0.0, 0), (15e-3, 0.0, 0), (0.0, 1.38, 0), (0.0, -1.38, 0)],
)
def test_growth_is_that_of_the_characteristic_root(position, degrees, which):
    """Time domain against frequency domain; the shift is exact because half a wave is 0.04 rad and cells are 0.002."""
    root, growth, frequency_hz = grow(position, math.radians(degrees), which)
    assert growth == pytest.approx(root.real, rel=1e-3)
    assert frequency_hz == pytest.approx(root.imag / (2.0 * math.pi), rel=2e-5)


def test_growth_without_regeneration_is_wrong():
    """The wrong sign of the overlap follows its own roots, none of them near 652 Hz."""
    root, growth, _ = grow(0.0, 0.0, 0, overlap=-0.859)
    assert growth == pytest.approx(root.real, rel=2e-3)
    assert abs(root.imag / (2.0 * math.pi) - 652.2) > 10.0


def test_order_of_the_integration():
    """Second order: halving the step divides the frequency error by four."""
    errors = []
    for substeps in (2, 4, 8):
        root, _, frequency_hz = grow(0.0, 0.0, 0, substeps=substeps)
        errors.append(abs(frequency_hz - root.imag / (2.0 * math.pi)))
    slope = np.polyfit(np.log([2.0, 4.0, 8.0]), np.log(errors), 1)[0]
    assert slope == pytest.approx(-2.0, abs=0.3)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_equal_pitch_chatters(seed):
    """Case thesis-652: one of the three strongest lines, and a surface that shows it."""
    sim = simulator(seed=seed)
    out = run(sim, 0.1 + 8.0 / 3.0)
    line = strongest_line_hz(out["vibration"][-9000:], 9000.0, 500.0, 800.0)
    assert min(abs(line - f) for f in (612.0, 651.0, 689.0)) < 8.0
    assert 4e-6 < roughness(sim, out, 8e-3, 13.5e-3) < 9e-6
    late = band(out["vibration"], 490.0, 815.0)[-9000:].std()
    assert 20e-6 < late < 50e-6


def test_a_tenth_of_the_stiffness_is_quiet():
    sim = simulator(cut_changes={"cutting_stiffness": 1.06e5})
    out = run(sim, 3.0)
    assert np.abs(band(out["vibration"], 490.0, 815.0)[2700:]).max() < 2e-6
    assert out["contact1"][1000:].all()


def test_antiphase_is_quiet_over_the_pass():
    shift = math.radians(2.76)
    sim = simulator(initial_shift=shift)
    out = run(sim, 5.1, shift)
    quiet = band(out["vibration"], 490.0, 815.0)[1800:]
    assert np.abs(quiet).max() < 3e-6
    assert 0.2e-6 < quiet.std() < 0.8e-6
    assert 0.5e-6 < roughness(sim, out, 8e-3, 20e-3) < 2.5e-6


def test_thin_bar_and_its_shift():
    """d = 22.1 mm: limit cycle at 730 Hz; 2.44 deg ends it within 0.15 s of the end of the move."""
    path = smooth_step(27000, 13500, 1800, math.radians(2.439024))
    out = run(simulator(bar_changes={"turned_diameter": 22.1e-3}), 3.0, path)
    before, after = out["vibration"][4500:13500], out["vibration"][15300 + 1350 :]
    assert strongest_line_hz(before, 9000.0, 500.0, 900.0) == pytest.approx(730.0, abs=3.0)
    assert band(before, 550.0, 915.0)[4500:].std() > 15e-6
    assert np.abs(band(after, 550.0, 915.0)[450:]).max() < 3.75e-6


def test_lost_contact_bounds_the_motion():
    """In chatter both tools leave the cut at times, and then there is no force."""
    out = run(simulator(cut_changes={"force_noise": 0.0}), 2.0)
    free = ~out["contact2"]
    assert free[-9000:].any()
    assert not out["contact1"][-9000:].all()
    assert np.abs(out["force_x2"][free]).max() == 0.0
    assert out["force_x2"].min() >= 0.0
    assert np.abs(out["vibration"][-9000:]).max() < 100e-6


def test_surface_follows_a_varying_spindle():
    """The delay is an angle: what one tool leaves at a phase, the other meets there, at any speed."""
    sim = simulator(air_time=0.0)
    speed = 20.0 + 2.0 * np.sin(np.arange(4500) / 300.0)
    x = np.zeros(4500)
    out = sim.advance(x, x, speed)
    turned = 2.0 * np.pi * np.cumsum(speed) / 9000.0
    assert out.spindle_angle[1:] == pytest.approx(turned[:-1], rel=1e-9)
    travelled = sim.cutting.feed_per_rev * out.spindle_angle / (2.0 * np.pi)
    assert out.tool_position - 6e-3 == pytest.approx(travelled, abs=1e-12)


def test_tools_leave_at_the_end():
    sim = simulator(air_time=0.0, end_position=6.6e-3)
    out = run(sim, 0.4)
    end = int(np.argmin(out["in_cut"]))
    assert end / 9000.0 == pytest.approx(0.2, abs=2e-4)
    assert not out["in_cut"][end:].any()
    assert np.abs(out["force_x1"][end + 2 :]).max() == 0.0
    assert math.isnan(roughness(sim, out, 20e-3, 30e-3))


def test_refusals_and_divergence():
    with pytest.raises(ValueError, match=r"start_position must be in \[0, end_position\), got 0.5"):
        simulator(start_position=0.5)
    with pytest.raises(ValueError, match="overlap must be in"):
        cut(overlap=1.5)
    sim = simulator()
    with pytest.raises(ValueError, match="spindle_hz must be at least 5.0, got 1.0"):
        sim.advance(np.zeros(3), np.zeros(3), 1.0)
    with pytest.raises(ValueError, match="finite"):
        sim.advance(np.full(3, math.nan), np.zeros(3))
    wild = simulator(cut_changes={"force_noise": 1e5}, air_time=0.0)
    with pytest.raises(SimulationDiverged, match="more than a millimetre"):
        run(wild, 1.0)
