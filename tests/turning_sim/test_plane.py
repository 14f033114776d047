import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.reference.plant import characteristic_roots
from tests.turning_sim.cases import bar, cut, immovable, run, simulator
from tests.turning_sim.eigen import grow, theory
from turning_sim import ProcessModel, linear_parameters

PLANE = ProcessModel(directions=2)
RAKE = math.degrees(0.015)
TWO_MODES = {"damping_ratios": (0.12, 0.02)}


def hz(root):
    return root.imag / (2.0 * math.pi)


@pytest.mark.parametrize("position", [0.0, 15e-3, 30e-3, 45e-3])
def test_without_shift_the_other_direction_does_not_matter(position):
    """Opposed tools at equal pitch: the tangential force moves y, and y moves no chip."""
    one = characteristic_roots(linear_parameters(bar(), cut(), position), 20.0, 0.0)[0]
    assert theory(position).roots()[0] == pytest.approx(one, rel=1e-8)


@settings(max_examples=8)
@given(st.floats(0.2, 8.0))
def test_shift_either_way_gives_the_same_roots(degrees):
    """Isotropic bar without rake."""
    shift = math.radians(degrees)
    ahead, behind = (theory(6e-3, shift=h).roots()[:3] for h in (shift, -shift))
    assert ahead == pytest.approx(behind, rel=1e-7)


def test_with_rake_the_delays_cannot_be_exchanged():
    shift = math.radians(1.38)
    as_is, swapped = (theory(0.0, shift=shift, rake_gain=RAKE, swapped=s).roots()[0] for s in (False, True))
    assert abs(as_is.real - swapped.real) > 0.1
    assert abs(hz(as_is) - hz(swapped)) > 0.2


@pytest.mark.parametrize(
    ("position", "degrees", "rake", "which"),
    [(0.0, 0.0, 0.0, 0), (15e-3, 0.0, 0.0, 0), (0.0, 1.38, 0.0, 0), (0.0, 1.38, RAKE, 0), (0.0, -1.38, RAKE, 0)],
)
def test_growth_is_that_of_the_plane_theory(position, degrees, rake, which):
    """A delay rounded to a step (0.13 deg) or exchanged with the other would shift both beyond the tolerance."""
    linear = theory(position, shift=math.radians(degrees), rake_gain=rake)
    root, growth, frequency_hz = grow(PLANE, linear, position, which, cut_changes={"rake_gain": rake})
    assert growth == pytest.approx(root.real, rel=5e-4)
    assert frequency_hz == pytest.approx(hz(root), rel=2e-5)


def test_tolerance_finds_an_exchanged_delay_and_a_rounded_shift():
    shift = math.radians(1.38)
    true = theory(0.0, shift=shift, rake_gain=RAKE).roots()[0]
    swapped = theory(0.0, shift=shift, rake_gain=RAKE, swapped=True).roots()[0]
    step = 40.0 * math.pi / 54000.0
    rounded = theory(0.0, shift=round(shift / step) * step, rake_gain=RAKE).roots()[0]
    for wrong in (swapped, rounded):
        assert abs(wrong.real / true.real - 1.0) > 1e-3 or abs(hz(wrong) / hz(true) - 1.0) > 4e-5


def test_two_modes_in_each_direction():
    linear = theory(6e-3, bar_changes=TWO_MODES)
    root, growth, frequency_hz = grow(PLANE, linear, 6e-3, 0, bar_changes=TWO_MODES)
    assert abs(root.real - theory(6e-3).roots()[0].real) > 0.5
    assert growth == pytest.approx(root.real, rel=1e-3)
    assert frequency_hz == pytest.approx(hz(root), rel=2e-5)


def test_order_of_the_integration():
    """Second order: halving the step divides the frequency error by four."""
    errors = []
    for substeps in (2, 4, 8):
        root, _, frequency_hz = grow(PLANE, theory(0.0), 0.0, 0, substeps=substeps)
        errors.append(abs(frequency_hz - hz(root)))
    assert np.polyfit(np.log([2.0, 4.0, 8.0]), np.log(errors), 1)[0] == pytest.approx(-2.0, abs=0.3)


def test_one_direction_is_the_same_cut_without_shift():
    """Both kernels, noise and setting difference included; force and motion along X1."""
    models = (ProcessModel(directions=n) for n in (1, 2))
    one, two = (run(simulator(model=m, air_time=0.01, turret=immovable()), 0.2) for m in models)
    for name in ("bar_displacement", "force_x1", "force_y1p", "force_x2", "left1"):
        assert two[name] == pytest.approx(one[name], rel=1e-5, abs=1e-7 * np.abs(one[name]).max()), name
    assert not one["bar_displacement_y"].any()
    assert two["bar_displacement_y"].any()


TABLE_6_4 = [  # nominal phase over pi, half pitch difference (deg), diameter (mm), largest growth over 0...15 mm (1/s)
    (0.5, 1.38, 23.4, (5.0, 20.0)),
    (0.6, 1.66, 23.7, (3.0, 12.0)),
    (0.7, 1.94, 24.1, (-5.0, -0.5)),
    (0.8, 2.21, 24.5, (-20.0, -5.0)),
    (0.9, 2.49, 24.5, (-40.0, -10.0)),
    (1.1, 3.05, 22.9, (-2.0, -0.01)),
    (1.15, 3.19, 22.5, (3.0, 12.0)),
    (1.2, 3.32, 24.9, (-1.0, 1.0)),
]


def largest_growth(degrees, diameter, **changes):
    given = {"shift": math.radians(degrees), "rake_gain": RAKE, "bar_changes": {"turned_diameter": 1e-3 * diameter}}
    return max(theory(s, **(given | changes)).roots()[0].real for s in (0.0, 7.5e-3, 15e-3))


@pytest.mark.parametrize(("phase", "degrees", "diameter", "growth"), TABLE_6_4)
def test_phase_differences_of_the_thesis(phase, degrees, diameter, growth):
    """Fig. 6-19: 0.7 and 1.1 pi are barely stable, 1.2 pi is neutral, each at its diameter of Table 6-4."""
    assert growth[0] < largest_growth(degrees, diameter) < growth[1], phase


def test_a_wrong_sign_of_the_wave_breaks_the_stable_band():
    """Tools on one side of the bar: the band lies elsewhere, and 0.5 pi is as quiet as 0.9 pi is here."""
    wrong = {"overlap": -0.859, "tangential_overlap": -0.859}
    signs = [largest_growth(deg, d, **wrong) > 0.0 for _, deg, d, _ in TABLE_6_4]
    assert signs != [low > 0.0 for *_, (low, _) in TABLE_6_4]
    hops = [hz(theory(s, **wrong).roots()[0]) for s in (0.0, 15e-3)]
    assert min(abs(f - e) for f, e in zip(hops, (652.2, 612.1), strict=True)) > 5.0
