import math

import numpy as np
import pytest

from tests.turning_sim.delays import equation, root_of
from turning_sim import growth_of

FIELDS = ("modal_mass", "natural_frequency_hz", "damping_ratio", "cutting_stiffness", "overlap", "process_damping",
          "delay_1", "delay_2")  # fmt: skip


def growth(equations, **given):
    return growth_of(**{name: np.array([getattr(e, name) for e in equations]) for name in FIELDS}, **given)


def test_growth_and_frequency_are_those_of_the_rightmost_root():
    """Where few lines are left at the end; where many are (an eighth of these), the growth is that of their energy."""
    rng = np.random.default_rng(5)
    cuts = zip(rng.uniform(-8.0, 8.0, 80), rng.uniform(2e5, 2e6, 80), strict=True)
    equations = [equation(shift, cutting_stiffness=stiffness) for shift, stiffness in cuts]
    roots = np.array([root_of(e) for e in equations])
    found = growth(equations)
    told = np.isfinite(found.frequency_hz)
    assert told.mean() > 0.8
    assert found.rate[told] == pytest.approx(roots.real[told], rel=2e-3, abs=2e-3)
    assert found.frequency_hz[told] == pytest.approx(roots.imag[told] / (2.0 * math.pi), abs=0.01)
    assert found.rate == pytest.approx(roots.real, rel=0.1)
    assert (found.stable == (roots.real < 0.0)).all()


def test_the_cases_of_the_thesis():
    """Equal pitch chatters at 651 Hz, 2.76 deg is quiet; two neighbours that are nearly as strong are told apart."""
    found = growth([equation(), equation(2.2), equation(3.5), equation(2.76)])
    roots = np.array([root_of(equation(shift)) for shift in (0.0, 2.2, 3.5)])
    assert found.rate[:3] == pytest.approx(roots.real, rel=2e-3)
    assert found.frequency_hz[:3] == pytest.approx(roots.imag / (2.0 * math.pi), abs=0.05)
    assert found.stable.tolist() == [False, True, False, True]


def test_runs_that_grow_or_die_beyond_all_numbers_do_no_harm():
    wild = [equation(cutting_stiffness=k, damping_ratio=z, natural_frequency_hz=250.0) for k, z in
            ((4e6, 0.01), (1e5, 0.9))]  # fmt: skip
    found = growth(wild, duration=20.0, sample_rate_hz=12_000.0)
    assert found.rate == pytest.approx([root_of(e).real for e in wild], rel=0.05)


def test_parameters_are_broadcast_and_batches_do_not_matter():
    e, stiffness = equation(1.0), np.linspace(3e5, 1.5e6, 70)
    usual = {name: getattr(e, name) for name in FIELDS}
    many = growth_of(**(usual | {"cutting_stiffness": stiffness}), duration=1.0)
    one = growth_of(**(usual | {"cutting_stiffness": stiffness[-1]}), duration=1.0)
    assert many.rate.shape == (70,)
    assert many.rate[-1] == one.rate[0]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"overlap": np.array([0.5, 2.0])}, r"overlap must be in \[-1, 1\], got 2.0"),
        ({"duration": 0.1}, "duration must be at least 0.50"),
        ({"sample_rate_hz": 1000.0}, "sample_rate_hz must be at least"),
    ],
)
def test_impossible_sweeps_are_refused(changes, message):
    e = equation()
    with pytest.raises(ValueError, match=message):
        growth_of(**({name: getattr(e, name) for name in FIELDS} | changes))


def test_no_runs_are_no_answer():
    assert growth([]).rate.shape == (0,)
