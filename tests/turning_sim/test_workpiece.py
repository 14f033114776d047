import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.reference.plant import characteristic_roots
from tests.turning_sim.cases import bar, cut
from turning_sim import Chuck, Workpiece, cantilever_frequency_hz, linear_parameters

RIGID = Chuck(lateral_stiffness=1e10, tilt_stiffness=1e7)


@pytest.mark.parametrize(("diameter", "length", "printed"), [(24.9e-3, 0.18, 533.0), (22.1e-3, 0.16, 599.0)])
def test_cantilever_frequency_is_the_printed_one(diameter, length, printed):
    """Eq. (6-11) for the bars of Tables 6-3 and 6-5."""
    assert cantilever_frequency_hz(diameter, length) == pytest.approx(printed, abs=0.5)


@settings(max_examples=10)
@given(st.floats(5e-3, 15e-3), st.integers(1, 2))
def test_slender_bar_in_a_rigid_chuck_is_the_cantilever(diameter, mode):
    length = 100.0 * diameter
    slender = Workpiece(diameter=diameter, length=length, chuck=RIGID, damping_ratios=(0.01,) * mode)
    expected = cantilever_frequency_hz(diameter, length, mode)
    assert slender.modes(0.0)[-1].natural_frequency_hz == pytest.approx(expected, rel=1e-3)


def test_slender_cantilever_carries_a_quarter_of_its_mass_at_the_tip():
    slender = Workpiece(diameter=5e-3, length=0.5, chuck=RIGID)
    mass = 7930.0 * math.pi * 5e-3**2 / 4.0 * 0.5
    assert slender.modes(0.0)[0].modal_mass == pytest.approx(0.25 * mass, rel=1e-3)


@pytest.mark.parametrize(
    ("position", "expected_hz", "growth"),
    [(0.0, 652.2, 30.2), (15e-3, 612.1, 27.1), (30e-3, 572.1, 22.6), (45e-3, 532.3, 16.5)],
)
def test_roots_along_the_bar(position, expected_hz, growth):
    """Frequency falls with phi^2 and hops by 40 Hz; the wrong sign of the overlap has no such root."""
    root = characteristic_roots(linear_parameters(bar(), cut(), position), 20.0, 0.0)[0]
    assert root.imag / (2.0 * math.pi) == pytest.approx(expected_hz, abs=0.06)
    assert root.real == pytest.approx(growth, abs=0.06)
    wrong = characteristic_roots(linear_parameters(bar(), cut(overlap=-0.859), position), 20.0, 0.0)
    assert min(abs(r.imag / (2.0 * math.pi) - expected_hz) for r in wrong) > 10.0


def test_second_root_at_the_tip_is_as_strong():
    second = characteristic_roots(linear_parameters(bar(), cut(), 0.0), 20.0, 0.0)[1]
    assert second.imag / (2.0 * math.pi) == pytest.approx(689.4, abs=0.06)
    assert second.real == pytest.approx(30.18, abs=0.06)


@given(st.floats(0.0, 0.15))
def test_shape_falls_from_the_tip_to_the_chuck(position):
    here, further = bar().modes(position)[0], bar().modes(position + 5e-3)[0]
    assert bar().modes(0.0)[0].shape == pytest.approx(1.0)
    assert 0.0 < further.shape < here.shape <= 1.0


def test_chuck_damping_and_the_set_without_material_damping():
    """Damping by the chuck grows as the bar gets shorter; with it the hops stay where they were."""
    chuck = Chuck(lateral_stiffness=1.80e8, tilt_stiffness=7.72e4, tilt_damping=6.6)
    condition = cut(cutting_stiffness=0.925e6, overlap=0.694, process_damping=25.0, nose_radius=0.3e-3, rake_gain=0.0)
    long, short = (bar(length=n, chuck=chuck, damping_ratios=(0.01,)) for n in (160e-3, 130e-3))
    ratio = [w.modes(0.0)[0].damping_ratio * w.modes(0.0)[0].natural_frequency_hz for w in (long, short)]
    assert 1.8 < ratio[1] / ratio[0] < 2.2
    for position, expected_hz in ((0.0, 652.1), (15e-3, 612.3), (35e-3, 571.5), (50e-3, 532.4)):
        root = characteristic_roots(linear_parameters(long, condition, position), 20.0, 0.0)[0]
        assert root.imag / (2.0 * math.pi) == pytest.approx(expected_hz, abs=0.2)


def test_removed_stock_raises_the_frequency():
    full, thin = bar(), bar(turned_diameter=22.1e-3, turned_length=0.1)
    assert thin.modes(0.0)[0].natural_frequency_hz > 1.05 * full.modes(0.0)[0].natural_frequency_hz
    passing = bar(finished_diameter=24.6e-3)
    assert passing.modes(0.0)[0] == full.modes(0.0)[0]
    assert passing.modes(0.04)[0].modal_mass < full.modes(0.04)[0].modal_mass


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"diameter": -1.0}, "diameter must be positive, got -1.0"),
        ({"damping_ratios": (1.3,)}, r"damping_ratios must be in \(0, 1\), got 1.3"),
        ({"turned_diameter": 26e-3}, "turned_diameter must be positive and at most the diameter"),
    ],
)
def test_refusals_name_the_value(changes, message):
    with pytest.raises(ValueError, match=message):
        bar(**changes)
