"""Linear stability: limits of theory, root counting as the independent judge, and published or printed numbers."""

import math
from functools import partial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import lambertw

from pitch import (
    OneModeProcess,
    StabilityUnresolved,
    critical_stiffness,
    pitch_difference_for_phase,
    rightmost_root,
    roots,
)
from pitch.collocation import delay_eigenvalues
from tests.reference.pitch_stability import characteristic, count_roots

BAR = OneModeProcess(0.188, 421.0, 0.12, 0.859, 33.0)
PROCESSES = st.builds(
    OneModeProcess,
    modal_mass=st.floats(0.05, 20.0),
    natural_frequency_hz=st.floats(100.0, 600.0),
    damping_ratio=st.floats(0.005, 0.15),
    overlap=st.one_of(st.sampled_from([-1.0, 1.0]), st.floats(0.2, 1.0), st.floats(-1.0, -0.2)),
    process_damping=st.sampled_from([0.0, 20.0]),
)
SPINDLES = st.floats(20.0, 60.0)
DIFFERENCES = st.one_of(st.just(0.0), st.floats(-0.6, 0.6))


def growth_judge(process, stiffness, spindle_hz, difference):
    return partial(
        characteristic,
        mass=process.modal_mass,
        natural_hz=process.natural_frequency_hz,
        zeta=process.damping_ratio,
        overlap=process.overlap,
        flank=process.process_damping,
        stiffness=stiffness,
        spindle_hz=spindle_hz,
        pitch_difference=difference,
    )


@settings(max_examples=30)
@given(PROCESSES, SPINDLES, DIFFERENCES, st.floats(0.0, 2.0))
def test_no_root_lies_right_of_the_rightmost(process, spindle, difference, share):
    stiffness = share * process.modal_mass * (2 * math.pi * process.natural_frequency_hz) ** 2
    root = rightmost_root(process, stiffness, spindle, difference)
    judge = growth_judge(process, stiffness, spindle, difference)
    assert abs(judge(root)) < 1e-9 * process.modal_mass * abs(root) ** 2
    top = 6 * 2 * math.pi * process.natural_frequency_hz
    margin = 1e-3 * (1 + abs(root.real))
    assert count_roots(judge, root.real + margin, root.real + 3000.0, top) == 0
    assert count_roots(judge, root.real - margin, root.real + 3000.0, top) >= 1


@settings(max_examples=40)
@given(PROCESSES, SPINDLES, DIFFERENCES)
def test_the_border_is_where_the_root_crosses(process, spindle, difference):
    stiffness, hertz = critical_stiffness(process, spindle, difference)
    on_it = growth_judge(process, stiffness, spindle, difference)(2j * math.pi * hertz)
    assert abs(on_it) < 1e-8 * process.modal_mass * (2 * math.pi * hertz) ** 2
    assert rightmost_root(process, 0.999 * stiffness, spindle, difference).real < 0.0
    assert rightmost_root(process, 1.001 * stiffness, spindle, difference).real > 0.0


@settings(max_examples=15)
@given(PROCESSES, SPINDLES, DIFFERENCES, st.floats(0.01, 0.99))
def test_below_the_smallest_stiffness_nothing_is_unstable(process, spindle, difference, share):
    stiffness = share * critical_stiffness(process, spindle, difference)[0]
    judge = growth_judge(process, stiffness, spindle, difference)
    assert count_roots(judge, 0.0, 5000.0, 8 * 2 * math.pi * process.natural_frequency_hz) == 0


@settings(max_examples=25)
@given(PROCESSES, SPINDLES, DIFFERENCES, st.floats(0.1, 10.0))
def test_units_and_direction_do_not_matter(process, spindle, difference, scale):
    stiffness, hertz = critical_stiffness(process, spindle, difference)
    heavier = OneModeProcess(
        scale * process.modal_mass,
        process.natural_frequency_hz,
        process.damping_ratio,
        process.overlap,
        scale * process.process_damping,
    )
    assert critical_stiffness(heavier, spindle, difference) == pytest.approx((scale * stiffness, hertz), rel=1e-6)
    assert critical_stiffness(process, spindle, -difference) == pytest.approx((stiffness, hertz), rel=1e-6)


