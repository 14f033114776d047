import pytest

from tests.turning_sim.cases import CHUCK, bar
from turning_sim import Chuck, HammerTest, identify_chuck

GUESS = Chuck(lateral_stiffness=1e8, tilt_stiffness=1e5, tilt_damping=3.0)


@pytest.mark.parametrize(
    ("projection", "lateral", "tilt"), [(130e-3, 1.43e8, 6.36e4), (135e-3, 1.80e8, 7.72e4)]
)  # fmt: skip
def test_hammer_test_of_the_sheet(projection, lateral, tilt):
    """One pair of frequencies, 592 and 3611 Hz, read as 130 or as 135 mm gives the two chucks of the model."""
    tests = [HammerTest(length=projection, frequency_hz=f, mode=k) for k, f in ((1, 592.05), (2, 3611.2))]
    found = identify_chuck(bar(chuck=GUESS), *tests)
    assert found.lateral_stiffness == pytest.approx(lateral, rel=5e-3)
    assert found.tilt_stiffness == pytest.approx(tilt, rel=5e-3)
    assert found.tilt_damping == 3.0


def test_two_projections():
    measured = [bar(length=n, chuck=CHUCK).modes(0.0)[0].natural_frequency_hz for n in (160e-3, 130e-3)]
    tests = [HammerTest(length=n, frequency_hz=f) for n, f in zip((160e-3, 130e-3), measured, strict=True)]
    found = identify_chuck(bar(chuck=GUESS), *tests)
    assert found.lateral_stiffness == pytest.approx(1.43e8, rel=1e-4)
    assert found.tilt_stiffness == pytest.approx(6.36e4, rel=1e-4)


def test_refusals():
    first = HammerTest(length=160e-3, frequency_hz=421.0)
    with pytest.raises(ValueError, match="second must be another projection or another mode"):
        identify_chuck(bar(), first, first)
    with pytest.raises(ValueError, match="frequency_hz must be below .* .rigid chuck"):
        identify_chuck(bar(), first, HammerTest(length=160e-3, frequency_hz=9000.0, mode=2))
    with pytest.raises(ValueError, match="mode must be 1, 2 or 3, got 4"):
        HammerTest(length=160e-3, frequency_hz=9000.0, mode=4)
