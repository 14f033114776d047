import math

import pytest

from tests.reference.plant_chip import dynamic_stiffness
from tests.turning_sim.cases import cut
from tests.turning_sim.eigen import grow, theory
from turning_sim import ForceLaw, ProcessModel, cut_derivatives

MAP = ProcessModel(cut="surface", directions=2)
STEADY = ProcessModel(cut="surface", directions=2, thrust_direction="steady")
RAKE = math.degrees(0.015)


def hz(root):
    return root.imag / (2.0 * math.pi)


def test_derivatives_of_the_steady_cut_are_those_of_the_model():
    found = cut_derivatives(cut(), MAP)
    assert found.stiffness == pytest.approx(1.06e6, rel=2e-3)
    assert found.overlap == pytest.approx(0.859, abs=1e-3)
    assert found.area_overlap == pytest.approx(0.805, abs=1e-3)


def test_set_with_a_steady_thrust_direction():
    found = cut_derivatives(cut(nose_radius=0.2e-3, force_law=ForceLaw(thrust_coefficient=6.08e9)), STEADY)
    assert found.stiffness == pytest.approx(0.925e6, rel=2e-3)
    assert found.overlap == pytest.approx(0.694, abs=2e-3)
    assert found.tangential_stiffness / found.stiffness == pytest.approx(0.837, abs=2e-3)


@pytest.mark.parametrize("model", [MAP, STEADY])
@pytest.mark.parametrize("depth", [0.1e-3, 0.2e-3, 0.3e-3])
def test_derivatives_against_brute_force(model, depth):
    condition = cut(depth_of_cut=depth)
    now, before = dynamic_stiffness(condition, model.thrust_direction == "steady")
    found = cut_derivatives(condition, model)
    assert found.stiffness == pytest.approx(now[0], rel=1e-3)
    assert found.tangential_stiffness == pytest.approx(now[1], rel=1e-3)
    assert found.overlap == pytest.approx(before[0] / now[0], abs=1e-3)
    assert found.tangential_overlap == pytest.approx(before[1] / now[1], abs=1e-3)


@pytest.mark.parametrize(
    ("model", "position", "degrees", "which"),
    [(MAP, 0.0, 0.0, 0), (MAP, 0.0, 0.0, 1), (MAP, 15e-3, 0.0, 0), (STEADY, 0.0, 0.0, 0), (MAP, 0.0, 1.38, 0)],
)
def test_small_waves_on_the_map_grow_as_in_the_linear_theory(model, position, degrees, which):
    """The theory takes its stiffness and overlap from brute force, not from the map."""
    linear = theory(
        position, shift=math.radians(degrees), mapped=True, steady=model is STEADY, rake_gain=RAKE if degrees else 0.0
    )
    changes = {"rake_gain": RAKE if degrees else 0.0}
    root, growth, frequency_hz = grow(model, linear, position, which, size=1e-8, cut_changes=changes)
    assert growth == pytest.approx(root.real, rel=5e-3 if degrees else 1e-3)
    assert frequency_hz == pytest.approx(hz(root), rel=1e-4 if degrees else 2e-5)


def test_growth_of_the_sheet():
    assert theory(0.0, mapped=True).roots()[0].real == pytest.approx(30.20, abs=0.01)