@settings(max_examples=10)
@given(st.floats(20.0, 80.0), st.floats(0.005, 0.1))
def test_one_side_at_equal_pitch_is_one_tool_at_twice_the_speed(spindle, zeta):
    """The classical lobes: frequency and stiffness of the nearest lobe satisfy the closed form of one tool."""
    process = OneModeProcess(2.0, 250.0, zeta, overlap=-1.0)
    stiffness, hertz = critical_stiffness(process, spindle, 0.0)
    w, k = 2 * math.pi * hertz, 2.0 * (2 * math.pi * 250.0) ** 2
    receptance = 1 / (k - 2.0 * w**2 + 2j * zeta * math.sqrt(2.0 * k) * w)
    assert 2 * stiffness == pytest.approx(-1 / (2 * receptance.real), rel=1e-9)
    waves = hertz / (2 * spindle) % 1.0
    assert waves == pytest.approx(((3 * math.pi + 2 * np.angle(receptance)) / (2 * math.pi)) % 1.0, abs=1e-9)
    assert stiffness >= k * zeta * (1 + zeta) * (1 - 1e-9)


def test_the_deepest_point_of_the_lobes_is_the_closed_form():
    """Section 2 mode: 250 Hz, zeta 0.012, k 2.26e8/cos^2(30 deg) N/m; minima at half the speeds of one tool."""
    process = OneModeProcess(3.013333e8 / (2 * math.pi * 250) ** 2, 250.0, 0.012, overlap=-1.0)
    for speed in (20187.46, 8664.27, 5515.80, 4045.66, 3194.29):
        stiffness, hertz = critical_stiffness(process, speed / 120, 0.0)
        assert stiffness == pytest.approx(3.659392e6, rel=1e-5)
        assert hertz == pytest.approx(252.982, rel=1e-5)


SAME_SIDE = {
    1000: (4.332, 101.70, 12.217, 17.267, 6.471, 15.823, 24.959, 21.201),
    2000: (3.745, 4.846, 102.87, 17.936, 13.186, 19.826, 6.960, 16.752),
    3000: (6.556, 7.118, 9.486, 27.917, 46.727, 34.744, 48.745, 8.755),
    4000: (5.439, 5.827, 7.396, 15.032, 86.355, 20.311, 14.833, 25.097),
}
OPPOSED = {
    1000: (11.848, 29.749, 4.749, 6.291, 13.423, 12.937, 20.234, 4.556),
    2000: (12.810, 14.938, 81.468, 10.570, 4.297, 5.884, 14.405, 34.282),
    3000: (34.740, 37.403, 47.666, 117.459, 16.646, 7.031, 7.218, 34.756),
    4000: (14.460, 15.046, 17.086, 22.043, 104.947, 64.252, 6.443, 9.518),
}


@pytest.mark.parametrize(("overlap", "table"), [(-1.0, SAME_SIDE), (1.0, OPPOSED)])
def test_two_tools_on_one_mode(overlap, table):
    """Limits (mm at 1e9 N/m^2) against pitch angle and speed, computed by others with piecewise collocation."""
    process = OneModeProcess(3.01333e8 / (2 * math.pi * 250) ** 2, 250.0, 0.012, overlap)
    for speed, row in table.items():
        for angle, want in zip((180, 175, 170, 165, 160, 150, 140, 120), row, strict=True):
            stiffness, _ = critical_stiffness(process, speed / 60, 2 * math.radians(180 - angle))
            assert stiffness / 1e6 == pytest.approx(want, rel=5e-4)


@pytest.mark.parametrize(
    ("degrees", "critical", "border_hz", "growth", "root_hz"),
    [(0.0, 51190.68, 446.0858, 77.9327, 653.508), (5.52, 90073.41, None, -10.32337, None)],
)
def test_undamped_flank(degrees, critical, border_hz, growth, root_hz):
    process = OneModeProcess(0.188, 421.0, 0.03)
    stiffness, hertz = critical_stiffness(process, 20.0, math.radians(degrees))
    root = rightmost_root(process, 1e6, 20.0, math.radians(degrees))
    assert stiffness == pytest.approx(critical, rel=1e-7)
    assert root.real == pytest.approx(growth, rel=1e-6)
    if border_hz is not None:
        assert (hertz, root.imag / 2 / math.pi) == pytest.approx((border_hz, root_hz), rel=1e-6)


def test_the_thesis_bar_hesitates_between_two_lines():
    found = roots(BAR, 1.06e6, 20.0, 0.0)
    assert found[:2].real == pytest.approx([30.2, 30.2], abs=0.1)
    assert found[:2].imag / 2 / math.pi == pytest.approx([652.2, 689.4], abs=0.1)
    assert np.diff(np.sort(found.imag / 2 / math.pi)) == pytest.approx(38.0, abs=1.0)


def test_the_wrong_sign_moves_the_line():
    wrong = OneModeProcess(0.188, 421.0, 0.12, -0.859, 33.0)
    assert abs(rightmost_root(wrong, 1.06e6, 20.0, 0.0).imag / 2 / math.pi - 652.2) > 10.0


@pytest.mark.parametrize(("phase_pi", "stable"), [(0.5, False), (0.6, False), (0.8, True), (0.9, True), (1.0, True)])
def test_the_stable_band_of_phases(phase_pi, stable):
    difference = pitch_difference_for_phase(652.0, 20.0, phase_pi * math.pi)
    assert (rightmost_root(BAR, 1.06e6, 20.0, difference).real < 0.0) is stable


def test_more_stiffness_can_stabilise():
    process = OneModeProcess(0.188, 421.0, 0.03)
    signs = [rightmost_root(process, K, 20.0, math.radians(5.52)).real > 0 for K in np.geomspace(5e4, 2e6, 40)]
    assert np.count_nonzero(np.diff(signs)) >= 2


def test_without_regeneration_or_without_cutting_it_is_the_bar_alone():
    assert critical_stiffness(OneModeProcess(1.0, 100.0, 0.05, overlap=0.0), 20.0, 0.0)[0] == math.inf
    root = rightmost_root(OneModeProcess(1.0, 100.0, 0.05), 0.0, 20.0, 0.1)
    assert root == pytest.approx(2 * math.pi * 100 * (-0.05 + 1j * math.sqrt(1 - 0.05**2)), rel=1e-12)


def test_hayes():
    """x' = -x - x(t - 1): the rightmost root is -1 + W(-e)."""
    one = np.array([[-1.0]])
    found = delay_eigenvalues(one, [(one, 1.0)], 20)
    root = found[np.argmax(found.real)]
    assert complex(root.real, abs(root.imag)) == pytest.approx(-1 + lambertw(-math.e), rel=1e-12)
    assert abs(np.exp(root)) == pytest.approx(0.54606300, rel=1e-8)


def test_only_the_past_that_is_read_matters():
    """An oscillator with delayed position alone, and with a vanishing delayed speed, have the same roots."""
    present, back = np.array([[0.0, 1.0], [-4.0, -0.3]]), np.array([[0.0, 0.0], [1.5, 0.0]])
    with_speed = [(back, 1.3), (np.array([[0.0, 0.0], [0.0, 1e-13]]), 0.9)]
    lean, full = (delay_eigenvalues(present, delayed, 24) for delayed in ([(back, 1.3)], with_speed))
    assert len(lean) == 26
    assert len(full) == 50
    assert lean.real.max() == pytest.approx(full.real.max(), rel=1e-9)


def test_collocation_reads_a_delay_that_is_a_node_and_one_that_is_not():
    """Splitting one delayed term in two changes nothing; the middle of the delay is a Chebyshev point."""
    a, b = np.array([[-0.3]]), np.array([[-1.2]])
    for delay in (1.0, 0.77):
        whole = delay_eigenvalues(a, [(b, delay), (0 * b, 2.0)], 30).real.max()
        assert whole == pytest.approx(delay_eigenvalues(a, [(b, delay)], 30).real.max(), abs=1e-9)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: OneModeProcess(0.0, 421, 0.03), "modal_mass must be > 0, got 0.0"),
        (lambda: OneModeProcess(0.1, 421, 1.3), "damping_ratio must be in \\(0, 1\\), got 1.3"),
        (lambda: OneModeProcess(0.1, 421, 0.03, 1.5), "overlap must be in \\[-1, 1\\], got 1.5"),
        (lambda: OneModeProcess(0.1, 421, 0.03, 1.0, -1.0), "process_damping must be >= 0, got -1.0"),
        (lambda: critical_stiffness(BAR, math.nan, 0.0), "spindle_hz must be finite, got nan"),
        (lambda: critical_stiffness(BAR, 20.0, 7.0), "pitch_difference must be in"),
        (lambda: rightmost_root(BAR, -1.0, 20.0, 0.0), "cutting_stiffness must be >= 0, got -1.0"),
    ],
)
def test_bad_arguments_name_value_and_rule(call, message):
    with pytest.raises(ValueError, match=message):
        call()


def test_too_slow_a_spindle_is_refused():
    with pytest.raises(StabilityUnresolved, match="waves in one delay"):
        rightmost_root(BAR, 1e6, 0.5, 0.0)
